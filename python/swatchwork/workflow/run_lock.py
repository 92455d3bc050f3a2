# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One run at a time for an output: a lock that ends with the process, and says whose it is."""

from __future__ import annotations

import errno
import json
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from ..errors import InputError, OutputError
from ..whole import NO_LOCKS_HERE, warn_of_no_locks

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

LOCK = "lock"
NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP}
"""What file systems say that keep none, such as some network ones."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold ``folder``, which is made if need be, against other runs.

    The system lets go of the lock when the process ends, however it does: there are no stale ones.

    Raises:
        InputError: another run holds it; says which.
        OutputError: it cannot be written.

    Warns:
        CaptureWarning: system or file system keeps no locks.
    """
    try:
        lock = _taken(folder)
    except BlockingIOError:
        raise InputError(
            f"another run is at work here{_whose(folder / LOCK)}",
            file=folder,
            expected="one run at a time for an output",
            hint="Wait for it, stop it, or choose another output folder.",
        ) from None
    except OSError as error:
        with suppress(OSError):
            folder.rmdir()
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from error
    with lock:
        yield


def _taken(folder: Path) -> IO[str]:
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        # Not emptied before it is ours: it tells others whose it is.
        lock = (folder / LOCK).open("a+", encoding="utf-8")
        try:
            if fcntl is None:
                warn_of_no_locks(folder, NO_LOCKS_HERE)
            else:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in NO_LOCKS:
                lock.close()
                raise
            warn_of_no_locks(folder, f"its file system keeps no locks ({error.strerror})")
        # A run that ended in between has removed the file that this one opened.
        with suppress(FileNotFoundError):
            if fcntl is None or os.fstat(lock.fileno()).st_ino == (folder / LOCK).stat().st_ino:
                _sign(lock)
                return lock
        lock.close()


def _sign(lock: IO[str]) -> None:
    """For people: nothing is decided by it."""
    since = time.strftime("%Y-%m-%d %H:%M:%S %z")
    # A disk too full for it is too full for what follows, which says so.
    with suppress(OSError):
        lock.truncate(0)
        lock.write(json.dumps({"pid": os.getpid(), "host": platform.node(), "since": since}))
        lock.flush()


def _whose(lock: Path) -> str:
    try:
        found = json.loads(lock.read_text(encoding="utf-8"))
        return f": process {found['pid']} on {found['host']}, since {found['since']}"
    except (OSError, ValueError, KeyError, TypeError):
        return ""

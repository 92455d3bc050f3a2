# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Hidden neighbours that results are made in, ``.NAME.<8 hex>.unfinished``; those of dead processes go.

Whoever makes one holds a lock on it, which the system lets go of however the process ends. So a later run
knows without a clock, and without process numbers, which of them nobody will finish.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from secrets import token_hex

from ..errors import CaptureWarning, InputError

try:
    import fcntl
except ImportError:  # Windows: nothing is told apart there, and nothing of others' is removed.
    fcntl = None  # type: ignore[assignment]

UNFINISHED = ".unfinished"
REPLACED = ".replaced"
"""An older folder that stepped aside, where the file system cannot exchange two names."""

NO_LOCKS_HERE = "this system keeps no locks"


def place_of(path: str | PathLike[str]) -> Path:
    """Where a result called ``path`` lies: a symbolic link stays, and what it points at is replaced."""
    path = Path(path)
    return Path(os.path.realpath(path)) if path.is_symlink() else path.absolute()


@contextmanager
def sibling(path: Path, *, folder: bool) -> Iterator[Path]:
    """A new folder, or an empty file of the same suffix, beside ``path``; gone once the block ends.

    Neighbours of the same ``path`` that dead processes left are removed first. Raises OSError.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    sweep(path)
    made, handle = _made(path, folder)
    try:
        yield made
    finally:
        # An error in tidying up must not hide the one above.
        if folder:
            shutil.rmtree(made, ignore_errors=True)
        else:
            with suppress(OSError):
                made.unlink(missing_ok=True)
        if handle is not None:
            os.close(handle)


def named(path: Path, ending: str) -> list[Path]:
    """Neighbours of ``path`` that end so, of whatever process."""
    patterns = (_pattern(path.name, ending, ""), _pattern(path.stem, ending, path.suffix))
    try:
        return sorted(p for p in path.parent.iterdir() if any(q.fullmatch(p.name) for q in patterns))
    except OSError:
        return []


def sweep(path: Path) -> None:
    """Remove what processes that are no more left beside ``path``."""
    for left in named(path, UNFINISHED):
        with suppress(OSError):
            handle = os.open(left, _flags(left))
            try:
                if _locked(handle):
                    shutil.rmtree(left) if left.is_dir() else left.unlink()
            finally:
                os.close(handle)


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Keep other processes that ask for it out of a folder, which is made if need be. Raises OSError.

    Raises:
        InputError: another one has it.

    Warns:
        CaptureWarning: system or file system (NFS, some others) does not lock folders.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if fcntl is None:
        warn_of_no_locks(folder, NO_LOCKS_HERE)
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        ours = _locked(handle)
        if ours is None:
            warn_of_no_locks(folder, "its file system locks no folders")
        if ours is False:
            raise InputError(
                "another run is writing here",
                file=folder,
                expected="one run at a time for an output",
                hint="Wait for it, or choose another output folder.",
            )
        yield
    finally:
        os.close(handle)


def warn_of_no_locks(folder: Path, why: str) -> None:
    """Say that two runs into one output would not be told apart."""
    warnings.warn(
        CaptureWarning(
            f"{folder}: {why}, so that two runs into one output would not be told apart: make sure that this "
            "is the only one"
        ),
        stacklevel=3,
    )


def is_live(unfinished: Path) -> bool:
    """Whether a process is at work in a neighbour; no where that cannot be known."""
    try:
        handle = os.open(unfinished, _flags(unfinished))
    except OSError:
        return False
    try:
        return _locked(handle) is False
    finally:
        os.close(handle)


def sync(path: Path) -> None:
    """Onto the disk, as far as the system can: a file's bytes, a folder's names. Raises OSError."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        if path.is_dir():  # Windows opens no folders.
            return
        raise
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EBADF, errno.ENOTSUP):
            raise
    finally:
        os.close(handle)


def reason_of(error: BaseException, made: Path | None, path: Path) -> str:
    """Why something failed, in words that name ``path`` and not the neighbour it was made in."""
    reason = getattr(error, "strerror", None) or str(error)
    return reason if made is None else reason.replace(str(made), str(path))


def _pattern(stem: str, ending: str, suffix: str) -> re.Pattern[str]:
    return re.compile(rf"\.{re.escape(stem)}\.[0-9a-f]{{8}}{re.escape(ending)}{re.escape(suffix)}")


def _made(path: Path, folder: bool) -> tuple[Path, int | None]:
    while True:
        stem, suffix = (path.name, "") if folder else (path.stem, path.suffix)
        made = path.with_name(f".{stem}.{token_hex(4)}{UNFINISHED}{suffix}")
        if folder:
            made.mkdir()
        elif fcntl is None:
            made.open("x").close()
        if fcntl is None:
            return made, None
        with suppress(FileNotFoundError):
            handle = os.open(made, os.O_RDONLY if folder else os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
            # A run that sweeps may have taken it for a dead one's before it was locked.
            if _locked(handle) is not False and made.exists():
                return made, handle
            os.close(handle)


def _flags(path: Path) -> int:
    """To open it for a lock: NFS gives none on what is open for reading alone, as folders only can be."""
    return os.O_RDONLY if path.is_dir() else os.O_RDWR


def _locked(handle: int) -> bool | None:
    """Whether the lock is ours now; None where the system or the file system knows no such locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True

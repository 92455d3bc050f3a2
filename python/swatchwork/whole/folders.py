# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A folder that is the older one until the new one is whole."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path

from ..errors import InputError, OutputError
from .exchange import exchange
from .siblings import REPLACED, UNFINISHED, named, place_of, reason_of, sibling, sync

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG)
"""A disk, a quota, a disk that is read-only, or the largest file that the shell allows."""

TRIES = 100
"""Of taking a name that other processes take at the same time."""


@contextmanager
def whole_folder(
    folder: str | PathLike[str], replaceable: Callable[[Path], bool], what: str = "an older one"
) -> Iterator[Path]:
    """A temporary sibling to write into, which takes the folder's place once the block ends well.

    Of a symbolic link, the folder that it points at is replaced.

    Args:
        replaceable: whether a folder that is not empty may be.
        what: in words, the folders for which that is so.

    Raises:
        InputError: the folder exists, is not empty, and is not ``replaceable``.
        OutputError: the disk is full, or the place cannot be written. Whatever else the block raises, such
            as an input that cannot be read, comes through as it is.
    """
    folder = place_of(folder)
    fresh: Path | None = None
    in_block = False
    try:
        put_back(folder)
        _check_free(folder, replaceable, what)
        with sibling(folder, folder=True) as fresh:
            in_block = True
            yield fresh
            in_block = False
            for path in [*sorted(fresh.rglob("*")), fresh]:
                sync(path)
            # It may have come to be what it was not when this one began.
            _check_free(folder, replaceable, what)
            _swap(fresh, folder)
    except (OSError, OutputError) as error:
        if in_block and fresh is not None and not is_of_writing(error, fresh):
            raise
        # Name the folder asked for, not the temporary one.
        reason = reason_of(error, fresh, folder)
        raise OutputError(
            f"{folder}: cannot be written ({reason}); what was there before is intact"
        ) from error


def set_aside(folder: Path) -> Path | None:
    """The older folder of that name, which stepped aside for one whose process was killed before it came."""
    folder = place_of(folder)
    return None if folder.exists() else next(iter(named(folder, REPLACED)), None)


def put_back(folder: Path) -> None:
    """Undo what a process did that was killed between two renames. Raises OSError."""
    aside = set_aside(folder)
    if aside is not None:
        # Another process may have done the same.
        with suppress(FileNotFoundError):
            aside.rename(folder)
    if folder.exists():
        for left in named(folder, REPLACED):
            shutil.rmtree(left, ignore_errors=True)


def _check_free(folder: Path, replaceable: Callable[[Path], bool], what: str) -> None:
    if folder.exists() and not (folder.is_dir() and (not any(folder.iterdir()) or replaceable(folder))):
        raise InputError(
            f"exists and is not {what}",
            file=folder,
            expected=f"a new folder, an empty one, or {what}",
            hint="Nothing was written: choose another name, or move it away",
        )


def _swap(fresh: Path, folder: Path) -> None:
    """Let the new folder take the name; the older one then has the new one's, or is gone."""
    for _ in range(TRIES):
        try:
            fresh.rename(folder)
            break
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.EACCES) or not folder.is_dir():
                raise
        # Another process may have moved it in between, and then it is tried again.
        with suppress(FileNotFoundError):
            if exchange(fresh, folder) or _in_two_steps(fresh, folder):
                break
    else:
        raise OSError(errno.EBUSY, "other runs keep taking its place")
    sync(folder.parent)


def _in_two_steps(fresh: Path, folder: Path) -> bool:
    """Where names cannot be exchanged: killed between the renames, `put_back` undoes the first."""
    old = fresh.with_name(fresh.name.removesuffix(UNFINISHED) + REPLACED)
    folder.rename(old)
    try:
        fresh.rename(folder)
    except BaseException:
        if not folder.exists():
            old.rename(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)
    return True


def is_of_writing(error: OSError | OutputError, fresh: Path) -> bool:
    """Whether an error of the block is about the new folder, and not about something the block reads."""
    if isinstance(error, OutputError) or error.errno in FULL:
        return True
    if isinstance(error.filename, str | PathLike):
        return Path(error.filename).is_relative_to(fresh)
    return error.errno == errno.EACCES

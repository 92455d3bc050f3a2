# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A folder that is the older one until the new one is whole."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from ..errors import InputError, OutputError
from .exchange import exchange
from .siblings import REPLACED, UNFINISHED, is_live, named, place_of, reason_of, sibling, sync

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG)
"""A disk, a quota, a disk that is read-only, or the largest file that the shell allows."""

TAKEN = (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST)
"""What a rename says where another process was faster."""

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
        put_back(folder, replaceable)
        _check_free(folder, replaceable, what)
        with sibling(folder, folder=True) as fresh:
            in_block = True
            yield fresh
            in_block = False
            for path in [*sorted(fresh.rglob("*")), fresh]:
                sync(path)
            _swap(fresh, folder, lambda: _check_free(folder, replaceable, what))
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


def put_back(folder: Path, replaceable: Callable[[Path], bool]) -> None:
    """Undo what a process did that was killed between two renames. Raises OSError.

    What stepped aside is removed only where what has its place by now is of its kind: it may be all there is.
    """
    for aside in named(folder, REPLACED):
        if is_live(aside.with_name(aside.name.removesuffix(REPLACED) + UNFINISHED)):
            continue
        if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
            try:
                aside.rename(folder)
            except OSError as error:
                # Another process may have done the same.
                if error.errno not in TAKEN:
                    raise
        elif replaceable(folder):
            shutil.rmtree(aside, ignore_errors=True)


def _check_free(folder: Path, replaceable: Callable[[Path], bool], what: str) -> None:
    if folder.exists() and not (folder.is_dir() and (not any(folder.iterdir()) or replaceable(folder))):
        raise InputError(
            f"exists and is not {what}",
            file=folder,
            expected=f"a new folder, an empty one, or {what}",
            hint="Nothing was written: choose another name, or move it away",
        )


def _swap(fresh: Path, folder: Path, check_free: Callable[[], None]) -> None:
    """Let the new folder take the name; the older one then has the new one's, or is gone."""
    for _ in range(TRIES):
        # It may have come to be what it was not when this one began.
        check_free()
        try:
            fresh.rename(folder)
            break
        except OSError as error:
            if error.errno not in (*TAKEN, errno.EACCES) or not folder.is_dir():
                raise
        try:
            if exchange(fresh, folder) or _in_two_steps(fresh, folder):
                break
        except OSError as error:
            # Another process has moved it in between, or put another there: it is tried again.
            if error.errno not in TAKEN:
                raise
    else:
        raise OSError(errno.EBUSY, "other runs keep taking its place")
    sync(folder.parent)


def _in_two_steps(fresh: Path, folder: Path) -> bool:
    """Where names cannot be exchanged: killed between the renames, `put_back` undoes the first."""
    old = fresh.with_name(fresh.name.removesuffix(UNFINISHED) + REPLACED)
    # Of an earlier try: another process has put a newer one in its place since.
    shutil.rmtree(old, ignore_errors=True)
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

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Files that belong together, written into a folder that may hold others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError, OutputError
from ..whole import is_of_writing, place_of, reason_of, sibling, sync


@contextmanager
def files_together(
    folder: Path, last: str, listed: Callable[[Path], Iterable[str]] = lambda _: ()
) -> Iterator[Path]:
    """A folder to write files in, which come to ``folder`` once all are whole; an error before leaves none.

    The one called ``last`` comes at the end, and an older one of that name goes first: where it is, the
    files beside it are its own. Files that the older one lists, by ``listed``, and that are not written
    again go too, before it: were they left, they would be taken for this run's.

    Args:
        listed: from the older ``last`` the names of the files written with it; anything else is left alone.

    Raises:
        InputError: ``folder`` is a file.
        OutputError: it cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("is a file", file=folder, expected="a folder to write in")
    folder = place_of(folder)
    # Where there is a folder, its parent may be another's.
    beside = folder / folder.name if folder.is_dir() else folder
    made: Path | None = None
    in_block = False
    try:
        with sibling(beside, folder=True) as made:
            in_block = True
            yield made
            in_block = False
            for file in made.iterdir():
                sync(file)
            folder.mkdir(exist_ok=True)
            if (folder / last).is_file():
                for stale in {*listed(folder / last)} - {file.name for file in made.iterdir()}:
                    # A name alone: nothing outside the folder, whatever the list says.
                    if stale == Path(stale).name and stale not in ("", ".."):
                        (folder / stale).unlink(missing_ok=True)
            (folder / last).unlink(missing_ok=True)
            for file in sorted(made.iterdir(), key=lambda path: path.name == last):
                file.replace(folder / file.name)
            sync(folder)
    except OSError as error:
        if in_block and made is not None and not is_of_writing(error, made):
            raise
        raise OutputError(f"{folder}: cannot be written ({reason_of(error, made, folder)})") from error

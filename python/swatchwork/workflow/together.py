# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Files that belong together, written into a folder that may hold others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from ..errors import InputError, OutputError


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
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        # Where there is a folder, its parent may be another's.
        beside = folder if folder.is_dir() else folder.parent
        made = TemporaryDirectory(prefix=f".{folder.name}.partial-", dir=beside)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
    with made as name:
        yield Path(name)
        try:
            folder.mkdir(exist_ok=True)
            if (folder / last).is_file():
                for stale in {*listed(folder / last)} - {file.name for file in Path(name).iterdir()}:
                    # A name alone: nothing outside the folder, whatever the list says.
                    if stale == Path(stale).name and stale not in ("", ".."):
                        (folder / stale).unlink(missing_ok=True)
            (folder / last).unlink(missing_ok=True)
            for file in sorted(Path(name).iterdir(), key=lambda path: path.name == last):
                file.replace(folder / file.name)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error


def write_text(file: Path, text: str) -> None:
    """Raises OutputError where it cannot be written."""
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{file}: cannot be written ({error.strerror})") from error

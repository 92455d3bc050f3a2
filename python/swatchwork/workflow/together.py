# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Files that belong together, written into a folder that may hold others."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from ..errors import InputError, OutputError


@contextmanager
def files_together(folder: Path, last: str) -> Iterator[Path]:
    """A folder to write files in, which come to ``folder`` once all are whole; an error before leaves none.

    The one called ``last`` comes at the end, and an older one of that name goes first: where it is, the
    files beside it are its own.

    Raises:
        InputError: ``folder`` is a file.
        OutputError: it cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("is a file", file=folder, expected="a folder to write in")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        made = TemporaryDirectory(prefix=f".{folder.name}.partial-", dir=folder.parent)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
    with made as name:
        yield Path(name)
        try:
            folder.mkdir(exist_ok=True)
            (folder / last).unlink(missing_ok=True)
            for file in sorted(Path(name).iterdir(), key=lambda path: path.name == last):
                file.replace(folder / file.name)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error

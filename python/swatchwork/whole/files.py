# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A file that is the older one until the new one is whole."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from ..errors import OutputError
from .siblings import place_of, reason_of, sibling, sync


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[Path]:
    """An empty file beside ``path``, of the same suffix, that takes its name when the block ends well.

    ``path``'s folder is made if need be; of a symbolic link, what it points at is replaced.

    Raises:
        OutputError: the disk is full, the place cannot be written, or it is a device; what was there is
            intact.
    """
    asked, path, made = path, place_of(path), None
    try:
        if path.is_dir():
            raise OutputError("it is a folder")
        if path.exists() and not path.is_file():
            # Root may rename over a device, which would then be a file to every other program.
            raise OutputError("it is a device, a pipe or a socket, and no file")
        with sibling(path, folder=False) as made:
            yield made
            sync(made)
            os.replace(made, path)
            sync(path.parent)
    except (OSError, OutputError) as error:
        raise OutputError(f"{asked}: cannot be written ({reason_of(error, made, path)})") from error


def whole_text(path: str | PathLike[str], text: str) -> Path:
    """Write UTF-8 as `whole_file` does; gives the path."""
    with whole_file(path) as made:
        made.write_text(text, encoding="utf-8")
    return Path(path)


def write_text(file: Path, text: str) -> None:
    """Write a file of a folder that is not visible yet. Raises OutputError where it cannot be written."""
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{file}: cannot be written ({error.strerror})") from error

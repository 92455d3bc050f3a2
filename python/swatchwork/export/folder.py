# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The folder of an export: whole or not at all, and only ever in the place of an older export."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

from ..capture import read_json
from ..errors import InputError
from ..whole import whole_folder

FORMAT = "swatchwork-export"
HEAD = "export.json"


def is_export_folder(folder: str | PathLike[str]) -> bool:
    """Whether the folder's export.json says that it is one."""
    try:
        head = read_json(Path(folder) / HEAD)
    except InputError:
        return False
    return isinstance(head, dict) and head.get("format") == FORMAT


def check_free(folder: str | PathLike[str]) -> None:
    """Raise InputError where something else than an older export is in the way."""
    folder = Path(folder)
    if folder.exists() and not (folder.is_dir() and (not any(folder.iterdir()) or is_export_folder(folder))):
        raise InputError(
            "exists and is not an export",
            file=folder,
            expected="a new folder, an empty one, or an older export",
            hint="Nothing was written: choose another name, or move it away",
        )


@contextmanager
def export_folder(folder: str | PathLike[str], target: str) -> Iterator[tuple[Path, dict[str, Any]]]:
    """A folder to write in that appears when the block ends well, and what its export.json is to say."""
    check_free(folder)
    head: dict[str, Any] = {"format": FORMAT, "target": target, "swatchwork": version("swatchwork")}
    with whole_folder(folder, is_export_folder, "an export") as fresh:
        yield fresh, head
        write_json(fresh / HEAD, head)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON for people to read too."""
    path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Typed access to a JSON object whose errors name the file, the frame and the key."""

from __future__ import annotations

import math
import os
import reprlib
import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture.guarding import MOST_NAME_BYTES, MOST_PATH_BYTES
from swatchwork.errors import InputError

REQUIRED: Any = object()
"""Default of a key that must be there."""

LINKS_INTO = "SWATCHWORK_LINKS_INTO"
"""Environment variable: folders, separated as in PATH, that symbolic links of captures may lead into."""


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80


class Fields:
    """A JSON object, and where it stands.

    Args:
        values: the parsed object.
        where: file and frame, for messages.
        fallback: fields that stand in for keys this object lacks (a frame's global intrinsics).
    """

    def __init__(self, values: Any, where: str, fallback: Fields | None = None) -> None:
        if not isinstance(values, dict):
            raise InputError(f"found {shown(values)}", file=where, expected="a JSON object")
        self.values: dict[str, Any] = values
        self.where = where
        self.fallback = fallback

    def __contains__(self, key: str) -> bool:
        """Whether the key has a value here or in the fallback; null counts as absent."""
        here = self.values.get(key) is not None
        return here or (self.fallback is not None and key in self.fallback)

    def raw(self, key: str, default: Any = REQUIRED) -> Any:
        """The value of a key, of any type."""
        if self.values.get(key) is not None:
            return self.values[key]
        if self.fallback is not None and key in self.fallback:
            return self.fallback.raw(key)
        if default is REQUIRED:
            raise InputError(f'key "{key}" is missing', file=self.where, expected=f'a value for "{key}"')
        return default

    def number(self, key: str, default: Any = REQUIRED, *, positive: bool = False) -> float:
        """A finite number."""
        value = self.raw(key, default)
        expected = "a positive number" if positive else "a finite number"
        if not _is_number(value):
            raise self.error(key, value, expected)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number) or (positive and number <= 0):
            raise self.error(key, value, expected)
        return number

    def pixels(self, key: str) -> int:
        """A positive whole number of pixels; 800.0 counts as 800, since some writers say so."""
        value = self.number(key, positive=True)
        if value != int(value):
            raise self.error(key, value, "a whole number of pixels")
        return int(value)

    def text(self, key: str, default: Any = REQUIRED) -> str:
        """A string that is not empty."""
        value = self.raw(key, default)
        if not isinstance(value, str) or not value:
            raise self.error(key, value, "a string")
        return value

    def items(self, key: str, default: Any = REQUIRED) -> list[Any]:
        """A list."""
        value = self.raw(key, default)
        if not isinstance(value, list):
            raise self.error(key, value, "a list")
        return value

    def matrix(self, key: str) -> F64:
        """A list of rows of numbers, not yet checked for shape."""
        value = self.raw(key)
        rows = value if isinstance(value, list) and len(value) in (3, 4) else []
        # NumPy would make numbers of strings and of true, and raise at integers that no double holds.
        if not rows or not all(isinstance(r, list) and len(r) == 4 and all(map(_is_number, r)) for r in rows):
            raise self.error(key, value, "4 rows of 4 numbers")
        try:
            return np.array(rows, dtype=np.float64)
        except OverflowError:
            raise self.error(key, value, "4 rows of 4 finite numbers") from None

    def error(self, key: str, value: Any, expected: str) -> InputError:
        """The error for a key whose value is not what it should be."""
        return InputError(f'"{key}" is {shown(value)}', file=self.where, expected=expected)


def path_within(
    root: Path, text: str, where: str, key: str, *, above: int = 0, links: bool = True, shared: bool = False
) -> Path:
    """The file that a relative path means, refused where it leaves the folder ``root``.

    ``above`` folders up are still allowed: a test set shares its capture's ``../mesh.obj``. A symbolic link
    is followed to where the path could have pointed by itself, and into the folders of `LINKS_INTO`: else a
    downloaded capture could bring a private file of its user's into a report that is passed on. With
    ``shared`` it may also lead into the folder above where that is a capture, as a test set's photographs
    do. ``links`` False: it is not followed at all, for a file that is named and not read.

    Raises:
        InputError: an absolute path, one that leaves the folder by itself or by a link, the folder itself,
            or a name with control characters.
    """
    slashed = text.replace("\\", "/")
    if any(unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp") for c in text):
        raise InputError(
            f'"{key}" is {shown(text)}', file=where, expected="a file name without control characters"
        )
    names = slashed.encode().split(b"/")
    if max(map(len, names)) > MOST_NAME_BYTES or len(slashed.encode()) > MOST_PATH_BYTES:
        raise InputError(
            f'"{key}" is {shown(text)}, {len(slashed.encode())} bytes long',
            file=where,
            expected=f"a path of {MOST_PATH_BYTES} bytes at most, of names of {MOST_NAME_BYTES}",
        )
    relative = os.path.normpath(slashed)
    climbs = relative.split("/").count("..")
    drive = len(slashed) > 1 and slashed[1] == ":" and slashed[0].isalpha()
    allowed = f"a relative path inside {root}" + (" or the folder above it" if above else "")
    if os.path.isabs(relative) or drive or "://" in slashed or climbs > above:
        raise InputError(
            f'"{key}" is {shown(text)}, outside the capture folder',
            file=where,
            expected=allowed,
            hint="Copy the file into the capture folder",
        )
    if relative.split("/")[-1] in (".", ".."):
        raise InputError(f'"{key}" is {shown(text)}, a folder', file=where, expected="a file's name")
    path = root / relative
    home = os.path.realpath(root)
    parent = os.path.dirname(home)
    up = above or (shared and os.path.isfile(os.path.join(parent, "transforms.json")))
    if links and (real := leads_outside(path, [parent if up else home])):
        raise InputError(
            f'"{key}" is {shown(text)}, a link that leads outside the capture folder, to {real}',
            file=where,
            expected=allowed,
            hint=f"Copy the file into the capture folder, or name its folder in {LINKS_INTO} if you trust it",
        )
    return path


def leads_outside(path: Path, homes: Sequence[str | os.PathLike[str]]) -> str | None:
    """What a path means once its links are followed, where that is neither in ``homes`` nor `LINKS_INTO`."""
    trusted = [f for f in os.environ.get(LINKS_INTO, "").split(os.pathsep) if f]
    real = os.path.realpath(path)
    inside = any(_lies_in(real, os.path.realpath(folder)) for folder in (*homes, *trusted))
    return None if inside else real


def is_file(path: Path) -> bool:
    """Whether it is a regular file; False also for names that no file can have."""
    return os.path.isfile(path)


def shown(value: Any) -> str:
    """A value for messages: escaped, and not too long."""
    text = _SHORT.repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _lies_in(real: str, folder: str) -> bool:
    return real.startswith(folder.rstrip(os.sep) + os.sep)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Typed access to a JSON object whose errors name the file, the frame and the key."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.arrays import F64
from swatchwork.errors import InputError

REQUIRED: Any = object()
"""Default of a key that must be there."""


class Fields:
    """A JSON object, and where it stands.

    Args:
        values: the parsed object.
        where: file and frame, for messages.
        fallback: fields that stand in for keys this object lacks (a frame's global intrinsics).
    """

    def __init__(self, values: Any, where: str, fallback: Fields | None = None) -> None:
        if not isinstance(values, dict):
            raise InputError(f"found {_shown(values)}", file=where, expected="a JSON object")
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
        if isinstance(value, bool) or not isinstance(value, int | float):
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
        try:
            matrix = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise self.error(key, value, "4 rows of 4 numbers") from None
        if matrix.shape not in ((4, 4), (3, 4)):
            raise self.error(key, value, "4 rows of 4 numbers")
        return matrix

    def error(self, key: str, value: Any, expected: str) -> InputError:
        """The error for a key whose value is not what it should be."""
        return InputError(f'"{key}" is {_shown(value)}', file=self.where, expected=expected)


def path_within(root: Path, text: str, where: str, key: str, *, above: int = 0) -> Path:
    """The file that a relative path means, refused where it leaves the folder ``root``.

    ``above`` folders up are still allowed: a test set shares its capture's ``../mesh.obj``. Symbolic
    links are the user's own business and are followed.

    Raises:
        InputError: an absolute path, or one that leaves the folder.
    """
    relative = os.path.normpath(text.replace("\\", "/"))
    climbs = relative.split("/").count("..")
    if os.path.isabs(relative) or Path(text).drive or climbs > above or "\0" in text:
        allowed = f"a relative path inside {root}" + (" or the folder above it" if above else "")
        raise InputError(
            f'"{key}" is {_shown(text)}, outside the capture folder',
            file=where,
            expected=allowed,
            hint="Copy or link the file into the capture folder",
        )
    return root / relative


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Which multipliers RAW files are balanced with.

Photographs and light probe are on one scale only with the same ones, channel by channel.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from ..errors import InputError
from .earlier import from_earlier

WhiteBalance = Literal["daylight", "camera"] | tuple[float, float, float]
"""Multipliers of the camera's red, green and blue: its daylight ones (D65), those stored with the picture, or
given ones."""


def earlier_white_balance(file: Path) -> tuple[float, float, float]:
    """The multipliers that a linearize.json says were used.

    Raises:
        InputError: it cannot be read, or holds none.
    """
    expected = "a linearize.json of RAW files, to use the same white balance"

    def read(document: dict[str, Any]) -> tuple[float, float, float]:
        r, g, b = (float(m) for m in document["raw"]["white_balance"])
        return r, g, b

    found = from_earlier(file, "white balance", expected, read)
    if not all(0 < m < float("inf") for m in found):
        raise InputError(f"the white balance is {found}", file=file, expected="three positive multipliers")
    return found

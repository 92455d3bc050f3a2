# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Options that describe a calibration board, for the commands that look for one."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError

if TYPE_CHECKING:
    from ..prepare import Board

Checker = Annotated[
    str | None, typer.Option(metavar="COLUMNSxROWS", help="Checkerboard: its inner corners, such as 9x6.")
]
CharucoSize = Annotated[
    str | None,
    typer.Option(metavar="COLUMNSxROWS", help="Instead, ChArUco board: its squares, such as 7x5."),
]
Marker = Annotated[
    float, typer.Option(metavar="SHARE", help="ChArUco: side of a marker over that of a square.")
]
Dictionary = Annotated[str, typer.Option(metavar="NAME", help="ChArUco: OpenCV's name of its markers.")]
Legacy = Annotated[bool, typer.Option("--legacy", help="ChArUco: a board made by OpenCV before 4.6.")]
MARKER, DICTIONARY = 0.75, "4X4_50"


def board_of(
    board: str | None, charuco: str | None, marker: float, dictionary: str, legacy: bool
) -> Board | None:
    """The board described; None where neither kind is given.

    Raises:
        InputError: both kinds are given, or one with a wrong size.
    """
    from ..prepare import Charuco, Checkerboard

    if board is not None and charuco is not None:
        raise InputError("both --board and --charuco are given", expected="one of them")
    if board is not None:
        return Checkerboard(*_sides(board, "--board", "inner corners, such as 9x6"))
    if charuco is not None:
        columns, rows = _sides(charuco, "--charuco", "squares, such as 7x5")
        return Charuco(columns, rows, marker, dictionary, legacy)
    return None


def _sides(text: str, option: str, expected: str) -> tuple[int, int]:
    match = re.fullmatch(r"\s*(\d{1,4})\s*[xX]\s*(\d{1,4})\s*", text)
    if match is None:
        raise InputError(f"{option} is {text!r}", expected=f"COLUMNSxROWS {expected}")
    return int(match[1]), int(match[2])

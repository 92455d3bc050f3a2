# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Options that describe a calibration board, for the commands that look for one."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Any

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
    float | None,
    typer.Option(
        metavar="SHARE", help="ChArUco: side of a marker over that of a square.", show_default="0.75"
    ),
]
Dictionary = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="ChArUco: OpenCV's name of its markers.", show_default="4X4_50"),
]
Legacy = Annotated[bool, typer.Option("--legacy", help="ChArUco: a board made by OpenCV before 4.6.")]
# None is not given: then `Charuco` has its own, which the help names.
MARKER: float | None = None
DICTIONARY: str | None = None


def board_of(
    board: str | None, charuco: str | None, marker: float | None, dictionary: str | None, legacy: bool
) -> Board | None:
    """The board described; None where neither kind is given.

    Raises:
        InputError: both kinds are given, one with a wrong size, or a ChArUco board's option without one.
    """
    from ..prepare import Charuco, Checkerboard

    if board is not None and charuco is not None:
        raise InputError("both --board and --charuco are given", expected="one of them")
    given: dict[str, Any] = {"marker": marker, "dictionary": dictionary, "legacy": legacy or None}
    given = {name: value for name, value in given.items() if value is not None}
    if charuco is None and given:
        raise InputError(
            f"--{next(iter(given))} is an option of ChArUco boards",
            expected="--charuco COLUMNSxROWS too",
            hint="Leave it out with a checkerboard" if board is not None else None,
        )
    if board is not None:
        return Checkerboard(*_sides(board, "--board", "inner corners, such as 9x6"))
    if charuco is not None:
        columns, rows = _sides(charuco, "--charuco", "squares, such as 7x5")
        return Charuco(columns, rows, **given)
    return None


def _sides(text: str, option: str, expected: str) -> tuple[int, int]:
    match = re.fullmatch(r"\s*(\d{1,4})\s*[xX]\s*(\d{1,4})\s*", text)
    if match is None:
        raise InputError(f"{option} is {text!r}", expected=f"COLUMNSxROWS {expected}")
    return int(match[1]), int(match[2])

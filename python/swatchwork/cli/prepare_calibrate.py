# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork prepare calibrate``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .console import session
from .options import AsJson, Quiet, Verbose


def calibrate(
    photographs: Annotated[
        list[Path], typer.Argument(help="Photographs of the board, or folders of them; 10 to 20, tilted.")
    ],
    *,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="JSON to write; a picture of the corners goes beside it.")
    ],
    board: Annotated[
        str | None, typer.Option(metavar="COLUMNSxROWS", help="Checkerboard: its inner corners, such as 9x6.")
    ] = None,
    charuco: Annotated[
        str | None,
        typer.Option(metavar="COLUMNSxROWS", help="Instead, ChArUco board: its squares, such as 7x5."),
    ] = None,
    marker: Annotated[
        float, typer.Option(metavar="SHARE", help="ChArUco: side of a marker over that of a square.")
    ] = 0.75,
    dictionary: Annotated[
        str, typer.Option(metavar="NAME", help="ChArUco: OpenCV's name of its markers.")
    ] = "4X4_50",
    legacy: Annotated[
        bool, typer.Option("--legacy", help="ChArUco: a board made by OpenCV before 4.6.")
    ] = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Find focal lengths, principal point and lens distortion from photographs of a flat board.

    The JSON has the keys of transforms.json (w, h, fl_x, fl_y, cx, cy, k1, k2, p1, p2; pixel centres at +0.5)
    and figures: the rms of what is left between corners and model, overall and of each image, outliers,
    coverage.

    Examples:

    swatchwork prepare calibrate board-photos --board 9x6 -o intrinsics.json

    swatchwork prepare calibrate board-photos --charuco 7x5 --marker 0.7 -o intrinsics.json
    """
    from ..prepare import Board, Charuco, Checkerboard
    from ..workflow import calibrate_photographs

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        if board is not None and charuco is not None:
            raise InputError("both --board and --charuco are given", expected="one of them")
        given: Board
        if board is not None:
            given = Checkerboard(*_sides(board, "--board", "inner corners, such as 9x6"))
        elif charuco is not None:
            columns, rows = _sides(charuco, "--charuco", "squares, such as 7x5")
            given = Charuco(columns, rows, marker, dictionary, legacy)
        else:
            raise InputError("no board is given", expected="--board COLUMNSxROWS or --charuco COLUMNSxROWS")
        found = calibrate_photographs(photographs, output, given, run.progress)
        run.say(found.in_words())
        run.result(found.as_dict())


def _sides(text: str, option: str, expected: str) -> tuple[int, int]:
    match = re.fullmatch(r"\s*(\d{1,4})\s*[xX]\s*(\d{1,4})\s*", text)
    if match is None:
        raise InputError(f"{option} is {text!r}", expected=f"COLUMNSxROWS {expected}")
    return int(match[1]), int(match[2])

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork prepare calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .board_options import (
    DICTIONARY,
    MARKER,
    CharucoSize,
    Checker,
    Dictionary,
    Legacy,
    Marker,
    board_of,
)
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
    board: Checker = None,
    charuco: CharucoSize = None,
    marker: Marker = MARKER,
    dictionary: Dictionary = DICTIONARY,
    legacy: Legacy = False,
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
    from ..workflow import calibrate_photographs

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        given = board_of(board, charuco, marker, dictionary, legacy)
        if given is None:
            raise InputError("no board is given", expected="--board COLUMNSxROWS or --charuco COLUMNSxROWS")
        found = calibrate_photographs(photographs, output, given, run.progress)
        run.say(found.in_words())
        run.result(found.as_dict())

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork prepare register``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

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
from .options import AsJson, ItsConvention, Link, Quiet, Verbose, light_source


class Others(StrEnum):
    """How photographs without pairs are placed."""

    features = "features"
    colmap = "colmap"
    none = "none"


def register(
    photographs: Annotated[
        list[Path],
        typer.Argument(help="Photographs of the object, or folders of them; best the linear EXRs."),
    ],
    *,
    intrinsics: Annotated[Path, typer.Option(help="Lens of all photographs: JSON of `prepare calibrate`.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Capture folder to write: new, or empty.")],
    mesh: Annotated[
        Path | None,
        typer.Option(
            help="The object; its coordinates become the capture's world.",
            show_default="required, or --sphere",
        ),
    ] = None,
    sphere: Annotated[
        float | None,
        typer.Option(metavar="RADIUS", help="Instead of a mesh: the object is a sphere. Takes masks."),
    ] = None,
    board: Checker = None,
    charuco: CharucoSize = None,
    square: Annotated[
        float | None,
        typer.Option(metavar="LENGTH", help="Side of the board's squares, in the mesh's unit."),
    ] = None,
    marker: Marker = MARKER,
    dictionary: Dictionary = DICTIONARY,
    legacy: Legacy = False,
    pairs: Annotated[
        Path | None,
        typer.Option(help="Points marked in one or more photographs: JSON of `prepare pairs`."),
    ] = None,
    masks: Annotated[
        Path | None,
        typer.Option(
            help="Folder of masks, NAME.png or STEM.png for each photograph.", show_default="alpha, or none"
        ),
    ] = None,
    others: Annotated[
        Others,
        typer.Option(
            help="How photographs without pairs are placed first: by SIFT features on the mesh, by structure "
            "from motion (pycolmap), or neither. Silhouettes then place those left that have a mask."
        ),
    ] = Others.features,
    scan_error: Annotated[
        float,
        typer.Option(min=0, metavar="LENGTH", help="Standard deviation of the scan's surface, in its unit."),
    ] = 0.0,
    environment: Annotated[
        Path | None,
        typer.Option(
            help="HDR light probe in the mesh's world.",
            show_default="added later by `prepare probe --capture`",
        ),
    ] = None,
    convention: ItsConvention = None,
    link: Link = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Find where photographs were taken from, and write the capture.

    With clean masks often nothing else is needed: a silhouette that only one pose explains places its
    photograph. Otherwise mark 6 to 12 points in one photograph and on the mesh first (`swatchwork prepare
    pairs`); the others follow by features that they share and by their silhouettes, and all poses are refined
    together with the mesh held fixed. A board in the photographs that does not move with respect to the
    object places all of them that show it, and pairs place the mesh among these; without pairs the mesh's
    coordinates are the board's (origin at the first inner corner, x along the columns, z into the board). A
    sphere needs neither scan nor pairs. register.html shows the mesh over each photograph.

    Examples:

    swatchwork prepare register linear --mesh scan.ply --intrinsics lens.json --masks masks -o capture

    swatchwork prepare pairs linear/IMG_0001.exr --mesh scan.ply --intrinsics lens.json -o pairs.json

    swatchwork prepare register linear --mesh scan.ply --intrinsics lens.json --pairs pairs.json -o capture

    swatchwork prepare register linear --sphere 20 --board 9x6 --square 5 --masks masks --intrinsics lens.json
    -o capture
    """
    from ..workflow import register_photographs

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        given = board_of(board, charuco, marker, dictionary, legacy)
        found = register_photographs(
            photographs,
            output,
            mesh=mesh,
            sphere=sphere,
            board=given,
            square=square,
            intrinsics=intrinsics,
            pairs=pairs,
            masks=masks,
            others=others.value,
            scan_error=scan_error,
            environment=light_source(environment, convention),
            link=link,
            progress=run.progress,
        )
        run.say(found.in_words())
        run.result(found.as_dict())

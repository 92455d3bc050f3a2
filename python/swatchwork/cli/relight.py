# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork relight``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .console import session
from .options import (
    AsJson,
    OtherConvention,
    OtherLight,
    Quiet,
    Threads,
    Turn,
    Verbose,
    parse_rotation,
    use_threads,
)


class Moving(StrEnum):
    """File types of a turntable."""

    gif = "gif"
    mp4 = "mp4"


def relight(
    material: Annotated[Path, typer.Argument(help="Material folder, as reconstruct writes it.")],
    *,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the renders.")],
    cameras: Annotated[
        Path | None,
        typer.Option(help="transforms.json with the cameras, and the light unless --environment is given."),
    ] = None,
    environment: OtherLight = None,
    convention: OtherConvention = None,
    environment_rotation: Turn = None,
    turntable: Annotated[
        int,
        typer.Option(
            min=0, metavar="FRAMES", help="Also turn the object before the first camera, at FRAMES angles."
        ),
    ] = 0,
    turntable_format: Annotated[Moving, typer.Option(help="File type of the turntable.")] = Moving.gif,
    samples: Annotated[
        int,
        typer.Option(
            min=1,
            max=8,
            metavar="COUNT",
            help="Samples along a pixel's side at edges; from 2 on, more at rims of highlights and shadows.",
        ),
    ] = 2,
    interreflections: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=8,
            metavar="BOUNCES",
            help="Times that light may go on from the object to the object; a light takes seconds more.",
            show_default="2 for a material recovered with them, else 0",
        ),
    ] = None,
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Render a material from given cameras, under their light or another.

    One EXR a frame under the frame's own file name: linear, RGB premultiplied by alpha; and a PNG beside it
    to look at (gamma 2.2).

    Examples:

    swatchwork relight my-material --cameras my-capture/test/transforms.json -o renders

    swatchwork relight my-material --cameras cameras.json --environment sky.exr --convention blender -o out

    swatchwork relight my-material --cameras cameras.json --environment-rotation z:90 -o renders
    """
    if cameras is None:
        raise InputError(
            "--cameras is missing", expected="a transforms.json", hint="The capture's own will do"
        )
    rotation = parse_rotation(environment_rotation)
    use_threads(threads)
    from ..workflow import relight_folder

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        summary = relight_folder(
            material,
            cameras,
            output,
            environment=environment,
            convention=None if convention is None else convention.value,
            rotation=rotation,
            turntable_frames=turntable,
            turntable_format=turntable_format.value,
            samples=samples,
            interreflections=interreflections,
            progress=run.progress,
        )
        run.say(summary.in_words())
        run.result(summary.as_dict())

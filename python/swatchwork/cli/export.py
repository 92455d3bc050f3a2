# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork export``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

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


class Format(StrEnum):
    """What to write."""

    gltf = "gltf"
    mitsuba = "mitsuba"
    blender = "blender"
    materialx = "materialx"
    maps = "maps"


class Axis(StrEnum):
    """World axes that may point up."""

    y = "y"
    z = "z"


def export(
    material: Annotated[Path, typer.Argument(help="Material folder, as reconstruct writes it.")],
    *,
    target: Annotated[Format, typer.Option("--format", help="The program or format to write for.")],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Folder of the export; for gltf it may be a file, NAME.glb."),
    ],
    cameras: Annotated[
        Path | None,
        typer.Option(
            help="transforms.json with the cameras and light of the scene (mitsuba, blender).",
            show_default="a made-up view and sky",
        ),
    ] = None,
    environment: OtherLight = None,
    convention: OtherConvention = None,
    environment_rotation: Turn = None,
    up: Annotated[
        Axis | None,
        typer.Option(
            help="World axis that points up (gltf, which lays it along y; mitsuba and blender without "
            "--cameras, for the made-up view and sky).",
            show_default="z, whatever the format",
        ),
    ] = None,
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Write a material for another program.

    mitsuba: a scene and a BSDF plugin that renders the material exactly. maps: EXR and PNG images. gltf,
    materialx and blender have one lobe where the material has many: it is fitted in rendered appearance, and
    what that costs is said.

    Examples:

    swatchwork export my-material --format gltf -o my-object.glb

    swatchwork export my-material --format mitsuba --cameras my-capture/test/transforms.json -o my-scene

    swatchwork export my-material --format maps -o my-maps
    """
    rotation = parse_rotation(environment_rotation)
    use_threads(threads)
    from ..workflow import export_material

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        summary = export_material(
            material,
            output,
            target.value,
            cameras=cameras,
            environment=environment,
            convention=None if convention is None else convention.value,
            rotation=rotation,
            up=None if up is None else up.value,
            progress=run.progress,
        )
        run.say(summary.in_words())
        run.result(summary.as_dict())

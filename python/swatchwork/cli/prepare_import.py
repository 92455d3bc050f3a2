# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork prepare import``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .console import session
from .options import AsJson, ItsConvention, Link, Quiet, Verbose, light_source


class Format(StrEnum):
    """Names of the layouts."""

    colmap = "colmap"
    metashape = "metashape"
    nerf_blender = "nerf-blender"
    stanford_orb = "stanford-orb"
    objects_with_lighting = "objects-with-lighting"


def import_(
    source: Annotated[Path, typer.Argument(help="Folder or file of the other program or data set.")],
    *,
    output: Annotated[Path, typer.Option("-o", "--output", help="Capture folder to write: new, or empty.")],
    format: Annotated[
        Format | None, typer.Option(help="Layout of the source.", show_default="what it looks like")
    ] = None,
    mesh: Annotated[
        Path | None,
        typer.Option(help="The object's mesh, in the cameras' world.", show_default="the source's own"),
    ] = None,
    environment: Annotated[
        Path | None, typer.Option(help="HDR light probe.", show_default="the source's own")
    ] = None,
    convention: ItsConvention = None,
    environment_rotation: Annotated[
        str | None,
        typer.Option(metavar="AXIS:DEGREES", help="Turn the probe about a world axis, right-handed."),
    ] = None,
    images: Annotated[
        Path | None, typer.Option(help="Folder of the photographs.", show_default="beside the cameras")
    ] = None,
    masks: Annotated[
        Path | None,
        typer.Option(
            help="Folder of masks, NAME.png or STEM.png for each photograph.", show_default="the source's own"
        ),
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Part of a data set.",
            show_default="train of nerf-blender, test of stanford-orb, inputs of objects-with-lighting",
        ),
    ] = None,
    link: Link = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Make a capture of another program's folder: COLMAP, Metashape, NeRF, or a data set.

    Cameras, masks and light probes are converted from the conventions of each; the mesh must be in the same
    world as the cameras. Look at the result with swatchwork check.

    Examples:

    swatchwork prepare import scan -o capture --mesh scan.ply --environment probe.exr --convention mitsuba

    swatchwork prepare import blender_HDR/teapot_scene001 -o capture --format stanford-orb
    """
    from ..prepare.importing import import_capture

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        found = import_capture(
            source,
            output,
            layout=format.value if format is not None else None,
            mesh=mesh,
            environment=light_source(environment, convention, environment_rotation),
            images=images,
            masks=masks,
            split=split,
            link=link,
            progress=run.progress,
        )
        run.say(found.in_words())
        run.result(found.as_dict())

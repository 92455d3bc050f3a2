# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork prepare probe``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .console import session
from .options import AsJson, Quiet, Verbose


class LatLong(StrEnum):
    """Conventions of latitude-longitude maps."""

    blender = "blender"
    mitsuba = "mitsuba"


def probe(
    photographs: Annotated[
        list[Path],
        typer.Argument(help="Of the ball: EXR or .hdr, linear, exposures merged. Two or more are merged."),
    ],
    *,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for probe.exr, probe.json and probe.html.")
    ],
    ball: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y,R",
            help="Its outline in pixels, or an ellipse X,Y,A,B,DEGREES; once for each photograph, in order.",
            show_default="looked for",
        ),
    ] = None,
    focal: Annotated[
        float | None,
        typer.Option(
            metavar="PIXELS", help="Focal length.", show_default="that of --pose; else orthographic"
        ),
    ] = None,
    principal: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="Principal point in pixels.", show_default="the middle"),
    ] = None,
    intrinsics: Annotated[
        Path | None, typer.Option(help="Lens of all photographs: JSON of `prepare calibrate`.")
    ] = None,
    pose: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE[#FRAME]",
            help="transforms.json with the photograph's camera; once for each photograph, in order. The "
            "rotation of those without one is estimated.",
        ),
    ] = None,
    ball_radius: Annotated[float | None, typer.Option(help="Radius, in the world's unit.")] = None,
    ball_distance: Annotated[
        float | None,
        typer.Option(help="Of its centre from the first camera; checked against the outline."),
    ] = None,
    reflectance: Annotated[
        str, typer.Option(metavar="SHARE", help="Of the light that it reflects, a number or R,G,B.")
    ] = "1",
    fresnel: Annotated[
        bool, typer.Option("--fresnel", help="The reflectance rises to 1 at the rim (Schlick).")
    ] = False,
    clip: Annotated[
        float | None, typer.Option(metavar="LEVEL", help="Radiance from which on a pixel is clipped.")
    ] = None,
    convention: Annotated[
        LatLong | None,
        typer.Option(
            help="How pixels stand for directions.", show_default="blender with --pose, else mitsuba"
        ),
    ] = None,
    width: Annotated[
        int | None, typer.Option(metavar="PIXELS", help="Of the map.", show_default="what the ball resolves")
    ] = None,
    allow_cut: Annotated[bool, typer.Option("--allow-cut", help="Use a ball that the frame cuts.")] = False,
    capture: Annotated[
        Path | None,
        typer.Option(
            help="Make the probe the light of this capture; needs --pose, in the capture's world.",
            show_default="left alone",
        ),
    ] = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Turn photographs of a mirror ball into a light probe.

    The ball is found or given; each pixel's ray is reflected exactly where the focal length is known. A
    second view fills in the photographer and what is hidden behind the ball. The page shows the outline, the
    map, and the map seen on the ball beside the photograph.

    Examples:

    swatchwork prepare probe ball.exr --focal 3200 -o probe

    swatchwork prepare probe ball1.exr ball2.exr --pose my-capture/transforms.json --reflectance 0.6 -o probe

    swatchwork prepare probe ball.exr --pose my-capture/transforms.json#front --capture my-capture -o probe
    """
    from ..workflow import prepare_probe

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        at = _numbers("--principal", principal) if principal else None
        if at is not None and len(at) != 2:
            raise InputError(f"--principal is {principal!r}", expected="X,Y in pixels")
        found = prepare_probe(
            photographs,
            output,
            balls=[_numbers("--ball", text) for text in ball or []],
            focal_px=focal,
            principal_px=(at[0], at[1]) if at else None,
            intrinsics=intrinsics,
            poses=pose or [],
            radius=ball_radius,
            distance=ball_distance,
            reflectance=_numbers("--reflectance", reflectance),
            fresnel=fresnel,
            clip=clip,
            convention=convention.value if convention else None,
            width=width,
            allow_cut=allow_cut,
            capture=capture,
            progress=run.progress,
        )
        run.say(found.in_words())
        run.result(found.as_dict())


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"{option} is {text!r}", expected="numbers with commas between") from error

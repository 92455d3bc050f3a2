# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork prepare linearize``."""

from __future__ import annotations

import math
import re
from enum import StrEnum
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from .console import session
from .options import AsJson, Quiet, Verbose

if TYPE_CHECKING:
    from ..prepare import Exposure, WhiteBalance


class Colours(StrEnum):
    """What primaries RAW files are taken to."""

    srgb = "srgb"
    camera = "camera"


def linearize(
    photographs: Annotated[
        list[Path], typer.Argument(help="Photographs, or folders of them: all RAW, or all JPEG and PNG.")
    ],
    *,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the EXRs and linearize.json.")],
    per_view: Annotated[
        int, typer.Option(metavar="COUNT", help="Photographs (exposures) of each view, one after the other.")
    ] = 1,
    groups: Annotated[
        Path | None,
        typer.Option(help='Instead: JSON {"view": ["a.jpg", "b.jpg"], ...}.', show_default="--per-view"),
    ] = None,
    exposures: Annotated[
        Path | None,
        typer.Option(
            help="CSV with columns file, time, iso, aperture, or JSON of the same; wins over EXIF.",
            show_default="EXIF",
        ),
    ] = None,
    response: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="Of JPEG and PNG: recover (from brackets), srgb, gamma:2.2, or a linearize.json.",
        ),
    ] = "recover",
    white_balance: Annotated[
        str,
        typer.Option(
            metavar="R,G,B",
            help="Of RAW: daylight, camera (of the first photograph), multipliers, or a linearize.json.",
        ),
    ] = "daylight",
    colour: Annotated[Colours, typer.Option(help="Of RAW: primaries of the EXRs.")] = Colours.srgb,
    reference: Annotated[
        str,
        typer.Option(
            metavar="TIME,ISO,APERTURE",
            help="Exposure whose full scale is radiance 1; the same for photographs and light probe.",
        ),
    ] = "1/100,100,8",
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Turn photographs into radiance: RAW developed linearly, JPEG by the camera's response, brackets merged.

    Every value is divided by exposure time, ISO speed and aperture, so that photographs and light probe come
    out on one scale. Read both with the same --response (JPEG) or --white-balance (RAW). Pixels saturated in
    every exposure are marked (clipped.R, .G, .B): missing, not white.

    Examples:

    swatchwork prepare linearize card/views -o linear --per-view 3

    swatchwork prepare linearize card/ball -o ball --per-view 7 --response linear/linearize.json

    swatchwork prepare linearize card/*.NEF -o linear --white-balance camera

    swatchwork prepare linearize card/ball/*.NEF -o ball --white-balance linear/linearize.json
    """
    from ..prepare import LinearizeOptions
    from ..workflow import linearize_photographs

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        options = LinearizeOptions(
            per_view=per_view,
            groups=groups,
            exposures=exposures,
            response=response,
            white_balance=_white_balance(white_balance),
            colour="srgb" if colour is Colours.srgb else "camera",
            reference=_reference(reference),
        )
        found = linearize_photographs(photographs, output, options, run.progress)
        run.say(found.in_words())
        run.result(found.as_dict())


def _white_balance(text: str) -> WhiteBalance:
    if text == "daylight":
        return "daylight"
    if text == "camera":
        return "camera"
    if text.lower().endswith(".json"):
        from ..prepare import earlier_white_balance

        return earlier_white_balance(Path(text))
    expected = "daylight, camera, R,G,B such as 2.1,1,1.4, or a linearize.json"
    r, g, b = _three(text, "--white-balance", expected)
    return r, g, b


def _reference(text: str) -> Exposure:
    from ..prepare import Exposure

    return Exposure(*_three(text, "--reference", "seconds, ISO speed and f-number, such as 1/100,100,8"))


def _three(text: str, option: str, expected: str) -> tuple[float, float, float]:
    try:
        a, b, c = (float(Fraction(part)) for part in re.split(r"\s*,\s*", text.strip()))
    except (ValueError, ZeroDivisionError, OverflowError):
        a = b = c = math.nan
    if not (a > 0 and b > 0 and c > 0):
        raise InputError(f"{option} is {text!r}", expected=expected)
    return a, b, c

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Options that several commands share, each with its unit and default in its help."""

from __future__ import annotations

import math
import os
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError

if TYPE_CHECKING:
    from ..capture import EnvironmentSource

AsJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output, and nothing else there.")
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Say what each stage took.")]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress, no summary; warnings and errors only.")
]
Threads = Annotated[
    int | None,
    typer.Option(min=1, metavar="COUNT", help="Threads of the core.", show_default="all cores"),
]
Seed = Annotated[int, typer.Option(min=0, metavar="NUMBER", help="Seed of everything random.")]


class Convention(StrEnum):
    """Names of the environment conventions."""

    blender = "blender"
    mitsuba = "mitsuba"
    debevec_angular = "debevec-angular"


ItsConvention = Annotated[
    Convention | None,
    typer.Option(help="How its pixels stand for directions; required with --environment."),
]
OtherLight = Annotated[
    Path | None, typer.Option(help="HDR light-probe image to use instead of the one in --cameras.")
]
OtherConvention = Annotated[
    Convention | None,
    typer.Option(help="How that image's pixels stand for directions; required with --environment."),
]
Turn = Annotated[
    str | None, typer.Option(metavar="AXIS:DEGREES", help="Turn the light about a world axis, such as z:90.")
]
Link = Annotated[bool, typer.Option("--link", help="Hard links to the photographs, not copies.")]


class BasisName(StrEnum):
    """The generic bases."""

    paper = "paper"
    extended = "extended"


def light_source(
    environment: Path | None, convention: Convention | None, rotation: str | None = None
) -> EnvironmentSource | None:
    """The light probe that --environment, --convention and --environment-rotation say.

    Raises:
        InputError: only a part of it is said.
    """
    from ..capture import EnvironmentSource
    from ..workflow.relighting import rotation_matrix

    if environment is None:
        if convention is not None or rotation is not None:
            option = "--convention" if convention is not None else "--environment-rotation"
            raise InputError(f"{option} says how --environment is read", expected="--environment FILE too")
        return None
    if convention is None:
        raise InputError(
            "nothing says how its pixels stand for directions",
            file=environment,
            expected="--convention " + " or ".join(Convention),
        )
    return EnvironmentSource(environment, convention.value, rotation_matrix(parse_rotation(rotation)))


def use_threads(count: int | None) -> None:
    """Set the size of the core's thread pool; it is made when first used."""
    if count is not None:
        os.environ["RAYON_NUM_THREADS"] = str(count)


def parse_rotation(text: str | None) -> tuple[str, float] | None:
    """``AXIS:DEGREES`` such as ``z:90``; a number alone turns about z. Raises InputError on anything else."""
    if text is None:
        return None
    axis, colon, degrees = text.rpartition(":")
    axis = axis.lower() if colon else "z"
    try:
        angle = float(degrees)
    except ValueError:
        angle = float("nan")
    if axis not in ("x", "y", "z") or not math.isfinite(angle):
        raise InputError(f"--environment-rotation is {text!r}", expected="AXIS:DEGREES, such as z:90")
    return axis, angle

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork plan``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .console import session
from .options import AsJson, BasisName, ItsConvention, Quiet, Seed, Threads, Verbose, use_threads


class Optimal(StrEnum):
    """What is optimised."""

    A = "A"
    D = "D"


def plan(
    *,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for transforms.json and plan.html.")],
    mesh: Annotated[
        Path | None, typer.Option(help="The object's mesh.", show_default="that of --have")
    ] = None,
    shape: Annotated[
        str | None, typer.Option(help="Instead of a mesh: plane, cap, hemisphere or sphere.")
    ] = None,
    environment: Annotated[
        Path | None, typer.Option(help="HDR light probe.", show_default="that of --have")
    ] = None,
    convention: ItsConvention = None,
    views: Annotated[
        int | None, typer.Option(metavar="COUNT", help="How many (more) photographs to suggest.")
    ] = None,
    condition: Annotated[
        float | None,
        typer.Option(
            metavar="NUMBER",
            help="Instead: stop where 95 % of what can be seen has a condition number (n = 4) below it. "
            "Noise of 1 % moves blend weights by a hundredth of it over the root of the views: 100 is fair.",
        ),
    ] = None,
    have: Annotated[
        Path | None, typer.Option(help="transforms.json of photographs already taken: go on from them.")
    ] = None,
    occluder: Annotated[
        list[Path] | None, typer.Option(help="Mesh that blocks light and sight, such as a table; repeatable.")
    ] = None,
    lowest: Annotated[
        float, typer.Option(metavar="DEGREES", help="No camera below this elevation; world z is up.")
    ] = -90.0,
    distance: Annotated[
        float,
        typer.Option(metavar="RADII", help="Of the cameras, in radii of the object, without --have."),
    ] = 4.0,
    size: Annotated[int, typer.Option(metavar="PIXELS", help="Side of their images, without --have.")] = 1024,
    candidates: Annotated[
        int, typer.Option(metavar="COUNT", help="Directions to choose among, even over the sphere.")
    ] = 150,
    basis: Annotated[BasisName, typer.Option(help="Generic basis.")] = BasisName.extended,
    criterion: Annotated[
        Optimal, typer.Option(help="A: least variance left; D: most information.")
    ] = Optimal.D,
    seed: Seed = 0,
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Say where to stand for the next photographs, and how many it takes.

    Each view is the one that says most about the reflectance of every point beyond those before it, given the
    object's shape and its light. The page shows the object, the cameras in order, and what each of them
    brings; transforms.json has the cameras for other programs.

    Examples:

    swatchwork plan --mesh scan.ply --environment probe.exr --convention mitsuba --views 8 -o plan

    swatchwork plan --have my-capture/transforms.json --condition 50 --lowest 0 -o plan
    """
    use_threads(threads)
    from ..workflow import given_environment, plan_views

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        found = plan_views(
            output,
            mesh=mesh,
            shape=shape,
            environment=given_environment(environment, convention),
            views=views,
            condition=condition,
            have=have,
            occluders=occluder or [],
            criterion="A" if criterion is Optimal.A else "D",
            lowest_degrees=lowest,
            distance=distance,
            size=size,
            candidates=candidates,
            basis=basis.value,
            seed=seed,
            progress=run.progress,
        )
        run.say(found.in_words())
        run.result(found.as_dict())

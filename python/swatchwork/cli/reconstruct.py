# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork reconstruct``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .console import session
from .options import AsJson, BasisName, Quiet, Seed, Threads, Verbose, use_threads


class Search(StrEnum):
    """How the blend step looks for supports."""

    exact = "exact"
    pruned = "pruned"
    brute = "brute"


class SearchOrder(StrEnum):
    """How the outer search walks over n and N."""

    default = "default"
    paper = "paper"


class Weighting(StrEnum):
    """How measurements are weighted."""

    projected = "projected"
    equal = "equal"


class FrameScale(StrEnum):
    """Which photographs' exposures are corrected."""

    off = "off"
    suspects = "suspects"
    all = "all"


MATERIALS = "How many materials"
PHOTOGRAPHS = "Suspect photographs"
SEARCH = "The search"


def reconstruct(
    capture: Annotated[Path, typer.Argument(help="Capture folder, or its transforms.json.")],
    *,
    output: Annotated[Path, typer.Option("--output", "-o", help="Material folder to write; replaced whole.")],
    resolution: Annotated[
        int | None,
        typer.Option(
            min=8,
            max=8192,
            metavar="TEXELS",
            help="Side of the square atlas, in texels.",
            show_default="from the images' sampling of the surface",
        ),
    ] = None,
    basis: Annotated[
        BasisName,
        typer.Option(
            help="Generic BRDFs: as published, or with what measured materials need at grazing angles."
        ),
    ] = BasisName.extended,
    views: Annotated[
        int | None,
        typer.Option(min=1, metavar="K", help="Use the first K photographs only.", show_default="all"),
    ] = None,
    n: Annotated[
        int | None,
        typer.Option(
            "--n",
            min=1,
            metavar="COUNT",
            help="Materials blended at a point, exactly so many allowed.",
            show_default="searched",
            rich_help_panel=MATERIALS,
        ),
    ] = None,
    N: Annotated[
        int | None,
        typer.Option(
            "--N",
            min=1,
            metavar="COUNT",
            help="Materials altogether, exactly.",
            show_default="searched",
            rich_help_panel=MATERIALS,
        ),
    ] = None,
    max_n: Annotated[
        int,
        typer.Option(
            "--max-n", min=1, metavar="COUNT", help="Search n up to here.", rich_help_panel=MATERIALS
        ),
    ] = 5,
    max_N: Annotated[
        int,
        typer.Option(
            "--max-N", min=1, metavar="COUNT", help="Search N up to here.", rich_help_panel=MATERIALS
        ),
    ] = 18,
    lambda0: Annotated[
        float | None,
        typer.Option(
            min=0,
            metavar="PENALTY",
            help="Price of one more material at a point, in mean squared relative error (Eq. 5).",
            show_default="from the noise",
            rich_help_panel=MATERIALS,
        ),
    ] = None,
    lambda1: Annotated[
        float | None,
        typer.Option(
            min=0,
            metavar="PENALTY",
            help="Price of one more material altogether, in the same unit.",
            show_default="from the noise",
            rich_help_panel=MATERIALS,
        ),
    ] = None,
    search: Annotated[
        Search,
        typer.Option(
            help="Blend step: the certified optimum, the paper's pruning, or every support.",
            rich_help_panel=SEARCH,
        ),
    ] = Search.exact,
    search_order: Annotated[
        SearchOrder,
        typer.Option(
            help="Walk over n and N: ours, or the paper's loops exactly, of all photographs: suspects are "
            "named but kept.",
            rich_help_panel=SEARCH,
        ),
    ] = SearchOrder.default,
    weighting: Annotated[
        Weighting,
        typer.Option(
            help="Weigh a measurement by the pixels its texel covers, or all alike as published.",
            rich_help_panel=SEARCH,
        ),
    ] = Weighting.projected,
    robust: Annotated[
        bool,
        typer.Option(
            "--robust/--no-robust",
            help="Leave out measurements that contradict those of the same point in other photographs, "
            "where there are any.",
            rich_help_panel=SEARCH,
        ),
    ] = True,
    noise: Annotated[
        str | None,
        typer.Option(
            metavar="READ,GAIN",
            help="Noise of the photographs: a radiance L has variance READ^2 + GAIN L. Points that are "
            "mostly noise count less. Not with --no-robust or --search-order paper.",
            show_default="estimated from the photographs",
            rich_help_panel=SEARCH,
        ),
    ] = None,
    texels: Annotated[
        int,
        typer.Option(
            min=10,
            metavar="COUNT",
            help="Surface points the search runs on; every point is blended after it.",
            rich_help_panel=SEARCH,
        ),
    ] = 4000,
    memory: Annotated[
        float,
        typer.Option(
            min=0.7,
            metavar="GB",
            help="Memory to stay within, about: it bounds tiles and what the search may hold.",
            rich_help_panel=SEARCH,
        ),
    ] = 2.0,
    frame_scale: Annotated[
        FrameScale,
        typer.Option(
            help="Whose exposure is corrected by what the other photographs foretell: of none, so that a "
            "suspect is left out, of suspects, or of every photograph.",
            rich_help_panel=PHOTOGRAPHS,
        ),
    ] = FrameScale.suspects,
    keep_suspects: Annotated[
        bool,
        typer.Option(
            "--keep-suspects",
            help="Name photographs whose exposure, pose or light looks wrong, but use them as they are. "
            "Not with --frame-scale all.",
            rich_help_panel=PHOTOGRAPHS,
        ),
    ] = False,
    interreflections: Annotated[
        int,
        typer.Option(
            min=0,
            max=8,
            metavar="ROUNDS",
            help="Light that the object sends to itself: ROUNDS times, solve and blend again under it. 2 "
            "will do for most objects; each takes about as long as search and blend did.",
            show_default="0, which ignores it",
            rich_help_panel=SEARCH,
        ),
    ] = 0,
    viewer: Annotated[
        bool, typer.Option("--viewer/--no-viewer", help="Also write viewer.html, the interactive page.")
    ] = True,
    seed: Seed = 0,
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Recover an object's material from a capture: photographs, mesh, environment.

    Writes a material folder: the materials found (svbrdf.json), where they are (blend.exr), the mesh, maps,
    report.html, the page to open first, and viewer.html, to turn and relight it in a browser. The folder
    appears whole or not at all; finished parts are kept in OUTPUT.partial meanwhile, and after an
    interruption the same command goes on from them.

    Examples:

    swatchwork reconstruct my-capture -o my-material

    swatchwork reconstruct my-capture -o quick --resolution 256 --views 6

    swatchwork reconstruct capture -o out --basis paper --search-order paper --search pruned --weighting equal
    """
    if n is not None and N is not None and n > N:
        raise InputError(f"--n is {n} and --N is {N}", expected="n no larger than N")
    use_threads(threads)
    from ..workflow import FrameOptions, NoiseModel, ReconstructOptions, SolveOptions, reconstruct_folder

    solve = SolveOptions(
        n=n,
        N=N,
        max_n=max_n,
        max_N=max_N,
        lambda0=lambda0,
        lambda1=lambda1,
        search=search.value,
        search_order=search_order.value,
        robust=robust,
        seed=seed,
    )
    given = None if noise is None else NoiseModel(*_pair(noise))
    frames = FrameOptions(frame_scale.value, keep_suspects)
    options = ReconstructOptions(
        resolution, basis.value, texels, solve, weighting.value, given, memory, frames, interreflections
    )
    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        summary = reconstruct_folder(
            capture, output, options, views=views, viewer=viewer, progress=run.progress
        )
        run.say(summary.in_words())
        run.say(f"Open {output / 'report.html'}" + (f", or {output / 'viewer.html'}" if viewer else ""))
        run.result(summary.as_dict())


def _pair(text: str) -> tuple[float, float]:
    """READ,GAIN."""
    try:
        read, gain = map(float, text.split(","))
    except ValueError:
        raise InputError(
            f"--noise is {text!r}",
            expected="two numbers with a comma between, such as 0.002,0.0001",
        ) from None
    return read, gain

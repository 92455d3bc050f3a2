# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork reproduce``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import session
from .options import AsJson, Quiet, Threads, Verbose, use_threads


def reproduce(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAMES]...",
            help="fig2, fig3, fig4, penalties, fig5, fig6, fig7, fig8, fig9, fig10, fig11, table1 "
            "(also fig13 to fig16), methods, or all.",
            show_default="all",
        ),
    ] = None,
    *,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of figures, pictures and page.")],
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder with envmaps/latlong/NAME_1024x512.hdr (grace, stpeters, rnl, uffizi), "
            "merl/*.binary or merl/merl_nbrdf.npz, textures/rustymetal; each is optional.",
            show_default="procedural stand-ins",
        ),
    ] = None,
    captures: Annotated[
        Path | None,
        typer.Option(
            help="Folder of captures with a test/ each, for the table of all methods.",
            show_default="one is made",
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Small versions, under three minutes in all: does it run?")
    ] = False,
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Run the experiments of the paper (sections 5 and 7) and the methods it was compared with.

    Each claim is set beside our figure, with a verdict, on a page. A run that was interrupted goes on from
    the parts it has finished.

    Examples:

    swatchwork reproduce --quick -o reproduction-quick

    swatchwork reproduce fig6 fig8 --data my-data -o reproduction
    """
    use_threads(threads)
    from ..reproduce import reproduce as run_experiments

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        found = run_experiments(
            names or ["all"], output, data=data, captures=captures, quick=quick, progress=run.progress
        )
        for name, claim in found.claims:
            run.say(f"{name:10} {'holds' if claim.holds else 'DOES NOT HOLD'}: {claim.paper} {claim.found}")
        run.say(found.in_words())
        run.result(found.as_dict())

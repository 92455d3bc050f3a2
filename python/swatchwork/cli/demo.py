# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import session
from .options import AsJson, Quiet, Seed, Threads, Verbose, use_threads


def demo(
    folder: Annotated[Path, typer.Argument(help="Folder to make; what an earlier demo left is replaced.")],
    *,
    picture: Annotated[
        Path | None,
        typer.Option(help="Also write photograph, reconstruction and new light side by side, as a PNG."),
    ] = None,
    seed: Seed = 0,
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """See it work, in about a minute on two cores: make a capture, recover its material, relight it, measure.

    The object, its materials and its light are made up, so the truth is known and the error can be shown.

    Examples:

    swatchwork demo demo

    swatchwork demo demo --seed 3 --json
    """
    use_threads(threads)
    from ..workflow import run_demo

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        summary = run_demo(folder, seed=seed, picture=picture, progress=run.progress)
        run.say(summary.in_words())
        run.result(summary.as_dict())

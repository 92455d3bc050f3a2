# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork view``."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from .console import session
from .options import AsJson, Convention, Quiet, Threads, Verbose, use_threads


def view(
    material: Annotated[Path, typer.Argument(help="Material folder, as reconstruct writes it.")],
    *,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The page to write.", show_default="MATERIAL/viewer.html"),
    ] = None,
    capture: Annotated[
        Path | None,
        typer.Option(help="Capture folder or transforms.json whose light and photographs to show."),
    ] = None,
    light: Annotated[
        list[Path] | None, typer.Option(help="HDR light probe to put on the page too; may be repeated.")
    ] = None,
    convention: Annotated[
        Convention | None,
        typer.Option(help="How their pixels stand for directions; required with --light."),
    ] = None,
    open_page: Annotated[
        bool, typer.Option("--open/--no-open", help="Open the page in the default browser.")
    ] = True,
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Look at a material from all sides, under any light, in a browser.

    Opens the page that reconstruct wrote into the folder; makes one where there is none, or where --capture
    or --light say what should be on it. The page is one file, needs no network, and takes any .hdr or .exr
    that is dropped on it.

    Examples:

    swatchwork view my-material

    swatchwork view my-material --capture my-capture --light sky.exr --convention blender -o look.html
    """
    use_threads(threads)
    from ..workflow import view_folder

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        summary = view_folder(
            material,
            output,
            capture=capture,
            lights=light or (),
            convention=None if convention is None else convention.value,
            progress=run.progress,
        )
        run.say(summary.in_words())
        run.result(summary.as_dict())
        if open_page and not as_json:
            webbrowser.open(Path(summary.page).resolve().as_uri())

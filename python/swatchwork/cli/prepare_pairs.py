# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork prepare pairs``."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from threading import Thread
from typing import Annotated

import typer

from .console import session
from .options import AsJson, Quiet, Verbose


def pairs(
    photographs: Annotated[list[Path], typer.Argument(help="Photographs: EXR, HDR, PNG or JPEG.")],
    *,
    mesh: Annotated[Path, typer.Option("--mesh", help="The object: OBJ, PLY or glTF.")],
    intrinsics: Annotated[Path, typer.Option("--intrinsics", help="JSON of `prepare calibrate`.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="JSON to write; one that is there is gone on from.")
    ],
    port: Annotated[
        int,
        typer.Option(min=0, max=65535, metavar="NUMBER", help="Port on this machine; 0 finds a free one."),
    ] = 0,
    no_open: Annotated[bool, typer.Option("--no-open", help="Print the address, open no browser.")] = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Click points that are the same on photograph and mesh, from which `prepare register` makes the pose.

    A page opens in the browser. Four pairs of a photograph make a pose, six or more that lie well apart a
    good one; the mesh's outline over the photograph shows whether it is. Save on the page writes the file,
    Ctrl-C here ends. The page is served to this machine alone; from another, use --port and
    `ssh -L PORT:127.0.0.1:PORT`.

    Examples:

    swatchwork prepare pairs IMG_0001.exr --mesh bunny.obj --intrinsics intrinsics.json -o pairs.json

    swatchwork prepare pairs linear/*.exr --mesh bunny.ply --intrinsics lens.json -o pairs.json --no-open
    """
    from ..workflow import prepare_pairs

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:

        def ready(url: str) -> None:
            # Said even with --quiet: without it there is nothing to do.
            run.console.print(f"{url}\nSave on the page; Ctrl-C here ends.", markup=False, soft_wrap=True)
            if not no_open:
                # A browser in the terminal would not come back before it has the page.
                Thread(target=webbrowser.open, args=(url,), daemon=True).start()

        found = prepare_pairs(
            photographs,
            output,
            mesh=mesh,
            intrinsics=intrinsics,
            port=port,
            ready=ready,
            progress=run.progress,
        )
        run.say(found.in_words())
        run.result(found.as_dict())

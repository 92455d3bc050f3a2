# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork check``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import session
from .options import AsJson, Quiet, Threads, Verbose, use_threads


def check(
    capture: Annotated[Path, typer.Argument(help="Capture folder, or its transforms.json.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The page to write.", show_default="check.html")
    ] = Path("check.html"),
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Say in words what is wrong with a capture, and show it.

    The page has the mesh over the photographs, the probe on a mirror ball, exposures and coverage.

    The exit code is 0 whatever is found; it is 2 where the capture cannot be read.

    Examples:

    swatchwork check my-capture

    swatchwork check my-capture -o my-check.html --json
    """
    use_threads(threads)
    from ..workflow import check_capture

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        found = check_capture(capture, output, progress=run.progress)
        run.say(found.in_words())
        run.result(found.as_dict())

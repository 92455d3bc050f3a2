# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The commands, and what becomes of their errors; exit codes are in ``stopping``."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence
from importlib.metadata import version as installed_version
from textwrap import dedent
from typing import Annotated

import typer
import typer.main

from ..errors import SwatchworkError, is_out_of_memory
from . import prepare
from .analyze import analyze
from .check import check
from .console import plain, stderr
from .demo import demo
from .evaluate import evaluate
from .export import export
from .info import info
from .memory import OUT_OF_MEMORY
from .plan import plan
from .reconstruct import reconstruct
from .relight import relight
from .reproduce import reproduce
from .stopping import DEFECT, FAILED, INTERRUPTED, Stop
from .view import view

HELP = """
Recover what an object is made of from a few photographs under known natural light, and render it elsewhere.
"""

EPILOG = """
[bold]New here?[/bold]  swatchwork demo demo   (about a minute; then open demo/report.html)

[bold]On your own capture:[/bold]

swatchwork reconstruct my-capture -o my-material

swatchwork relight my-material --cameras my-capture/transforms.json -o renders

swatchwork view my-material

[bold]Exit codes:[/bold]  0 done; 1 a defect in swatchwork; 2 wrong input, a full disk, too little
memory, said in one line; 130 interrupted, 143 terminated: the same command goes on.
"""

app = typer.Typer(
    name="swatchwork",
    help=HELP,
    epilog=EPILOG,
    no_args_is_help=True,
    rich_markup_mode="rich",
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"swatchwork {installed_version('swatchwork')}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    pass


for command in (reconstruct, relight, view, export, evaluate, plan, analyze, check, demo, reproduce, info):
    text, _, examples = (command.__doc__ or "").partition("Examples:")
    app.command(help=text, epilog=f"[bold]Examples:[/bold]\n\n{dedent(examples).strip()}")(command)
app.add_typer(prepare.app, name="prepare")


def run(arguments: Sequence[str] | None, stop: Stop) -> int:
    """Run the command line; returns the exit code."""
    try:
        code = typer.main.get_command(app).main(
            args=list(sys.argv[1:] if arguments is None else arguments),
            prog_name="swatchwork",
            standalone_mode=False,
        )
        code = code if isinstance(code, int) else 0
    except typer.Exit as done:
        code = done.exit_code
    except typer.Abort:
        code = INTERRUPTED
    except SwatchworkError as error:
        stderr().print(f"error: {plain(error)}", style="bold red", markup=False, soft_wrap=True)
        return FAILED
    except BrokenPipeError:
        return 0
    except Exception as error:
        if stop.by is not None:  # A library made something else of it.
            raise KeyboardInterrupt from error
        if is_out_of_memory(error):
            # No console: there may be too little left to make one.
            os.write(2, OUT_OF_MEMORY)
            return FAILED
        if hasattr(error, "show") and hasattr(
            error, "exit_code"
        ):  # a usage error, by typer's or click's name
            error.show()
            return int(error.exit_code)
        traceback.print_exc()
        stderr().print("This is a defect in swatchwork, not in your input: please report it.", style="red")
        return DEFECT
    # Older typers raise on Ctrl-C, newer ones return the code themselves.
    if code == INTERRUPTED:
        raise KeyboardInterrupt
    return code

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork prepare ...``: the way from a memory card to a capture folder."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import dedent
from typing import Any

import typer

from .prepare_calibrate import calibrate
from .prepare_import import import_
from .prepare_linearize import linearize
from .prepare_pairs import pairs
from .prepare_probe import probe
from .prepare_register import register

HELP = """
From photographs to a capture: linear radiance, camera intrinsics, poses, the light probe, imports.

Each step has a figure of merit and a picture to check by eye.
"""

STEPS: tuple[Callable[..., Any], ...] = (linearize, calibrate, pairs, register, probe, import_)
"""The commands, in the order of use."""

app = typer.Typer(
    name="prepare",
    help=HELP,
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)
for step in STEPS:
    text, _, examples = (step.__doc__ or "").partition("Examples:")
    # A keyword of the language is a name with an underscore behind it.
    name = step.__name__.rstrip("_").replace("_", "-")
    app.command(name=name, help=text, epilog=f"[bold]Examples:[/bold]\n\n{dedent(examples).strip()}")(step)

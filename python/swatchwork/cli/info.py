# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork info``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from .console import plain, session
from .options import AsJson


def info(
    path: Annotated[
        Path | None, typer.Argument(help="A capture or a material folder.", show_default="this installation")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say in a few lines what a capture or a material folder holds, or what is installed here.

    Examples:

    swatchwork info my-capture

    swatchwork info my-material --json
    """
    from ..workflow import describe

    with session(as_json=as_json) as run:
        found = describe(path)
        table = Table(box=None, show_header=False, pad_edge=False)
        for name, value in found.items():
            table.add_row(Text(name), Text(plain(value)))
        run.show(table)
        run.result(found)

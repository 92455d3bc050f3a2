# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The command line: parse, call, report."""

from __future__ import annotations

from collections.abc import Sequence

from .stopping import stoppable

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    with stoppable() as stop:
        try:
            # Imported here, where Ctrl-C is heard already.
            from .app import run

            return run(arguments, stop)
        except KeyboardInterrupt:
            return stop.said()

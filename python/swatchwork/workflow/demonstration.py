# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The demo: a made-up capture, its material recovered, relit, measured, and a page about it."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any

from ..progress import SILENT, Progress


@dataclass(frozen=True)
class DemoSummary:
    """."""

    def as_dict(self) -> dict[str, Any]:
        """."""
        return {}

    def in_words(self) -> str:
        """."""
        return ""


def run_demo(
    folder: str | PathLike[str],
    *,
    seed: int = 0,
    picture: str | PathLike[str] | None = None,
    progress: Progress = SILENT,
) -> DemoSummary:
    """."""
    raise NotImplementedError

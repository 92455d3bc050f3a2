# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One self-contained page on a reconstruction: pictures, figures, search, cost, and warnings in words."""

from __future__ import annotations

from contextlib import suppress
from os import PathLike
from pathlib import Path

from ..errors import OutputError
from .model import Comparison, Figure, Picture, Report, StageCost, Trial
from .page import render_page
from .pictures import blend_colours, crop_box, display, exposure_for, heat, relative_error, shrink

__all__ = [
    "Comparison",
    "Figure",
    "Picture",
    "Report",
    "StageCost",
    "Trial",
    "blend_colours",
    "crop_box",
    "display",
    "exposure_for",
    "heat",
    "relative_error",
    "render_page",
    "shrink",
    "write_report",
]


def write_report(file: str | PathLike[str], report: Report) -> Path:
    """Write the page to ``file``, whole or not at all. Raises OutputError where it cannot be written."""
    path = Path(file)
    partial = path.with_name(path.name + ".partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(render_page(report), encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        with suppress(OSError):
            partial.unlink()
        raise OutputError(f"{path}: the report could not be written: {error.strerror}") from error
    return path

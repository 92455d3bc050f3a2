# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One self-contained page on a reconstruction: pictures, figures, search, cost, and warnings in words."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ..whole import whole_text
from .curves import curve_plot
from .html import Html
from .model import Comparison, Figure, PhotographRow, Picture, Report, StageCost, Trial
from .page import render_page
from .pictures import PALETTE, blend_colours, crop_box, display, exposure_for, heat, relative_error, shrink
from .sheet import Section, Sheet, render_sheet

__all__ = [
    "PALETTE",
    "Comparison",
    "Figure",
    "Html",
    "PhotographRow",
    "Picture",
    "Report",
    "Section",
    "Sheet",
    "StageCost",
    "Trial",
    "blend_colours",
    "crop_box",
    "curve_plot",
    "display",
    "exposure_for",
    "heat",
    "relative_error",
    "render_page",
    "shrink",
    "write_report",
    "write_sheet",
]


def write_report(file: str | PathLike[str], report: Report) -> Path:
    """Write the page to ``file``, whole or not at all. Raises OutputError where it cannot be written."""
    return _write(file, render_page(report))


def write_sheet(file: str | PathLike[str], sheet: Sheet) -> Path:
    """Write a page of sections, as ``write_report`` writes a report."""
    return _write(file, render_sheet(sheet))


def _write(file: str | PathLike[str], text: str) -> Path:
    return whole_text(file, text)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A self-contained page of headed sections: words, pictures, plots, a table each."""

from __future__ import annotations

from dataclasses import dataclass

from .html import Html, el
from .model import Figure, Picture
from .page import document, figure, headline_figures, section


@dataclass(frozen=True)
class Section:
    """A heading with what is below it; what is missing is left out."""

    heading: str
    text: str = ""
    pictures: tuple[Picture, ...] = ()
    plots: tuple[Html, ...] = ()
    head: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Sheet:
    """The page."""

    title: str
    summary: str
    figures: tuple[Figure, ...] = ()
    sections: tuple[Section, ...] = ()
    version: str = ""


def render_sheet(sheet: Sheet) -> str:
    """The whole page; every string is text and is escaped."""
    header = el(
        "header",
        el("h1", sheet.title),
        el("p", sheet.summary, cls="lead"),
        headline_figures(sheet.figures),
    )
    return document(sheet.title, sheet.version, header, [_section(s) for s in sheet.sections])


def _section(s: Section) -> Html:
    pictures = el("div", [figure(p) for p in s.pictures], cls="split") if s.pictures else None
    columns = [el("th", word, scope="col", cls="number" if i else None) for i, word in enumerate(s.head)]
    head = el("tr", columns) if columns else None
    rows = [
        el("tr", [el("td", cell, cls="number" if i else None) for i, cell in enumerate(row)])
        for row in s.rows
    ]
    table = el("table", head, rows) if rows else None
    return section(s.heading, s.text, pictures, el("div", s.plots, cls="split") if s.plots else None, table)

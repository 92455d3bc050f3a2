# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How well each photograph goes with the others: a bar for its exposure, one for its misfit."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .html import Html, el
from .model import PhotographRow

WIDTH, HEIGHT = 150, 14
DOUBLE = math.log(2)
"""Logarithm of the scale that fills half of its bar."""


def photographs_together(rows: Sequence[PhotographRow]) -> Html:
    """A table: name, exposure, misfit, what is wrong and what was done; suspects in bold."""
    head = el("tr", [el("th", title) for title in ("photograph", "brightness", "", "misfit", "", "")])
    return el("table", head, [_row(row) for row in rows])


def _row(row: PhotographRow) -> Html:
    name = el("strong", row.name) if row.wrong else row.name
    if not row.judged:
        return el("tr", el("th", name, scope="row"), el("td", "too little shared", colspan="5", cls="soft"))
    words = ", ".join(part for part in (row.wrong, row.done) if part)
    return el(
        "tr",
        el("th", name, scope="row"),
        el("td", _bar(0.5, 0.5 + 0.5 * max(-1.0, min(1.0, math.log(row.scale) / DOUBLE)), bool(row.wrong))),
        el("td", f"{row.scale:.3f}", cls="number"),
        el("td", _bar(0.0, min(row.misfit, 1.0), bool(row.wrong))),
        el("td", f"{row.misfit:.2f}", cls="number"),
        el("td", el("strong", words) if words else ""),
    )


def _bar(start: float, end: float, marked: bool) -> Html:
    low, high = sorted((start * WIDTH, end * WIDTH))
    tick = el("line", x1=start * WIDTH, x2=start * WIDTH, y1=0.0, y2=float(HEIGHT), cls="grid")
    colour = "#c4553b" if marked else "#7a8aa0"
    bar = el("rect", x=low, y=3.0, width=max(high - low, 1.0), height=HEIGHT - 6.0, fill=colour)
    label = f"from {start:.2f} to {end:.2f}"
    size = {"width": str(WIDTH), "height": str(HEIGHT)}
    return el("svg", tick, bar, viewBox=f"0 0 {WIDTH} {HEIGHT}", role="img", aria_label=label, **size)

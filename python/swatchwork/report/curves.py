# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Curves over a common axis, as an SVG that stands alone or inside a page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from .html import Html, el
from .pictures import PALETTE
from .plots import round_values, short

WIDTH, HEIGHT = 640, 340
LEFT, RIGHT, TOP, BOTTOM = 64, 190, 18, 46
ALONE = (
    "svg{background:#fff;font:13px sans-serif}.grid{stroke:#ddd}.tick,.axis{fill:#444}.axis{font-size:14px}"
)
"""Of a file that no page lends its style."""

Points = Sequence[tuple[float, float]]


def curve_plot(
    curves: Mapping[str, Points], *, x_label: str, y_label: str, logarithmic: bool = True, alone: bool = False
) -> Html:
    """Curves by name; what is not finite, or not positive on a logarithmic axis, is left out.

    ``logarithmic`` is the vertical axis; the horizontal one is linear. ``alone``: with a style of its own.
    """
    shown = {
        name: [(a, b) for a, b in points if math.isfinite(b) and (b > 0 or not logarithmic)]
        for name, points in curves.items()
    }
    values = [b for points in shown.values() for _, b in points]
    places = sorted({a for points in shown.values() for a, _ in points})
    if not values:
        return Html("")
    low, high = min(values), max(values)
    low, high = (low / 1.15, high * 1.15) if logarithmic else (min(low, 0.0), high * 1.05 or 1.0)

    def x(value: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (value - places[0]) / max(places[-1] - places[0], 1e-9)

    def y(value: float) -> float:
        share = (
            math.log(high / value) / math.log(high / low) if logarithmic else (high - value) / (high - low)
        )
        return TOP + (HEIGHT - TOP - BOTTOM) * share

    marks = round_values(low, high) if logarithmic else [high / 1.05 * i / 4 for i in range(5)]
    parts: list[Html] = []
    for mark in marks:
        parts.append(el("line", x1=float(LEFT), x2=float(WIDTH - RIGHT), y1=y(mark), y2=y(mark), cls="grid"))
        parts.append(el("text", short(mark), x=float(LEFT - 8), y=y(mark) + 4, cls="tick", text_anchor="end"))
    for place in places[:: max(1, math.ceil(len(places) / 12))]:
        at = float(HEIGHT - BOTTOM + 18)
        parts.append(el("text", short(place), x=x(place), y=at, cls="tick", text_anchor="middle"))
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(el("text", x_label, x=middle, y=float(HEIGHT - 6), cls="axis", text_anchor="middle"))
    turn = f"rotate(-90 14 {(TOP + HEIGHT - BOTTOM) / 2:g})"
    upright = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(el("text", y_label, x=14.0, y=upright, cls="axis", text_anchor="middle", transform=turn))
    ends = []
    for i, (name, points) in enumerate(shown.items()):
        if not points:
            continue
        colour = PALETTE[i % len(PALETTE)]
        path = "M" + " L".join(f"{x(a):.1f},{y(b):.1f}" for a, b in points)
        dashes = "6 4" if i >= len(PALETTE) else None
        parts.append(
            el("path", d=path, fill="none", stroke=colour, stroke_width="2", stroke_dasharray=dashes)
        )
        parts += [el("circle", cx=x(a), cy=y(b), r=2.5, fill=colour) for a, b in points]
        ends.append((y(points[-1][1]), name, colour))
    taken = -math.inf
    for at, name, colour in sorted(ends):
        # Pushed apart so that names stay readable where curves end close together.
        taken = max(at, taken + 15)
        parts.append(el("text", name, x=float(WIDTH - RIGHT + 8), y=taken + 4, cls="label", fill=colour))
    label = f"{y_label} against {x_label}: {', '.join(shown)}"
    style = [el("style", Html(ALONE))] if alone else []
    size = (
        {"width": str(WIDTH), "height": str(HEIGHT), "xmlns": "http://www.w3.org/2000/svg"} if alone else {}
    )
    box = f"0 0 {WIDTH} {HEIGHT}"
    return el("svg", style, parts, viewBox=box, role="img", aria_label=label, cls="plot", **size)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Plots as inline SVG. Their colours are the page's, so they follow light and dark by themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .html import Html, el
from .model import Trial
from .pictures import PALETTE

WIDTH, HEIGHT = 640, 320
LEFT, RIGHT, TOP, BOTTOM = 64, 56, 18, 46


def search_plot(trials: Sequence[Trial], chosen: tuple[int, int] | None) -> Html:
    """The objective over N, a line for each n, the chosen pair ringed. The vertical axis is logarithmic."""
    trials = [t for t in trials if math.isfinite(t.objective) and t.objective > 0]
    if not trials:
        return Html("")
    low, high = min(t.objective for t in trials), max(t.objective for t in trials)
    low, high = low / 1.15, high * 1.15
    N_low, N_high = min(t.N for t in trials), max(t.N for t in trials)

    def x(N: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (N - N_low + 0.15) / max(N_high - N_low + 0.3, 1)

    def y(objective: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * math.log(high / objective) / math.log(high / low)

    parts = [_horizontal(y(tick), short(tick)) for tick in round_values(low, high)]
    for N in range(N_low, N_high + 1):
        parts.append(
            el("text", str(N), x=x(N), y=float(HEIGHT - BOTTOM + 20), cls="tick", text_anchor="middle")
        )
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(
        el(
            "text",
            "N, representative materials",
            x=middle,
            y=float(HEIGHT - 6),
            cls="axis",
            text_anchor="middle",
        )
    )
    labels: list[tuple[float, float, int]] = []
    for n in sorted({t.n for t in trials}):
        line = sorted((t for t in trials if t.n == n), key=lambda t: t.N)
        best = {t.N: min(s.objective for s in line if t.N == s.N) for t in line}
        points = [(x(N), y(value)) for N, value in best.items()]
        colour = PALETTE[(n - 1) % len(PALETTE)]
        path = "M" + " L".join(f"{px:.1f},{py:.1f}" for px, py in points)
        parts.append(el("path", d=path, fill="none", stroke=colour, stroke_width="2.5"))
        parts += [el("circle", cx=px, cy=py, r=3.5, fill=colour) for px, py in points]
        labels.append((points[-1][0], points[-1][1], n))
    parts += _line_labels(labels)
    for t in trials:
        if chosen == (t.n, t.N) and t.objective == min(s.objective for s in trials if (s.n, s.N) == chosen):
            parts.append(el("circle", cx=x(t.N), cy=y(t.objective), r=9.0, cls="ring"))
    label = f"Objective of {len(trials)} trials over n and N"
    return el("svg", parts, viewBox=f"0 0 {WIDTH} {HEIGHT}", role="img", aria_label=label, cls="plot")


def _horizontal(y: float, label: str) -> Html:
    return Html(
        el("line", x1=float(LEFT), x2=float(WIDTH - RIGHT), y1=y, y2=y, cls="grid")
        + el("text", label, x=float(LEFT - 10), y=y + 4, cls="tick", text_anchor="end")
    )


def _line_labels(ends: list[tuple[float, float, int]]) -> list[Html]:
    # Push labels apart so that they stay readable where lines end close together.
    out, taken = [], -math.inf
    for x, y, n in sorted(ends, key=lambda end: end[1]):
        taken = max(y, taken + 15)
        colour = PALETTE[(n - 1) % len(PALETTE)]
        out.append(el("text", f"n = {n}", x=x + 12, y=taken + 4, cls="label", fill=colour))
    return out


def round_values(low: float, high: float) -> list[float]:
    """Round values between ``low`` and ``high``: 1, 2, 5 a decade, and closer ones over a short range."""
    for steps in (
        (1, 10),
        (1, 3),
        (1, 2, 5),
        (1, 1.5, 2, 3, 4, 5, 6, 8),
        tuple(1 + i / 4 for i in range(36)),
    ):
        decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        ticks = sorted({s * 10.0**d for d in decades for s in steps if low <= s * 10.0**d <= high})
        if len(ticks) >= 3:
            return ticks[:: max(1, len(ticks) // 6)]
    return [low, math.sqrt(low * high), high]


def short(value: float) -> str:
    """A number for an axis."""
    if value == 0 or 1e-3 <= value < 1e4:
        return f"{value:.3g}"
    digits, power = f"{value:.1e}".split("e")
    return f"{digits.removesuffix('.0')}e{int(power)}"

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a report says, as plain data. Everything but a title may be missing; the page leaves it out."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..arrays import U8


@dataclass(frozen=True)
class Picture:
    """Display-ready pixels with a line of words: [H, W, 3] or [H, W, 4] (straight alpha), 8 bits."""

    caption: str
    pixels: U8
    crisp: bool = False
    """Show texels as squares where the picture is enlarged."""


@dataclass(frozen=True)
class Comparison:
    """One camera's photograph (or reference), the rendering of the material there, and their difference."""

    name: str
    reference: Picture
    rendered: Picture
    error: Picture | None = None
    nrms: float | None = None
    """As a fraction (design section 7)."""


@dataclass(frozen=True)
class Trial:
    """One (n, N) that the search looked at, and the objective of Eq. 5 there."""

    n: int
    N: int
    objective: float


@dataclass(frozen=True)
class StageCost:
    """What one stage of the work cost."""

    name: str
    seconds: float
    peak_mb: float


@dataclass(frozen=True)
class PhotographRow:
    """One photograph beside what the others foretell of it."""

    name: str
    scale: float
    """Shown over foretold radiance."""
    misfit: float
    """From 0 to 1, after that."""
    wrong: str
    """What is wrong with it, if anything; ``done`` is what followed."""
    done: str
    judged: bool = True


@dataclass(frozen=True)
class Figure:
    """A headline number, in words a newcomer understands."""

    value: str
    label: str
    note: str = ""


@dataclass(frozen=True)
class Report:
    """All that the page shows, in its order."""

    title: str
    summary: str = ""
    hero: tuple[Picture, ...] = ()
    figures: tuple[Figure, ...] = ()
    warnings: tuple[str, ...] = ()
    novel: tuple[Comparison, ...] = ()
    novel_light: str = ""
    views: tuple[Comparison, ...] = ()
    error_scale: float = 0.3
    """Error that the top colour of the heat maps stands for, as a fraction of the reference's RMS."""
    relit: tuple[Picture, ...] = ()
    """The material under lights that are not the capture's."""
    spheres: tuple[Picture, ...] = ()
    blend_map: Picture | None = None
    photographs: tuple[PhotographRow, ...] = ()
    photographs_doubt: str = ""
    """Why more of them may be wrong than are said to be, in words that follow "there are"."""
    maps: tuple[Picture, ...] = ()
    trials: tuple[Trial, ...] = ()
    chosen: tuple[int, int] | None = None
    """The (n, N) kept."""
    status: str = ""
    coverage: Picture | None = None
    coverage_note: str = ""
    trust: Picture | None = None
    """The error to expect, as a map."""
    inputs: tuple[tuple[str, str], ...] = ()
    settings: tuple[tuple[str, str], ...] = ()
    costs: tuple[StageCost, ...] = ()
    viewer: str = ""
    """The interactive page, beside this one."""
    next_steps: tuple[tuple[str, str], ...] = field(default=())
    """(what, command) pairs: where to look next."""
    version: str = ""

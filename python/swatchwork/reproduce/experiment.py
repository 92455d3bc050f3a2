# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What an experiment is: figures from a setting, and from the figures alone the verdict on each claim."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..progress import Task
from ..whole import whole_text
from .data import Data

Figures = dict[str, Any]
"""Plain numbers, as JSON holds them."""


@dataclass(frozen=True)
class Claim:
    """One statement of the paper, and what was found."""

    paper: str
    """What the paper says."""
    found: str
    """Our figure, in words."""
    holds: bool
    why: str = ""
    """Where it does not: what was found out about it."""


@dataclass(frozen=True)
class Plot:
    """Curves for the page."""

    name: str
    """Of the picture, NAME.svg."""
    curves: Mapping[str, Sequence[tuple[float, float]]]
    x_label: str
    y_label: str
    logarithmic: bool = True


@dataclass(frozen=True)
class Table:
    """Figures for the page."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


@dataclass(frozen=True)
class Setting:
    """What an experiment runs with."""

    data: Data
    folder: Path
    """Pictures and finished parts go here."""
    quick: bool = False
    """Few texels, views, trials: a check that everything runs, with figures that are only a hint."""
    captures: Path | None = None
    """Folder of captures with a test/ each."""
    code: str = ""
    """Digest of the package: parts that other code made are not used."""
    task: Task | None = None
    """Told which part is being made."""
    spent: list[float] = field(default_factory=list)
    """Seconds that the parts took, in this run or before."""

    def pick(self, whole: Any, quick: Any) -> Any:
        """A number of the whole experiment, or of the quick one."""
        return quick if self.quick else whole

    @property
    def parts(self) -> Path:
        """Finished parts of this code."""
        return self.folder / "parts" / self.code[:12]

    @property
    def pictures(self) -> Path:
        """What the page shows."""
        return self.folder / "pictures"

    def kept(self, name: str, make: Callable[[], Figures]) -> Figures:
        """The figures of a part: from an earlier run that was interrupted, or made now and kept."""
        file = self.parts / f"{name}.json"
        if file.exists():
            part: Figures = json.loads(file.read_text(encoding="utf-8"))
        else:
            if self.task is not None:
                self.task.describe(name)
            start = time.perf_counter()
            part = {"figures": make()}
            part["seconds"] = time.perf_counter() - start
            whole_text(file, json.dumps(part))
        self.spent.append(part["seconds"])
        figures: Figures = part["figures"]
        return figures


@dataclass(frozen=True)
class Experiment:
    """A figure or a text of the paper."""

    name: str
    """On the command line."""
    title: str
    run: Callable[[Setting], Figures]
    claims: Callable[[Figures], list[Claim]]
    tables: Callable[[Figures], list[Table]]
    minutes: float
    """About, on two cores."""
    how: str
    """What was done, in a few sentences for the page."""
    plots: Callable[[Figures], list[Plot]] = lambda figures: []
    pictures: tuple[tuple[str, str], ...] = ()
    """Files that it writes into ``setting.pictures``, and what each shows."""

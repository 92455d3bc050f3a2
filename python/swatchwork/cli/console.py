# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a person sees of a command: bars with the time left, warnings in yellow, a summary, or one JSON."""

from __future__ import annotations

import json
import time
import unicodedata
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ..errors import CaptureWarning
from ..progress import SILENT, Task
from ..progress import Progress as ProgressProtocol

SHOW_AFTER_S = 2.0
"""Stages shorter than this never get a bar."""


def stderr() -> Console:
    """For everything but results; made anew so that it follows a redirected stream."""
    return Console(stderr=True, highlight=False)


def plain(text: object, *, lines: bool = False) -> str:
    """Text for a terminal; control characters, which steer it, as escapes. Line ends stay by ``lines``."""
    return "".join(
        c if not unicodedata.category(c).startswith("C") or (lines and c == "\n") else _escaped(c)
        for c in str(text)
    )


def _escaped(c: str) -> str:
    return c.encode("unicode_escape").decode("ascii")


class _Bars(Progress):
    """Bars of the stages that have taken long enough to be worth one."""

    def get_renderables(self) -> Iterable[RenderableType]:
        worth = [t for t in self.tasks if not t.finished and (t.elapsed or 0.0) >= SHOW_AFTER_S]
        yield self.make_tasks_table(worth)


@dataclass
class _BarTask:
    bars: _Bars
    id: TaskID
    name: str

    def advance(self, steps: float = 1) -> None:
        self.bars.advance(self.id, steps)

    def describe(self, text: str) -> None:
        self.bars.update(self.id, description=plain(f"{self.name}: {text}"))


@dataclass
class ConsoleProgress:
    """Stages as bars on a terminal; with -v, or where there is none, a line for each outermost stage."""

    console: Console
    verbose: bool = False
    _bars: _Bars | None = None
    _depth: int = 0

    @contextmanager
    def stage(self, name: str, total: float | None = None) -> Iterator[Task]:
        """See ``swatchwork.progress.Progress``."""
        outermost = self._depth == 0
        start = time.perf_counter()
        self._depth += 1
        try:
            with self._bar(name, total) as task:
                yield task
            if outermost and (self.verbose or not self.console.is_terminal):
                self.console.print(
                    f"{plain(name)}: {time.perf_counter() - start:.1f} s", style="dim", markup=False
                )
        finally:
            self._depth -= 1

    @contextmanager
    def _bar(self, name: str, total: float | None) -> Iterator[Task]:
        if not self.console.is_terminal:
            with SILENT.stage(name, total) as task:
                yield task
            return
        outermost = self._bars is None
        bars = self._bars = self._bars or _bars(self.console)
        label = plain("  " * (self._depth - 1) + name)
        number = bars.add_task(label, total=total)
        try:
            yield _BarTask(bars, number, label)
        finally:
            bars.remove_task(number)
            if outermost:
                bars.stop()
                self._bars = None


def _bars(console: Console) -> _Bars:
    bars = _Bars(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    bars.start()
    return bars


@dataclass
class Session:
    """One command's run: where progress goes, and what it says at its end."""

    console: Console
    as_json: bool
    quiet: bool
    verbose: bool
    progress: ProgressProtocol = SILENT
    warnings: list[str] = field(default_factory=list)

    def say(self, text: str) -> None:
        """A line for a person, on standard output; nothing with --json or --quiet."""
        if not (self.as_json or self.quiet):
            Console(highlight=False).print(plain(text, lines=True), markup=False, soft_wrap=True)

    def show(self, thing: RenderableType) -> None:
        """A table for a person; nothing with --json or --quiet."""
        if not (self.as_json or self.quiet):
            Console(highlight=False).print(thing)

    def result(self, summary: dict[str, Any]) -> None:
        """The command's summary: with --json the one object on standard output."""
        if self.as_json:
            print(json.dumps({**summary, "warnings": self.warnings}, indent=2, allow_nan=False))


@contextmanager
def session(*, as_json: bool = False, quiet: bool = False, verbose: bool = False) -> Iterator[Session]:
    """A run in which CaptureWarnings are shown in yellow and kept."""
    console = stderr()
    run = Session(console, as_json, quiet, verbose)
    if not quiet:
        run.progress = ConsoleProgress(console, verbose)

    def show(message: Warning | str, category: type[Warning], *_: Any) -> None:
        if issubclass(category, CaptureWarning):
            run.warnings.append(str(message))
            console.print(f"warning: {plain(message)}", style="yellow", markup=False, soft_wrap=True)
        elif verbose:
            console.print(f"{category.__name__}: {plain(message)}", style="dim", markup=False, soft_wrap=True)

    with warnings.catch_warnings():
        warnings.simplefilter("always", CaptureWarning)
        warnings.showwarning = show  # type: ignore[assignment]
        yield run

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What the stages of a piece of work cost: their wall time and the process's peak memory."""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from ..progress import SILENT, Progress, Task


@dataclass(frozen=True)
class StageCost:
    """One outermost stage."""

    name: str
    seconds: float
    peak_mb: float
    """Peak resident memory of the whole process while the stage ran; since the start where the system
    cannot tell (other than Linux)."""


class CostRecorder:
    """A ``Progress`` that passes everything on and notes what each outermost stage cost."""

    def __init__(self, progress: Progress = SILENT) -> None:
        self.costs: list[StageCost] = []
        self._progress = progress
        self._depth = 0

    @contextmanager
    def stage(self, name: str, total: float | None = None) -> Iterator[Task]:
        """See ``Progress.stage``."""
        outermost = self._depth == 0
        if outermost:
            return_freed_memory()
            reset_peak_memory()
        start = time.perf_counter()
        self._depth += 1
        try:
            with self._progress.stage(name, total) as task:
                yield task
        finally:
            self._depth -= 1
            if outermost:
                self.costs.append(StageCost(name, time.perf_counter() - start, peak_memory_mb()))


def return_freed_memory() -> None:
    """Hand freed memory back to the system: glibc keeps blocks of up to 32 MB (90 MB at 2048 x 2048)."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).malloc_trim(0)


def reset_peak_memory() -> None:
    """Start counting the peak anew, where the system lets a process do so."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_memory_mb() -> float:
    """Peak resident memory of this process in MB (1e6 bytes), since the last reset where that works."""
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    except OSError:
        pass
    try:
        import resource
    except ImportError:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6

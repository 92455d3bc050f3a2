# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Progress is an object passed in; libraries never print."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Task(Protocol):
    """One running stage."""

    def advance(self, steps: float = 1) -> None:
        """Count ``steps`` more of the stage's total as done."""

    def describe(self, text: str) -> None:
        """Say in a few words what is being done now."""


class Progress(Protocol):
    """What a long-running function reports to."""

    @contextmanager
    def stage(self, name: str, total: float | None = None) -> Iterator[Task]:
        """Open a stage of ``total`` steps (None: not known beforehand)."""


class _SilentTask:
    def advance(self, steps: float = 1) -> None:
        pass

    def describe(self, text: str) -> None:
        pass


class _Silent:
    @contextmanager
    def stage(self, name: str, total: float | None = None) -> Iterator[Task]:
        yield _SilentTask()


SILENT: Progress = _Silent()
"""The no-op default."""

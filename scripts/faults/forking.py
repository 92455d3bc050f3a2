# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Runs of the command line in forked processes: the package is imported once, not in each."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import shared
from child import FAULTS
from stepping import in_child

from swatchwork.cli import main


@dataclass
class Process:
    """A command that runs."""

    pid: int
    said_in: Path
    code: int | None = field(default=None)

    def signal(self, number: int) -> None:
        """Send a signal, where it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def poll(self) -> int | None:
        """Its exit code (negative: a signal), None while it runs."""
        if self.code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.code = os.waitstatus_to_exitcode(status) if pid else None
        return self.code

    def at(self, moment_s: float) -> bool:
        """Wait until it has taken so much CPU time; whether it is still there."""
        while self.poll() is None:
            if shared.cpu_s(self.pid) >= moment_s:
                return True
            time.sleep(0.002)
        return False

    def ended(self) -> tuple[int, str]:
        """Exit code and all that it said, once it is over."""
        while self.poll() is None:
            time.sleep(0.005)
        assert self.code is not None
        return self.code, self.said_in.read_text(encoding="utf-8", errors="replace")


def start(arguments: list[str], *faults: str, before: Callable[[], None] = lambda: None) -> Process:
    """The command in a forked process with faults put in; ``before`` runs in it first."""
    import swatchwork.cli.app
    import swatchwork.workflow  # noqa: F401

    said = Path(tempfile.mkstemp(prefix="said-", dir=shared.FAULTS)[1])
    pid = os.fork()
    if pid == 0:

        def action() -> int:
            before()
            for fault in faults:
                FAULTS[fault]()
            return main(arguments)

        in_child(action, said)
    return Process(pid, said)


def run(arguments: list[str], *faults: str, before: Callable[[], None] = lambda: None) -> tuple[int, str]:
    """Exit code and what was said, of a command in a forked process."""
    process = start(arguments, *faults, before=before)
    ended = process.ended()
    process.said_in.unlink()
    return ended


def cpu_of_a_run(arguments: list[str]) -> float:
    """CPU time, in seconds, of a command that nothing disturbs."""
    process = start(arguments)
    last = 0.0
    while process.poll() is None:
        # Its last moments may fall between two looks: a part of a hundredth of the run.
        with suppress(OSError, ValueError, IndexError):
            last = max(last, shared.cpu_s(process.pid))
        time.sleep(0.005)
    process.ended()
    return last


def reconstruct(output: Path, options: list[str] = shared.OPTIONS) -> list[str]:
    """Arguments of the run that is disturbed; without the viewer, which has its own faults."""
    return ["reconstruct", str(shared.capture()), "-o", str(output), *options, "--no-viewer", "-q"]


def ready(folder: Path) -> Path:
    """``folder/out`` as the older material, ``out.partial`` with all parts of the run that replaces it."""
    template = shared.FAULTS / "ready"
    if not template.is_dir():
        part = shared.emptied("ready")
        code, _ = run(reconstruct(shared.with_older(part)), "kill-before-swap")
        assert code == -signal.SIGKILL
        for left in part.glob(".out.*"):
            shared.shutil.rmtree(left)
        part.rename(template)
    shared.shutil.rmtree(folder)
    shared.shutil.copytree(template, folder)
    return folder / "out"


def one_line(code: int, said: str, wanted: int, *words: str) -> str | None:
    """What is wrong with how a command ended: None where it is one line with these words, and the code."""
    lines = [line for line in said.strip().splitlines() if not line.startswith("warning: ")]
    if code == wanted and len(lines) == 1 and all(word in said for word in words):
        return None
    return f"exit code {code}: {said[-300:]!r}"

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Exit codes, and how a person or a system stops a command: Ctrl-C and SIGTERM."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

DEFECT = 1
FAILED = 2
"""Wrong input, a full disk, too little memory: said in one line."""
INTERRUPTED = 128 + signal.SIGINT
TERMINATED = 128 + signal.SIGTERM

GOES_ON = (
    "nothing was half-written, and the same command goes on (reconstruct and reproduce from what they have "
    "finished, the others from their beginning)"
)


@dataclass
class Stop:
    """Whether something asked for the end."""

    by: int | None = None
    """The signal."""

    def said(self) -> int:
        """Say it in one line; returns the exit code."""
        terminated = self.by == signal.SIGTERM
        print(f"{'terminated' if terminated else 'interrupted'}; {GOES_ON}", file=sys.stderr)
        return TERMINATED if terminated else INTERRUPTED


@contextmanager
def stoppable() -> Iterator[Stop]:
    """Within, the first Ctrl-C or SIGTERM raises KeyboardInterrupt, so that what is temporary is removed.

    A second one, during that, ends the process at once: everything is as safe then as with kill -9. What the
    shell set to be ignored stays so; outside the main thread nothing is changed.
    """
    stop = Stop()

    def heard(number: int, _: FrameType | None) -> None:
        if stop.by is not None:
            os.write(2, f"stopped at once; {GOES_ON}\n".encode())
            os._exit(128 + number)
        stop.by = number
        raise KeyboardInterrupt

    before = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, heard)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if before:
            # The command is over, and only the interpreter still tidies up: a signal then changes nothing.
            atexit.register(_deaf)


def _deaf() -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)

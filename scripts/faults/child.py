# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The command line with one fault in it: ``python child.py FAULT... -- ARGUMENTS``.

Faults are put in from outside, in this process alone; the package has no hook for them.
"""

from __future__ import annotations

import errno
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from swatchwork.cli import main


def die(*_: Any, **__: Any) -> Any:
    """End as by kill -9."""
    os.kill(os.getpid(), signal.SIGKILL)


def no_exchange() -> None:
    """A file system that cannot exchange two names."""
    from swatchwork.whole import folders

    folders.exchange = lambda *_: False


def kill_before_swap() -> None:
    """The new folder is whole, and has not its name yet."""
    from swatchwork.whole import folders

    folders._swap = die


def kill_after_exchange() -> None:
    """The names are exchanged, and the older folder is not removed yet."""
    from swatchwork.whole import folders

    exchange = folders.exchange
    folders.exchange = lambda a, b: exchange(a, b) and die()


def kill_between_renames() -> None:
    """The older folder has stepped aside, and nothing has its name."""
    no_exchange()
    rename = Path.rename

    def renamed(self: Path, target: Path) -> Path:
        done = rename(self, target)
        if str(target).endswith(".replaced"):
            die()
        return done

    Path.rename = renamed  # type: ignore[assignment,method-assign]


def kill_after_renames() -> None:
    """Without an exchange: the new folder is in place, the older one is not removed yet."""
    no_exchange()
    _kill_while_removing()


def kill_while_removing() -> None:
    """The older folder is half removed."""
    _kill_while_removing()


def _kill_while_removing() -> None:
    rmtree = shutil.rmtree

    def removed(path: Path, *rest: Any, **options: Any) -> None:
        if (Path(path) / "svbrdf.json").exists():
            (Path(path) / "svbrdf.json").unlink()
            die()
        rmtree(path, *rest, **options)

    shutil.rmtree = removed  # type: ignore[assignment]


def no_locks() -> None:
    """A file system that keeps no locks, as some network ones."""
    import fcntl

    def refused(*_: Any) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    fcntl.flock = refused


def clock_jumps() -> None:
    """Every look at the wall clock is years from the one before, forth and back."""
    real, looks = time.time, [0]

    def jumping() -> float:
        looks[0] += 1
        return real() + (1e8 if looks[0] % 2 else -1e8)

    time.time = jumping
    time.time_ns = lambda: int(jumping() * 1e9)


FAULTS: dict[str, Callable[[], None]] = {
    f.__name__.replace("_", "-"): f
    for f in (
        no_exchange,
        kill_before_swap,
        kill_after_exchange,
        kill_between_renames,
        kill_after_renames,
        kill_while_removing,
        no_locks,
        clock_jumps,
    )
}


if __name__ == "__main__":
    split = sys.argv.index("--")
    for name in sys.argv[1:split]:
        FAULTS[name]()
    sys.exit(main(sys.argv[split + 1 :]))

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""An action broken off at each of its steps: files opened to write, renamed, removed, folders made.

Python tells an audit hook before each such step; in a forked process the hook makes the fault there. So every
moment at which a file system can be seen in another state is tried, however short it is.
"""

from __future__ import annotations

import errno
import os
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

Fault = Literal["none", "kill", "interrupt", "terminate", "full"]
SIGNALS = {"kill": signal.SIGKILL, "interrupt": signal.SIGINT, "terminate": signal.SIGTERM}

MAKING = {"open", "os.mkdir"}
"""Steps that need room on the disk."""
CHANGING = {"os.rename", "os.remove", "os.rmdir", "os.truncate", "os.link"}
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT


@dataclass(frozen=True)
class Ended:
    """How an action ended that was broken off at a step."""

    step: int
    code: int
    """Exit code; negative: the signal that ended it."""
    said: str
    files: dict[str, bytes]
    """All that is in the folder then, by path."""


def stepped(
    action: Callable[[], int],
    prepare: Callable[[], None],
    work: Path,
    fault: Fault,
    most: int = 10**9,
) -> Iterator[Ended]:
    """Break ``action`` off at each of its steps in ``work``, which ``prepare`` makes anew each time.

    Args:
        action: gives an exit code; runs in a forked process.
        most: steps at most: the last ones, where the results take their place, and others evenly. For kill -9
            it is every step, of one run: what is in the folder before a step is what a kill there leaves.
    """
    prepare()
    if fault == "kill":
        yield from _left_by_kills(action, work)
        return
    steps = _broken(action, work, fault, 10**9)[1]
    for step in _chosen(steps, most):
        prepare()
        yield _broken(action, work, fault, step)[0]


def _left_by_kills(action: Callable[[], int], work: Path) -> Iterator[Ended]:
    with tempfile.TemporaryDirectory() as kept:
        ended = _broken(action, work, "kill", 0, Path(kept))[0]
        if ended.code:
            raise RuntimeError(f"without a fault it ends with {ended.code}: {ended.said}")
        folders = sorted(Path(kept).iterdir(), key=lambda path: int(path.name))
        for i, folder in enumerate(folders):
            yield Ended(i, -signal.SIGKILL, "", _files(folder))


def _files(folder: Path) -> dict[str, bytes]:
    return {
        p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()
    }


def undisturbed(action: Callable[[], int], prepare: Callable[[], None], work: Path) -> Ended:
    """The action in a forked process without a fault."""
    prepare()
    return _broken(action, work, "none", 10**9)[0]


def _chosen(steps: int, most: int) -> list[int]:
    if steps <= most:
        return list(range(steps))
    late = most // 2
    early = steps - late
    return [i * early // (most - late) for i in range(most - late)] + list(range(early, steps))


def _broken(
    action: Callable[[], int], work: Path, fault: Fault, step: int, kept: Path | None = None
) -> tuple[Ended, int]:
    with tempfile.TemporaryDirectory() as outside:
        said, count = Path(outside) / "said", Path(outside) / "count"
        sys.stdout.flush()
        sys.stderr.flush()
        pid = os.fork()
        if pid == 0:
            _child(action, work, fault, step, said, count, kept)
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        steps = int(count.read_text()) if count.exists() else 0
        text = said.read_text(encoding="utf-8", errors="replace")
    return Ended(step, code, text, _files(work)), steps


def _child(
    action: Callable[[], int], work: Path, fault: Fault, step: int, said: Path, count: Path, kept: Path | None
) -> None:
    def watched() -> int:
        seen = _watch(work, fault, step, kept)
        code = action()
        count.write_text(str(seen[0]))
        return code

    in_child(watched, said)


def in_child(action: Callable[[], int], said: Path) -> NoReturn:
    """Run an action in a process that was just forked, and end it with the action's exit code."""
    code = 99
    try:
        stream = os.open(said, os.O_WRONLY | os.O_CREAT)
        os.dup2(stream, 1)
        os.dup2(stream, 2)
        # Not pytest's, where a test is the parent.
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115
        signal.signal(signal.SIGINT, signal.default_int_handler)
        code = action()
    except KeyboardInterrupt:
        code = 98
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _watch(work: Path, fault: Fault, step: int, kept: Path | None) -> list[int]:
    """Count steps in ``work``, and make the fault at the one numbered ``step``."""
    seen = [0]
    wanted = MAKING if fault == "full" else MAKING | CHANGING | {"ctypes.dlsym"}

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event not in wanted or not _counts(event, arguments, work):
            return
        seen[0] += 1
        number = seen[0] - 1
        if fault == "full" and number >= step:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(arguments[0]))
        if kept is not None:
            shutil.copytree(work, kept / str(number))
        elif number == step and fault in SIGNALS:
            os.kill(os.getpid(), SIGNALS[fault])

    sys.addaudithook(hook)
    return seen


def _counts(event: str, arguments: tuple[Any, ...], work: Path) -> bool:
    if event == "ctypes.dlsym":
        return arguments[1] in ("renameat2", "renamex_np")
    try:
        inside = os.fsdecode(os.path.abspath(arguments[0])).startswith(f"{work}{os.sep}")
    except TypeError:  # A descriptor.
        return False
    if event == "open":
        mode, flags = arguments[1], arguments[2]
        writes = any(c in mode for c in "wax+") if mode is not None else bool((flags or 0) & WRITES)
        return inside and writes
    return inside


def fresh_copy(source: Path | None, work: Path) -> None:
    """``work`` as a copy of ``source``, or empty."""
    shutil.rmtree(work, ignore_errors=True)
    if source is None:
        work.mkdir(parents=True)
    else:
        shutil.copytree(source, work)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Two runs on one output, file systems without locks, a clock that jumps, damaged checkpoints."""

from __future__ import annotations

import os
import random
import shutil
import signal
import time
from pathlib import Path
from typing import Any

import forking
import shared
from same_bits import contents, differing
from shared import Row

MOST_COST = 0.03
"""Of CPU time, for checkpoints and their digests."""


def measure() -> dict[str, Any]:
    whole = {name: of for name, of in contents(shared.whole()).items() if name != "viewer.html"}
    rows = [
        _digest_cost(),
        _second_run(whole),
        _stale_lock(whole),
        _no_locks(whole),
        _two_exports(),
        _clock(whole),
        *_damage(whole),
    ]
    return shared.rows_of(rows)


def _paused_in_the_run(output: Path) -> forking.Process:
    """A run that stands still and holds its lock."""
    process = forking.start(forking.reconstruct(output))
    lock = output.with_name("out.partial") / "lock"
    while process.poll() is None and not (lock.exists() and f'"pid": {process.pid},' in lock.read_text()):
        time.sleep(0.005)
    process.signal(signal.SIGSTOP)
    return process


def _goes_on(output: Path, whole: dict[str, str], *faults: str, said: str = "") -> list[str]:
    code, words = forking.run(forking.reconstruct(output), *faults)
    wrong = [] if code == 0 else [f"the same command then: {code} {words}"]
    wrong += [f"differs in {name}" for name in differing(output, whole)]
    wrong += [f"leaves {name}" for name in shared.left_beside(output)]
    return wrong + ([] if said in words else [f"does not say {said!r}: {words!r}"])


def _second_run(whole: dict[str, str]) -> Row:
    output = forking.ready(shared.emptied("others"))
    first = _paused_in_the_run(output)
    code, said = forking.run(forking.reconstruct(output))
    bad = forking.one_line(
        code, said, 2, f"process {first.pid} on {os.uname().nodename}, since ", "Wait for it"
    )
    first.signal(signal.SIGCONT)
    ended = first.ended()
    wrong = ([bad] if bad else []) + ([f"the first: {ended}"] if ended[0] else [])
    wrong += [f"differs in {name}" for name in differing(output, whole)]
    found = "; ".join(wrong) or (
        "the second ends at once with exit 2 and one line: process, host, since when, and what to do; the "
        "first ends with its material"
    )
    return Row("two runs into one OUT", 1, found, not wrong)


def _stale_lock(whole: dict[str, str]) -> Row:
    output = forking.ready(shared.emptied("others"))
    first = _paused_in_the_run(output)
    first.signal(signal.SIGKILL)
    first.ended()
    wrong = _goes_on(output, whole)
    found = "; ".join(wrong) or "the next run takes it over and goes on"
    return Row("the lock of a run that was killed", 1, found, not wrong)


def _no_locks(whole: dict[str, str]) -> Row:
    output = forking.ready(shared.emptied("others"))
    wrong = _goes_on(output, whole, "no-locks", said="keeps no locks")
    found = "; ".join(wrong) or "a warning that two runs would not be told apart; it goes on"
    return Row("a file system without locks (ENOLCK)", 1, found, not wrong)


def _two_exports() -> Row:
    folder = shared.emptied("others")
    alone = {}
    for name, of in (("L", shared.older()), ("M", shared.whole())):
        code, said = forking.run(["export", str(of), "--format", "maps", "-o", str(folder / name), "-q"])
        assert code == 0, said
        alone[name] = contents(folder / name)
        shutil.rmtree(folder / name)
    both = [
        forking.start(["export", str(of), "--format", "maps", "-o", str(folder / "out"), "-q"])
        for of in (shared.older(), shared.whole())
    ]
    ends = [process.ended() for process in both]
    wrong = [f"exit {code}: {said}" for code, said in ends if code]
    if contents(folder / "out") not in alone.values():
        wrong.append("the folder is neither one's")
    wrong += [f"leaves {name}" for name in shared.left_beside(folder / "out")]
    found = "; ".join(wrong) or "both end well; the folder is one of the two exports, whole"
    return Row("two exports of other materials into one folder at once", 1, found, not wrong)


def _clock(whole: dict[str, str]) -> Row:
    output = forking.ready(shared.emptied("others"))
    rng = random.Random(2)
    for path in output.with_name("out.partial").rglob("*"):
        moment = time.time() + rng.uniform(-1e9, 1e9)
        os.utime(path, (moment, moment))
    wrong = _goes_on(output, whole, "clock-jumps")
    found = "; ".join(wrong) or "the same material, gone on from the same parts"
    return Row(
        "a clock that jumps by years at each look, checkpoints from past and future", 1, found, not wrong
    )


def _digest_cost() -> Row:
    """CPU time of the digests, as a share of the run that makes them."""
    folder = shared.emptied("others")
    told = folder / "told"

    def timed() -> None:
        from swatchwork.workflow import checkpoints

        spent = [0.0]
        real = checkpoints.write_part

        def write_part(*arguments: Any) -> None:
            start = time.process_time()
            real(*arguments)
            spent[0] += time.process_time() - start
            told.write_text(f"{spent[0]} {time.process_time()}")

        checkpoints.write_part = write_part

    code, said = forking.run(forking.reconstruct(folder / "out"), before=timed)
    assert code == 0, said
    spent_s, total_s = map(float, told.read_text().split())
    share = spent_s / total_s
    # What is asked: the clean path may not be slower by more than a few per cent.
    found = f"{100 * share:.1f} % of the run's CPU time until its last part, writing and syncing included"
    return Row("no fault: what checkpoints with digests cost", 1, found, share < MOST_COST)


def _damage(whole: dict[str, str]) -> list[Row]:
    rows = []
    rng = random.Random(3)
    parts = sorted(
        p for p in (forking.ready(shared.emptied("others")).parent / "out.partial").iterdir() if p.is_dir()
    )
    for kind in ("a bit is flipped", "it is cut short", "its digests are gone"):
        wrong = []
        for name in [part.name for part in rng.sample(parts, 2)]:
            output = forking.ready(shared.emptied("others"))
            part = output.with_name("out.partial") / name
            file = max(part.glob("*.npy"), key=lambda path: path.stat().st_size)
            data = bytearray(file.read_bytes())
            if kind == "a bit is flipped":
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
                file.write_bytes(data)
            elif kind == "it is cut short":
                file.write_bytes(data[: rng.randrange(len(data))])
            else:
                (part / "digests.json").unlink()
            wrong += [f"{name}: {w}" for w in _goes_on(output, whole, said=f"{name}: ")]
        found = "; ".join(wrong) or "noticed, said, made anew; the same material"
        rows.append(Row(f"a checkpoint is damaged: {kind}", 2, found, not wrong))
    return rows

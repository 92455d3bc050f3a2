# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Ctrl-C and SIGTERM at random moments of a run, and a second Ctrl-C while the first one tidies up."""

from __future__ import annotations

import os
import random
import signal
import time
from pathlib import Path
from typing import Any

import forking
import shared
from same_bits import contents, differing
from shared import Row


def measure() -> dict[str, Any]:
    whole = {name: of for name, of in contents(shared.whole()).items() if name != "viewer.html"}
    rng = random.Random(1)
    total_s = forking.cpu_of_a_run(forking.reconstruct(shared.emptied("stops") / "out"))
    rows = [
        _stopped(signal.SIGINT, 10, rng, total_s, whole),
        _stopped(signal.SIGTERM, 3, rng, total_s, whole),
        _twice(whole),
    ]
    return shared.rows_of(rows, total_cpu_s=total_s)


def _stopped(
    number: signal.Signals, times: int, rng: random.Random, total_s: float, whole: dict[str, str]
) -> Row:
    code_of, word = (130, "interrupted") if number == signal.SIGINT else (143, "terminated")
    wrong: list[str] = []
    done = 0
    while done < times:
        moment_s = total_s * rng.random()
        folder = shared.emptied("stops")
        output = shared.with_older(folder)
        process = forking.start(forking.reconstruct(output))
        if not process.at(moment_s):
            process.ended()
            continue
        process.signal(number)
        code, said = process.ended()
        if code == 0:
            continue  # It was through: another moment.
        done += 1
        bad = forking.one_line(code, said, code_of, word, "the same command goes on")
        state = "older" if contents(output) == contents(shared.older()) else "another"
        left = [name for name in shared.left_beside(output) if name != "out.partial"]
        wrong += [f"at {moment_s / total_s:.2f}: {w}" for w in (bad, *left) if w]
        wrong += [f"at {moment_s / total_s:.2f}: OUT is {state}"] if state != "older" else []
        code, said = forking.run(forking.reconstruct(output))
        if code or differing(output, whole) or shared.left_beside(output):
            wrong.append(f"at {moment_s / total_s:.2f}: the same command then: {code} {said}")
    found = "; ".join(wrong[:3]) or (
        f"exit {code_of} and one line that says that the same command goes on, OUT the older material, at "
        f"most OUT.partial beside it; {times} identical materials after the same command"
    )
    return Row(f"{number.name} at random moments of a run", times, found, not wrong)


def _twice(whole: dict[str, str]) -> Row:
    """The second comes while the first one's folder is removed."""

    def slow_and_hit_again() -> None:
        from swatchwork.whole import siblings

        rmtree = siblings.shutil.rmtree

        def hit(path: Path, *rest: Any, **options: Any) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
            rmtree(path, *rest, **options)

        def interrupted(*_: Any) -> None:
            siblings.shutil.rmtree = hit
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1)

        from swatchwork.material import folder

        folder.write_obj = interrupted

    output = forking.ready(shared.emptied("stops"))
    code, said = forking.run(forking.reconstruct(output), before=slow_and_hit_again)
    bad = forking.one_line(code, said, 130, "stopped at once", "the same command goes on")
    wrong = [bad] if bad else []
    if contents(output) != contents(shared.older()):
        wrong.append("OUT is not the older material")
    code, said = forking.run(forking.reconstruct(output))
    if code or differing(output, whole) or shared.left_beside(output):
        wrong.append(f"the same command then: {code} {said} {shared.left_beside(output)}")
    found = "; ".join(wrong) or "exit 130 at once and one line, OUT the older material; then as above"
    return Row("a second Ctrl-C while the first one tidies up", 1, found, not wrong)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""kill -9 at random moments of a run; the same command then goes on to the same material, bit for bit.

Moments are of the run's own CPU time, so that a busy machine does not move them: most uniform over the run,
the rest over its last tenth, where the folder takes its place. Every second run replaces an older material.
"""

from __future__ import annotations

import json
import random
import signal
import sys
from pathlib import Path
from typing import Any

import forking
import shared
from same_bits import contents, differing
from shared import Row

LATE = 0.3
"""Share of the moments that lie in the last tenth."""


def measure(kills: int = 50, seed: int = 0) -> dict[str, Any]:
    whole = contents(shared.whole())
    total_s = forking.cpu_of_a_run(arguments_for(shared.emptied("kills") / "out"))
    rng = random.Random(seed)
    kept = shared.FAULTS / "kills.jsonl"
    found = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    for _ in range(len(found)):
        rng.random(), rng.random()
    while len(found) < kills:
        late, part = rng.random() < LATE, rng.random()
        moment_s = total_s * ((0.9 + 0.1 * part) if late else part)
        one = killed(moment_s, with_older=len(found) % 2 == 1, whole=whole)
        if one is None:
            continue  # It took less CPU time this once, and was through: another moment.
        found.append(one | {"moment": moment_s / total_s})
        with kept.open("a") as stream:
            stream.write(json.dumps(found[-1]) + "\n")
        print(f"kill {len(found)} of {kills}: {found[-1]}", file=sys.stderr, flush=True)
    same = sum(not one["differ"] for one in found)
    states = [one["state"] for one in found]
    clean = sum(not one["left"] for one in found)
    rows = [
        Row(
            "kill -9 at random moments of a run, then the same command",
            len(found),
            f"{same} identical materials (all files but report.html); {clean} with nothing left beside",
            same == clean == len(found),
        ),
        Row(
            "OUT at the moment after each kill -9",
            len(found),
            f"{shared.counted(states)}",
            all(one["state"] in one["allowed"] for one in found),
        ),
    ]
    return shared.rows_of(rows, total_cpu_s=total_s, kills=found)


def arguments_for(output: Path) -> list[str]:
    """The run that is killed; with the viewer."""
    return [word for word in forking.reconstruct(output) if word != "--no-viewer"]


def killed(moment_s: float, with_older: bool, whole: dict[str, str]) -> dict[str, Any] | None:
    """One run killed at a moment and gone on with; None where it was through by then."""
    folder = shared.emptied("kills")
    output = shared.with_older(folder) if with_older else folder / "out"
    process = forking.start(arguments_for(output))
    if not process.at(moment_s):
        process.ended()
        return None
    process.signal(signal.SIGKILL)
    if process.ended()[0] != -signal.SIGKILL:
        return None
    partial = output.with_name("out.partial")
    parts = [path.name for path in partial.iterdir() if path.is_dir()] if partial.is_dir() else []
    state = shared.state_of(output)
    code, said = forking.run(arguments_for(output))
    return {
        "state": state,
        "allowed": ["older" if with_older else "none", "new"],
        "parts": len(parts),
        "exit": code,
        "said": said[-300:] if code else "",
        "differ": differing(output, whole),
        "left": shared.left_beside(output),
    }

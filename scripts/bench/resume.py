# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""kill -9 at random moments: the run that goes on must end with the same material, bit for bit.

    python scripts/bench/resume.py --json target/bench/resume.json
    python scripts/bench/resume.py --capture ../shared/captures/sphere-merl --kills 3

An undisturbed `swatchwork reconstruct` first; then, for each kill, one that is killed at a random moment of
that time and one by the same command that goes on. All files are compared but report.html, which tells the
time it took. Finished runs stay in target/bench/resume; delete a file to repeat it.

Columns: when it was killed, in seconds; parts that were finished by then; seconds that the rest took; files
that differ.
"""

from __future__ import annotations

import argparse
import random
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import scenes
import shared
from same_bits import contents, differing
from shared import results


def measure(capture: Path, options: list[str], kills: int, seed: int, work: Path) -> dict[str, Any]:
    undisturbed = shared.reconstruct(capture, work / "whole", *options)
    whole, seconds = contents(work / "whole"), undisturbed["cost"]["wall_s"]
    rng = random.Random(seed)
    material, rows = work / "killed", []
    partial = material.with_name(f"{material.name}.partial")
    command = [str(shared.SWATCHWORK), "reconstruct", str(capture), "-o", str(material), *options, "-q"]
    while len(rows) < kills:
        shared.begin_anew(material)
        moment = rng.uniform(0.3, seconds)
        run = subprocess.Popen(command)
        time.sleep(moment)
        if run.poll() is not None:
            continue  # It was faster this time: another moment.
        run.send_signal(signal.SIGKILL)
        run.wait()
        parts = [path.name for path in partial.iterdir() if path.is_dir()] if partial.is_dir() else []
        start = time.perf_counter()
        subprocess.run(command, check=True)
        rest = time.perf_counter() - start
        differ = differing(material, whole) + ([partial.name] if partial.exists() else [])
        rows.append({"moment": moment, "parts": len(parts), "rest": rest, "differ": differ})
    return {"undisturbed": undisturbed, "kills": rows}


HEAD = ["killed at", "finished parts", "rest took", "files that differ"]


def rows(found: dict[str, Any]) -> list[list[str]]:
    return [
        [f"{r['moment']:.1f}", str(r["parts"]), f"{r['rest']:.1f}", ", ".join(r["differ"]) or "none"]
        for r in found["kills"]
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--capture", type=Path, help="by default the simulated one of Table 1's DustSph")
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    capture = args.capture or scenes.capture_of("DustSph", scenes.ROWS["DustSph"].size)
    options = ["--resolution", str(args.resolution)]
    work = shared.BENCH / "resume" / f"{capture.resolve().name}-{args.resolution}-{args.kills}"
    found = shared.kept(
        work.with_suffix(".json"), lambda: measure(capture, options, args.kills, args.seed, work)
    )
    print(results.table(HEAD, rows(found)))
    shared.write(args.json, {"resolution": args.resolution} | found)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The default subset of texels against every texel throughout, at a 256 x 256 atlas.

    python scripts/bench/streaming.py --captures ../shared/captures --json target/bench/streaming.json
    python scripts/bench/streaming.py --resolution 64 --size 96

On Table 1's DustSph, simulated, and on sphere-merl where --captures has it. "Every texel" searches n and N on
all texels from the first model on. Finished runs stay in target/bench/streaming; delete a file to repeat it.

Columns: n, N found; seconds of all cores and peak memory; novel-light NRMS in %, and every texel's over the
subset's.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import scenes
import shared
from shared import results

SIMULATED, MEASURED = "DustSph", "sphere-merl"
EVERY = 1 << 30
"""More texels than any atlas has."""
PLENTY = 16.0
"""GB for all of their responses at once."""


def one(capture: Path, material: Path, resolution: int, every: bool) -> None:
    """Reconstruct in this process and print the summary as JSON: `explore_texels` is no CLI option."""
    from swatchwork.workflow import ReconstructOptions, SolveOptions, reconstruct_folder

    options = ReconstructOptions(resolution=resolution)
    if every:
        solve = SolveOptions(explore_texels=EVERY)
        options = ReconstructOptions(resolution=resolution, texels=EVERY, solve=solve, memory=PLENTY)
    print(json.dumps(reconstruct_folder(capture, material, options).as_dict()))


def measure(capture: Path, resolution: int, every: bool, work: Path) -> dict[str, Any]:
    command = [sys.executable, __file__, "--one", str(capture), "--material", str(work / "material")]
    command += ["--resolution", str(resolution), *(["--every"] if every else [])]
    shared.begin_anew(work / "material")
    commit = results.commit()
    summary, cost = shared.run(command)
    evaluation = shared.novel_light(work / "material", capture / "test", work / "renders")
    found = {"capture": capture.name, "every": every, "command": shared.as_typed(command), "commit": commit}
    return found | {"cost": asdict(cost), "summary": summary, "evaluation": evaluation}


HEAD = ["capture", "texels of the search", "n, N", "cpu s", "MB", "NRMS", "every / subset"]


def rows(subset: dict[str, Any], every: dict[str, Any]) -> list[list[str]]:
    cells = []
    for found, who in ((subset, "subset"), (every, "every")):
        summary, cost = found["summary"], found["cost"]
        nrms = found["evaluation"]["nrms"]
        ratio = f"{nrms / subset['evaluation']['nrms']:.3f}" if found is every else ""
        of = [f"{summary['n']}, {summary['N']}", f"{cost['cpu_s']:.0f}", f"{cost['peak_mb']:.0f}"]
        cells.append([found["capture"], who, *of, f"{100 * nrms:.2f}", ratio])
    return cells


def pairs(done: list[dict[str, Any]]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Subset and every texel of each capture."""
    return list(zip(done[::2], done[1::2], strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, help="folder of capture folders")
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--size", type=int, default=512, help="pixels along a simulated image's side")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--every", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--material", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        one(args.one, args.material, args.resolution, args.every)
        return
    captures = [scenes.capture_of(SIMULATED, args.size)]
    measured = args.captures / MEASURED if args.captures else None
    if measured is not None and (measured / "transforms.json").exists():
        captures.append(Path(os.path.abspath(measured)))
    else:
        print(f"skipped: there is no capture {MEASURED} in --captures")
    done = []
    for capture in captures:
        for every in (False, True):
            name = f"{capture.name}-{args.resolution}-{'every' if every else 'subset'}"
            work = shared.BENCH / "streaming" / name
            done.append(
                shared.kept(
                    work.with_suffix(".json"),
                    lambda capture=capture, every=every, work=work: measure(
                        capture, args.resolution, every, work
                    ),
                )
            )
    print(results.table(HEAD, [row for pair in pairs(done) for row in rows(*pair)]))
    shared.write(args.json, {"resolution": args.resolution, "runs": done})


if __name__ == "__main__":
    main()

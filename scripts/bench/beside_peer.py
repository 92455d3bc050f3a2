# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Swatchwork and the outside peer (peer.py) on the same captures, one after the other.

    python scripts/bench/beside_peer.py --captures ../shared/captures --json target/bench/peer.json

`swatchwork reconstruct` with its defaults, a process of its own; then the peer, scored at ours x 1, x 5, x 10
and x 20, or until it has converged: twice the time lowers its misfit to the photographs by less than 1 %.
Whoever fits it cannot see the error under a novel light, which may rise meanwhile; the comparison takes the
lowest of its checkpoints. Finished captures stay in target/bench/peer; delete a file to repeat it.

Columns: seconds, peak memory in MB, the peer's misfit to the photographs and the novel-light NRMS in %, and
ours over the peer's.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import shared
from shared import results

NAMES = ("sphere-merl", "igea-merl")
PEER = shared.HERE / "peer.py"


def missing() -> str | None:
    """What the peer lacks on this machine, if anything; said before hours of work."""
    asked = subprocess.run([sys.executable, str(PEER), "--help"], capture_output=True, text=True, check=False)
    return None if asked.returncode == 0 else asked.stderr.strip()


TIMES = (1, 5, 10, 20)
"""Checkpoints, in units of our time."""


def measure(capture: Path, work: Path) -> dict[str, Any]:
    """Ours, then the peer's curve."""
    ours = shared.reconstruct(capture, work / "material")
    ours["evaluation"] = shared.novel_light(work / "material", capture / "test", work / "renders")
    seconds = ours["cost"]["wall_s"]
    file = work / "peer.json"
    *at, last = (f"{times * seconds:.1f}" for times in TIMES)
    command = [sys.executable, str(PEER), str(capture), "--at", *at, "--seconds", last, "--until-converged"]
    command += ["--renders", str(work / "peer"), "--json", str(file)]
    shared.follow(command)
    return {"capture": capture.name, "ours": ours, "peer": json.loads(file.read_text(encoding="utf-8"))}


HEAD = ["capture", "who", "s", "MB", "misfit", "NRMS", "ours / theirs"]


def rows(found: dict[str, Any]) -> list[list[str]]:
    """Ours, then the peer at each checkpoint."""
    ours, curve = found["ours"], found["peer"]["curve"]
    nrms = ours["evaluation"]["nrms"]
    mine = [f"{ours['cost']['wall_s']:.0f}", f"{ours['cost']['peak_mb']:.0f}", "", f"{100 * nrms:.2f}"]
    cells = [[found["capture"], "swatchwork", *mine, ""]]
    for point in curve:
        last = ", converged" if point is curve[-1] and found["peer"]["converged"] else ""
        theirs = [f"{point['seconds']:.0f}", f"{point['peak_mb']:.0f}"]
        theirs += [f"{100 * point[error]:.2f}" for error in ("misfit", "nrms")]
        cells.append([found["capture"], f"peer{last}", *theirs, f"{nrms / point['nrms']:.2f}"])
    return cells


def arrived(found: dict[str, Any]) -> int:
    """The peer's first checkpoint whose misfit is within 1 % of the last one's."""
    curve = found["peer"]["curve"]
    return next(i for i, point in enumerate(curve) if point["misfit"] <= 1.01 * curve[-1]["misfit"])


def ratios(found: dict[str, Any]) -> tuple[float, float]:
    """Ours over the peer's: NRMS over its lowest, and time over that of its convergence.

    It converged before the checkpoint at which it had arrived and after the one before, whose time bounds the
    ratio from above. Where it had arrived at the first, the ratio is larger than the one returned.
    """
    curve = found["peer"]["curve"]
    return (
        found["ours"]["evaluation"]["nrms"] / min(point["nrms"] for point in curve),
        found["ours"]["cost"]["wall_s"] / curve[max(arrived(found) - 1, 0)]["seconds"],
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, required=True, help="folder of capture folders")
    parser.add_argument("--only", nargs="+", default=NAMES)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    done = []
    lacks = missing()
    for name in args.only:
        capture, work = Path(os.path.abspath(args.captures / name)), shared.BENCH / "peer" / name
        if not (capture / "transforms.json").exists() and not work.with_suffix(".json").exists():
            print(f"skipped: there is no capture {args.captures / name}")
            continue
        if lacks and not work.with_suffix(".json").exists():
            print(f"skipped: {lacks}")
            continue
        done.append(
            shared.kept(
                work.with_suffix(".json"),
                lambda capture=capture, work=work: measure(capture, work),
            )
        )
    if not done:
        return
    print(results.table(HEAD, [row for found in done for row in rows(found)]))
    shared.write(args.json, {"captures": done})


if __name__ == "__main__":
    main()

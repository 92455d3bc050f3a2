# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a reconstruction costs beside the same at an earlier commit, in one run.

    python scripts/bench/beside_commit.py 78770a3 --json target/bench/beside_commit.json

The earlier Python package is taken out of git into target/bench/before; it must work with the core that is
built here. Both reconstruct the same clean simulated captures (1 % noise) in turn, the order changing each
time. *cpu*, *wall*, *peak*: now over before, of the least of the rounds for times and the median for memory.
*same*: whether the blends have the same bits.
"""

from __future__ import annotations

import argparse
import io
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import scenes
import shared
from shared import results

PACKAGE = results.ROOT / "python"
RUN = "import sys; from swatchwork.cli import main; sys.exit(main())"
SCENES = ("DustSph", "Mouse")
HEAD = ["capture", "rounds", "cpu before, s", "cpu", "wall", "peak before, MB", "peak", "n, N", "same"]


def package_at(commit: str) -> Path:
    """The Python package of a commit, with the core and the viewer's script that are built here."""
    folder = shared.BENCH / "before" / commit
    shutil.rmtree(folder, ignore_errors=True)
    command = ["git", "-C", str(results.ROOT), "archive", commit, "python"]
    made = subprocess.run(command, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(made)) as archive:
        archive.extractall(folder, filter="data")
    inside = folder / "python" / "swatchwork"
    for built in (PACKAGE / "swatchwork").glob("_native*.so"):
        shutil.copy(built, inside)
    shutil.copytree(PACKAGE / "swatchwork" / "viewer" / "bundle", inside / "viewer" / "bundle")
    return folder / "python"


def reconstruct(package: Path, capture: Path, output: Path, options: list[str]) -> dict[str, Any]:
    """One run of a package's command line."""
    shutil.rmtree(output, ignore_errors=True)
    command = [sys.executable, "-c", RUN, "reconstruct", str(capture), "-o", str(output), *options, "--json"]
    found, cost = shared.run(command, {"PYTHONPATH": os.fspath(package)})
    return {"n": found["n"], "N": found["N"], "cpu": cost.cpu_s, "wall": cost.wall_s, "peak": cost.peak_mb}


def measure(name: str, before: Path, rounds: int, size: int, resolution: int) -> dict[str, Any]:
    """A row of one capture."""
    capture, options = scenes.capture_of(name, size), ["--resolution", str(resolution)]
    packages = {"before": before, "now": PACKAGE}
    runs: dict[str, list[dict[str, Any]]] = {"before": [], "now": []}
    folders = {which: shared.BENCH / "beside" / which for which in packages}
    for turn in range(rounds):
        for which in sorted(packages, reverse=bool(turn % 2)):
            runs[which].append(reconstruct(packages[which], capture, folders[which], options))
    same = (folders["before"] / "blend.exr").read_bytes() == (folders["now"] / "blend.exr").read_bytes()
    row: dict[str, Any] = {"capture": name, "rounds": rounds, "runs": runs, "same": same}
    for key, middle in (("cpu", np.min), ("wall", np.min), ("peak", np.median)):
        old, new = (float(middle([run[key] for run in runs[which]])) for which in ("before", "now"))
        row |= {f"{key}_before": old, key: new / old}
    return row


def cells(row: dict[str, Any]) -> list[str]:
    last = row["runs"]["now"][-1]
    return [
        row["capture"],
        str(row["rounds"]),
        f"{row['cpu_before']:.1f}",
        f"{row['cpu']:.3f}",
        f"{row['wall']:.3f}",
        f"{row['peak_before']:.0f}",
        f"{row['peak']:.3f}",
        f"{last['n']}, {last['N']}",
        "yes" if row["same"] else "no",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("commit", help="the earlier one")
    parser.add_argument("--rows", nargs="+", choices=scenes.ROWS, default=SCENES, help="of Table 1")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--size", type=int, default=512, help="pixels along the photographs")
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    before, rows = package_at(args.commit), []
    for name in args.rows:
        rows.append(measure(name, before, args.rounds, args.size, args.resolution))
        shared.write(args.json, {"before": args.commit, "rows": rows})
        print(results.table(HEAD, [cells(row) for row in rows]), flush=True)


if __name__ == "__main__":
    main()

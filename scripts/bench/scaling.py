# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How cost grows with texels M, views k, materials N and blended n: log-log slopes, total and by stage.

    python scripts/bench/scaling.py --json target/bench/scaling.json
    python scripts/bench/scaling.py --series M k --size 128 --resolutions 64 128 256

Each point is `swatchwork reconstruct`, a process of its own, on the capture of Table 1's Mouse (k=26, n=3,
N=9). n and N are given, not searched, so that a series varies in one number alone: n=3, N=9, all views and a
512 x 512 atlas but for what varies. Finished points stay in target/bench/scaling; delete a file to repeat it.

Columns: what varies; wall and cpu seconds; peak memory in MB; the stages' seconds. Below, least-squares
slopes of the logarithms; `last` is the slope between the two largest points.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import scenes
import shared
import table1
from shared import results

SERIES = ("M", "k", "N", "n")
CAPTURE, RESOLUTION = "Mouse", 512
RESOLUTIONS = (128, 256, 512, 1024, 2048)
VIEWS = (3, 6, 13, 26)
MATERIALS = (4, 6, 9, 12, 18)
BLENDED = (1, 2, 3, 4, 5)
GIVEN = {"n": 3, "N": 9}


def points(series: str, resolutions: list[int], resolution: int) -> list[tuple[int, list[str]]]:
    """What varies, and the options of each point."""
    n, N = str(GIVEN["n"]), str(GIVEN["N"])
    if series == "M":
        return [(r, ["--resolution", str(r), "--n", n, "--N", N]) for r in resolutions]
    fixed = ["--resolution", str(resolution)]
    if series == "k":
        return [(k, [*fixed, "--views", str(k), "--n", n, "--N", N]) for k in VIEWS]
    if series == "N":
        return [(count, [*fixed, "--n", n, "--N", str(count)]) for count in MATERIALS]
    return [(blended, [*fixed, "--n", str(blended), "--N", N]) for blended in BLENDED]


def measure(options: list[str], size: int, work: Path) -> dict[str, Any]:
    return shared.reconstruct(scenes.capture_of(CAPTURE, size), work, *options)


def amount(series: str, found: dict[str, Any]) -> float:
    """What the series varies, as a count: texels for M."""
    summary = found["summary"]
    return float({"M": summary["texels"], "k": summary["views"]}.get(series, summary.get(series)))


def costs(found: dict[str, Any]) -> dict[str, float]:
    """Total and stages, in seconds, and peak memory."""
    cost = found["cost"]
    total = {"wall": cost["wall_s"], "cpu": cost["cpu_s"], "MB": cost["peak_mb"]}
    return total | table1.stage_seconds(found["summary"])


def slopes(series: str, done: list[dict[str, Any]]) -> dict[str, tuple[float, float]]:
    """Of each cost: by least squares, and between the last two points."""
    x = [amount(series, found) for found in done]
    of = [costs(found) for found in done]
    names = dict.fromkeys(name for each in of for name in each)
    y = {name: [each.get(name, 0.0) for each in of] for name in names}
    return {name: (shared.slope(x, y[name]), shared.slope(x[-2:], y[name][-2:])) for name in names}


def table(series: str, done: list[dict[str, Any]], *, markdown: bool = False) -> str:
    slope = slopes(series, done)
    head = ["M = texels" if series == "M" else series, *slope]
    rows = [
        [f"{amount(series, found):.0f}", *(f"{costs(found).get(name, 0):.3g}" for name in slope)]
        for found in done
    ]
    rows.append(["slope", *(f"{slope[name][0]:.2f}" for name in slope)])
    rows.append(["last", *(f"{slope[name][1]:.2f}" for name in slope)])
    return results.table(head, rows, markdown=markdown)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--series", nargs="+", choices=SERIES, default=SERIES)
    parser.add_argument("--resolutions", type=int, nargs="+", default=RESOLUTIONS, help="of the series M")
    parser.add_argument("--resolution", type=int, default=RESOLUTION, help="of the other series")
    parser.add_argument("--size", type=int, default=512, help="pixels along an image's side")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    found: dict[str, list[dict[str, Any]]] = {}
    for series in args.series:
        found[series] = []
        for value, options in points(series, args.resolutions, args.resolution):
            at = "" if series == "M" else f"-{args.resolution}"
            work = shared.BENCH / "scaling" / f"{series}{value}{at}-{args.size}"
            found[series].append(
                shared.kept(
                    work.with_suffix(".json"),
                    lambda options=options, work=work: measure(options, args.size, work),
                )
            )
        print(table(series, found[series]), end="\n\n")
    shared.write(args.json, {"capture": CAPTURE, "size": args.size, "series": found})


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The eight rows of the paper's Table 1 as simulated captures of the same k, n and N (scenes.py).

    python scripts/bench/table1.py --json target/bench/table1.json
    python scripts/bench/table1.py --rows Mouse Pig --resolution 256 --size 256

Each row: `swatchwork reconstruct`, a process of its own, from EXR files to material folder; n and N are found
by the search. Then novel-light NRMS on the capture's test/. Finished rows stay in target/bench/table1; delete
a file to repeat its row.

Columns: pixels, along an image's side; paper, minutes on 8 Xeon cores; wall and cpu, minutes here; MB, peak
memory of the process; n, N found beside the truth's; unseen, % of texels in no photograph; NRMS in % and
PSNR-L in dB, novel light; then the stages' seconds.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

import scenes
import shared
from shared import results


def measure(row: scenes.Row, resolution: int, size: int, work: Path) -> dict[str, Any]:
    """Reconstruct, relight, evaluate."""
    capture = scenes.capture_of(row.name, size)
    found = shared.reconstruct(capture, work / "material", "--resolution", str(resolution))
    evaluation = shared.novel_light(work / "material", capture / "test", work / "renders")
    return {"row": asdict(row), "size": size} | found | {"evaluation": evaluation}


def cells(found: dict[str, Any], names: list[str]) -> list[str]:
    row, cost, summary = found["row"], found["cost"], found["summary"]
    seconds = stage_seconds(summary)
    return [
        row["name"],
        row["shape"],
        str(found["size"]),
        str(row["k"]),
        f"{summary['n']}, {summary['N']} ({row['n']}, {row['N']})",
        str(row["paper_minutes"]),
        f"{cost['wall_s'] / 60:.1f}",
        f"{cost['cpu_s'] / 60:.1f}",
        f"{cost['peak_mb']:.0f}",
        f"{100 * summary['unseen'] / summary['texels']:.1f}",
        f"{100 * found['evaluation']['nrms']:.2f}",
        f"{found['evaluation']['psnr_l']:.1f}",
        *(f"{seconds.get(name, 0):.0f}" for name in names),
    ]


def stage_seconds(summary: dict[str, Any]) -> dict[str, float]:
    """Seconds by stage, in order."""
    return {stage["name"]: stage["seconds"] for stage in summary["stages"]}


def head(names: list[str]) -> list[str]:
    return [
        "object",
        "shape",
        "pixels",
        "k",
        "n, N (true)",
        "paper",
        "wall",
        "cpu",
        "MB",
        "unseen",
        "NRMS",
        "PSNR-L",
        *names,
    ]


def stage_names(rows: list[dict[str, Any]]) -> list[str]:
    """Every stage that a row has, in order."""
    return list(dict.fromkeys(name for found in rows for name in stage_seconds(found["summary"])))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", nargs="+", choices=scenes.ROWS, default=list(scenes.ROWS))
    parser.add_argument("--resolution", type=int, default=1024, help="side of the atlas, in texels")
    parser.add_argument("--size", type=int, help="pixels along an image's side; by default the row's own")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    done = []
    for name in args.rows:
        row = scenes.ROWS[name]
        size = args.size or row.size
        work = shared.BENCH / "table1" / f"{name}-{args.resolution}-{size}"
        done.append(
            shared.kept(
                work.with_suffix(".json"),
                lambda row=row, size=size, work=work: measure(row, args.resolution, size, work),
            )
        )
    names = stage_names(done)
    print(results.table(head(names), [cells(found, names) for found in done]))
    shared.write(args.json, {"resolution": args.resolution, "rows": done})


if __name__ == "__main__":
    main()

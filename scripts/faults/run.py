# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Every fault in turn on the command line, forked; what was found goes to docs/reliability.md.

    python scripts/faults/run.py --json target/faults/faults.json --page docs/reliability.md
    python scripts/faults/run.py --only kills --kills 5

Finished faults are kept in target/faults, by a digest of the package and of these scripts: other code begins
anew. The exit code is 1 where a row neither holds nor is a known limit.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import disk
import kills
import memory
import others
import outputs
import page
import shared
import stops
import swap
import writers
from shared import Row, results

EXPERIMENTS: dict[str, Callable[[], dict[str, Any]]] = {
    "kills": kills.measure,
    "swap": swap.measure,
    "writers": writers.measure,
    "stops": stops.measure,
    "disk": disk.measure,
    "outputs": outputs.measure,
    "memory": memory.measure,
    "others": others.measure,
}


def kept(name: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The figures of a fault; made and written first where they are not there."""
    file = shared.FAULTS / "found" / f"{name}.json"
    if not file.exists():
        print(f"{name} ...", file=sys.stderr, flush=True)
        start = time.perf_counter()
        figures = make()
        figures["seconds"] = time.perf_counter() - start
        file.parent.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(".part")
        part.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
        part.replace(file)
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=EXPERIMENTS, metavar="NAME", help=", ".join(EXPERIMENTS))
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--page", type=Path)
    args = parser.parse_args()
    found = {}
    for name in args.only or EXPERIMENTS:
        make = EXPERIMENTS[name]
        found[name] = kept(name, (lambda: kills.measure(args.kills)) if name == "kills" else make)
        for row in found[name]["rows"]:
            print(f"{Row(**row).verdict}  {row['fault']} ({row['times']}): {row['found']}")
    results.write(args.json, {"faults": found})
    if args.page:
        page.write(args.page, found)
    return (
        0 if all(row["holds"] or row["limit"] for figures in found.values() for row in figures["rows"]) else 1
    )


if __name__ == "__main__":
    sys.exit(main())

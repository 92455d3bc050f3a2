# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The part "Faults" of docs/reliability.md, from the figures."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import shared
from shared import Row, results

sys.path.append(str(shared.HERE.parent))
import reliability

NOTES = (shared.HERE / "notes.md").read_text(encoding="utf-8")


def write(file: Path, found: dict[str, Any]) -> None:
    """Put the part on the page."""
    lines = ["| fault | times | found afterwards | verdict |", "|---|---|---|---|"]
    for figures in found.values():
        lines += [
            f"| {row['fault']} | {row['times']} | {' '.join(row['found'].split())} | {Row(**row).verdict} |"
            for row in figures["rows"]
        ]
    names = ", ".join(f"`{name}`" for name in found)
    # What is kept was found by this very code, whichever commit had it first.
    head = (
        f"## Faults\n\nMade by `make faults` (`{results.command()}`), each by the command line in a process "
        "of its own, forked from one that has imported the package; one alone: "
        f"`python scripts/faults/run.py --only NAME`, where NAME is {names}. All rows are of the code of "
        f"commit {results.COMMIT} (digest of package and scripts: {shared.code_digest()})."
    )
    reliability.put(file, "faults", "\n".join([head, "", *lines, "", NOTES.strip()]))

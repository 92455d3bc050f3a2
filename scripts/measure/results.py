# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What the measurements here share: figures with the command and the commit they come from, and tables."""

from __future__ import annotations

import json
import math
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

Verdict = tuple[str, float, float, str]
"""What is bounded, the figure, its bound, and the unit."""

ROOT = Path(__file__).resolve().parents[2]


def commit() -> str:
    """The commit at run time; "+" where the package's sources differ from it."""

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False
        ).stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", "--", "python", "crates")
    return (git("rev-parse", "--short", "HEAD") or "unknown") + ("+" if changed else "")


COMMIT = commit()
"""When the script began, for later ones may come while it runs."""


def command() -> str:
    """The command line that runs, as one would type it in the checkout."""
    script = Path(sys.argv[0]).resolve()
    name = script.relative_to(ROOT).as_posix() if script.is_relative_to(ROOT) else str(script)
    return shlex.join(["python", name, *map(as_seen_from_root, sys.argv[1:])])


def as_seen_from_root(word: str) -> str:
    """A word of a command line; an absolute path becomes one from the checkout."""
    return os.path.relpath(word, ROOT) if os.path.isabs(word) else word


def write(path: Path | None, figures: dict[str, Any]) -> None:
    """Write figures as JSON with where they come from; nothing where no path was asked for."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    source = {"command": command(), "commit": COMMIT, "date": time.strftime("%Y-%m-%d")}
    path.write_text(json.dumps(source | figures, indent=1) + "\n", encoding="utf-8")


Sections = Mapping[str, tuple[str, Callable[[dict[str, Any]], str]]]
"""For each file of figures, without its .json: the section's title, and what writes it."""


def write_page(path: Path, head: str, sections: Sections, folder: Path) -> None:
    """Write a page; a section without figures in ``folder`` stays as it is on the page that is there.

    So a part can be measured anew without the hours of the others: each names its own commit and date.
    """
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    there = {part.split("\n", 1)[0]: part.rstrip() for part in old.split("\n## ")[1:]}
    parts = [head.rstrip() + "\n"]
    for name, (title, section) in sections.items():
        file = folder / f"{name}.json"
        if file.exists():
            parts.append(f"## {title}\n\n{section(json.loads(file.read_text(encoding='utf-8'))).strip()}\n")
        elif title in there:
            parts.append(f"## {there[title]}\n")
            print(f"{title}: as it was, for there is no {file.name}")
        else:
            parts.append(f"## {title}\n\nNot measured yet.\n")
    path.write_text("\n".join(parts), encoding="utf-8")
    print(f"wrote {path}")


def table(head: Sequence[str], rows: Sequence[Sequence[Any]], *, markdown: bool = False) -> str:
    """Rows under a head, aligned: the first column to the left, the others to the right."""
    cells = [[str(c) for c in row] for row in (head, *rows)]
    width = [max(2, *(len(row[i]) for row in cells)) for i in range(len(head))]

    def line(row: Sequence[str]) -> str:
        aligned = [c.rjust(w) if i else c.ljust(w) for i, (c, w) in enumerate(zip(row, width, strict=True))]
        return "| " + " | ".join(aligned) + " |" if markdown else "  ".join(aligned)

    lines = [line(row) for row in cells]
    if markdown:
        rule = ["-" * w if i == 0 else "-" * (w - 1) + ":" for i, w in enumerate(width)]
        lines.insert(1, "| " + " | ".join(rule) + " |")
    return "\n".join(lines)


def verdicts(found: Sequence[Verdict]) -> str:
    """A table of bounds: met, or missed."""
    rows = []
    for what, value, bound, unit in found:
        shown, limit = (100 * value, 100 * bound) if unit == "%" else (value, bound)
        met = math.isfinite(value) and value <= bound
        rows.append([what, f"{shown:.3g} {unit}", f"{limit:.3g} {unit}", "met" if met else "**missed**"])
    return table(["bound", "found", "at most", ""], rows, markdown=True)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""docs/reliability.md has a part for each script that measures; each writes its own and leaves the rest."""

from __future__ import annotations

from pathlib import Path

HEAD = "# Reliability\n\nWhat was done to the package to break it, and what was found afterwards.\n"


def put(page: Path, name: str, text: str) -> None:
    """Put ``text`` between ``<!-- name -->`` and ``<!-- /name -->``; a new part comes at the page's end.

    Raises:
        ValueError: the page has the part's beginning without its end.
    """
    old = page.read_text(encoding="utf-8") if page.exists() else HEAD
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    part = f"{begin}\n{text.strip()}\n{end}"
    before, there, rest = old.partition(begin)
    if there and end not in rest:
        raise ValueError(f"{page}: has {begin} without {end}")
    new = before + part + rest.partition(end)[2] if there else f"{old.rstrip()}\n\n{part}\n"
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(new, encoding="utf-8")

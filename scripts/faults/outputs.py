# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Outputs that are something else than a folder of ours, or may not be written."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import forking
import shared
from disk import intact, tmpfs
from shared import Row

NOT_AS_ROOT = ["setpriv", "--bounding-set", "-dac_override,-dac_read_search", "--"]
"""Root without its right to write what it may not."""


def measure() -> dict[str, Any]:
    return shared.rows_of([*_in_the_way(), *_read_only()])


def _in_the_way() -> list[Row]:
    """Outputs that are something else than a folder of ours."""

    def file(folder: Path) -> None:
        (folder / "out").write_text("dear")

    def link(folder: Path) -> None:
        shared.with_older(folder).rename(folder / "target")
        (folder / "out").symlink_to("target")

    def dangling(folder: Path) -> None:
        (folder / "out").symlink_to("target")

    def parent_is_a_file(folder: Path) -> None:
        (folder / "deep").write_text("dear")

    cases: list[tuple[str, Callable[[Path], None], str, int, str]] = [
        ("OUT is a file", file, "out", 2, "exists and is not a material folder"),
        ("OUT's parent is a file", parent_is_a_file, "deep/out", 2, "cannot be written"),
        ("OUT's parents are missing", lambda folder: None, "a/b/out", 0, ""),
        ("OUT is a link to a material", link, "out", 0, ""),
        ("OUT is a link to nothing", dangling, "out", 0, ""),
    ]
    rows = []
    for name, prepare, output, wanted, words in cases:
        folder = shared.emptied("disk")
        prepare(folder)
        arguments = forking.reconstruct(folder / output, options=shared.OTHERS)
        code, said = forking.run(arguments)
        wrong = []
        if wanted:
            bad = forking.one_line(code, said, wanted, words)
            wrong += [bad] if bad else []
            found = "exit 2 and one line; nothing is touched"
            if any(path.is_file() and path.read_text() != "dear" for path in folder.rglob("*")):
                wrong.append("something was touched")
        else:
            found = "the material is there"
            if code or not (folder / output / "svbrdf.json").is_file():
                wrong.append(f"exit code {code}: {said}")
            if "link" in name:
                found = "the material is where the link points; the link stays"
                if not (folder / "out").is_symlink() or not (folder / "target" / "svbrdf.json").is_file():
                    wrong.append("the link is gone")
        rows.append(Row(name, 1, "; ".join(wrong) or found, not wrong))
    return rows


def _read_only() -> list[Row]:
    rows = []
    for name, user in (("a folder of mode 0555, without root's rights", True), ("a read-only disk", False)):
        if os.geteuid() != 0:
            continue
        with tmpfs(32_000) as disk:
            output = shared.with_older(disk)
            if user:
                os.chmod(disk, 0o555)
            else:
                subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
            command = [*(NOT_AS_ROOT if user else []), *shared.child(), *forking.reconstruct(output)]
            code, said = shared.ran(command)
            bad = forking.one_line(
                code, said, 2, "Permission denied" if user else "Read-only file system", "out"
            )
            wrong = ([bad] if bad else []) + intact(output, name, set())
            found = "; ".join(wrong) or "exit 2 and one line before any work, OUT the older material"
            rows.append(Row(name, 1, found, not wrong))
    return rows

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Every command that writes, broken off at its steps: each file is the older one or the new one, never half.

By kill -9, by Ctrl-C, by SIGTERM, and by a disk that is full from that step on. What becomes visible as one
folder must be the older or the new one in all its files; after all but kill -9 nothing temporary may be left.
Then the same command once more: it must end with the new result, and nothing beside.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import shared
from shared import Row
from stepping import Ended, Fault, fresh_copy, stepped, undisturbed

from swatchwork.cli import main

FAULTS: dict[Fault, tuple[str, int, int]] = {
    "kill": ("kill -9", -9, 10**9),
    "interrupt": ("Ctrl-C", 130, 2),
    "terminate": ("SIGTERM", 143, 1),
    "full": ("a disk full from there on", 2, 2),
}
"""In words, the exit code, and the steps that are tried; kill -9 takes one run for all of them."""

TEMPORARY = re.compile(r"\.(unfinished|replaced)")
TIMES = re.compile(rb"\d+(\.\d+)? (s|ms|MB)\b")
"""In pages: what differs from run to run."""


@dataclass(frozen=True)
class Writer:
    """A command that replaces what an earlier one wrote."""

    name: str
    before: tuple[str, ...]
    """Arguments of the earlier one; OUT stands for the output, M for the material, C for the capture."""
    after: tuple[str, ...]
    together: bool = True
    """Whether all its files appear at once."""


def exporting(target: str, output: str = "OUT/o") -> Writer:
    """An export in place of an older material's."""
    options = ("--format", target, "-o", output, "-q")
    name = f"export --format {target}{' (one file)' if output != 'OUT/o' else ''}"
    return Writer(name, ("export", "L", *options), ("export", "M", *options))


RELIGHT = ("relight", "M", "--cameras", "C/test/transforms.json", "-o", "OUT/o", "--samples", "1", "-q")
LIGHT = ("--environment", "C/env.exr", "--convention", "blender")
PLAN = (
    "plan",
    "-o",
    "OUT/o",
    "--shape",
    "sphere",
    *LIGHT,
    "--candidates",
    "20",
    "--size",
    "16",
    "-q",
    "--views",
)
VIEW = ("-o", "OUT/o.html", "--no-open", "-q")
WRITERS = (
    Writer(
        "relight",
        RELIGHT,
        (*RELIGHT, "--environment-rotation", "z:90", "--turntable", "2"),
        together=False,
    ),
    exporting("gltf", "OUT/o.glb"),
    exporting("maps"),
    Writer("view", ("view", "L", *VIEW), ("view", "M", *VIEW)),
    Writer("plan", (*PLAN, "2"), (*PLAN, "3"), together=False),
)


def measure() -> dict[str, Any]:
    shared.whole(), shared.older()
    import swatchwork.workflow  # noqa: F401  Once, not in each of the forked processes.

    rows = [row for writer in WRITERS for row in broken(writer)]
    return shared.rows_of(rows)


def broken(writer: Writer) -> list[Row]:
    """A row for each fault."""
    root = shared.emptied("writers")
    work, kept = root / "work", root / "before"

    def words(arguments: tuple[str, ...]) -> list[str]:
        places = {"M": shared.whole(), "L": shared.older(), "C": shared.capture(), "OUT": work}
        parts = [(word, *word.partition("/")) for word in arguments]
        return [f"{places[h]}{s}{rest}" if h in places else word for word, h, s, rest in parts]

    before = undisturbed(lambda: main(words(writer.before)), lambda: fresh_copy(None, work), work)
    assert before.code == 0, before.said
    fresh_copy(work, kept)

    def action() -> int:
        return main(words(writer.after))

    after = undisturbed(action, lambda: fresh_copy(kept, work), work)
    assert after.code == 0, after.said
    rows = []
    for fault, (name, code, most) in FAULTS.items():
        wrong: list[str] = []
        all_ended = list(stepped(action, lambda: fresh_copy(kept, work), work, fault, most))
        for ended in all_ended:
            wrong += [f"step {ended.step}: {w}" for w in faulty(ended, writer, before, after, fault, code)]
        # What the one in the middle left is gone on from.
        put(all_ended[len(all_ended) // 2].files, work)
        again = undisturbed(action, lambda: None, work)
        if again.code or plain(again.files) != plain(after.files):
            wrong.append(f"the same command then ends otherwise: {again.said[-200:]}")
        found = "; ".join(wrong[:3]) or "older or new, nothing half; the same command then ends with the new"
        rows.append(Row(f"`{writer.name}`: {name} at a step", len(all_ended), found, not wrong))
    return rows


def put(files: dict[str, bytes], work: Path) -> None:
    """Make a folder of these files."""
    fresh_copy(None, work)
    for name, data in files.items():
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        (work / name).write_bytes(data)


def faulty(ended: Ended, writer: Writer, before: Ended, after: Ended, fault: Fault, code: int) -> list[str]:
    """What is not as it must be, in words."""
    wrong = []
    # The last steps remove what is temporary, and the result is there already.
    if ended.code not in (code, 0):
        wrong.append(f"exit code {ended.code}: {ended.said[-300:]}")
    lines = ended.said.strip().splitlines()
    if ended.code > 0 and (len(lines) != 1 or "Traceback" in ended.said):
        wrong.append(f"says {len(lines)} lines: {ended.said[-300:]}")
    visible = {name: data for name, data in plain(ended.files).items() if not TEMPORARY.search(name)}
    if fault != "kill" and len(visible) != len(ended.files):
        wrong.append(f"leaves {sorted(set(ended.files) - set(visible))[0]}")
    old, new = plain(before.files), plain(after.files)
    if writer.together:
        if visible not in (old, new):
            wrong.append(f"is neither the older nor the new: {differs(visible, old, new)}")
    else:
        half = [name for name, data in visible.items() if data not in (old.get(name), new.get(name))]
        wrong += [f"{name} is neither the older nor the new" for name in half]
    return wrong


def differs(visible: dict[str, bytes], old: dict[str, bytes], new: dict[str, bytes]) -> str:
    """Names that are in neither as they are here."""
    names = set(visible) | set(old)
    of_old = [n for n in names if visible.get(n) != old.get(n)]
    of_new = [n for n in set(visible) | set(new) if visible.get(n) != new.get(n)]
    named = ", ".join(sorted(of_old)[:2])
    return f"{len(of_old)} files are not the older's ({named}), {len(of_new)} not the new's"


def plain(files: dict[str, bytes]) -> dict[str, bytes]:
    """Without what tells the time."""
    return {n: TIMES.sub(b"", d) if Path(n).suffix in (".html", ".json") else d for n, d in files.items()}

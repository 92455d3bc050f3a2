# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Full disks (a tmpfs, as root), and a limit on the size of files."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import forking
import shared
from same_bits import contents, differing
from shared import Row

ROOM_KB = ((False, 60), (False, 700), (True, 60), (True, 300))
"""Left on the disk; and whether all checkpoints are there already, so that the folder is what fills it."""


def measure() -> dict[str, Any]:
    whole = {name: of for name, of in contents(shared.whole()).items() if name != "viewer.html"}
    rows = [_full(whole), _writers_on_a_full_disk()] if os.geteuid() == 0 else []
    return shared.rows_of([*rows, _file_size(whole)])


@contextmanager
def tmpfs(size_kb: int) -> Iterator[Path]:
    """A disk of its own."""
    place = shared.emptied("disk")
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "none", str(place)], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def _full(whole: dict[str, str]) -> Row:
    wrong, places = [], set()
    for ready, room in ROOM_KB:
        when = f"{room} KB{' for the folder' if ready else ''}"
        with tmpfs(64_000) as disk:
            work = disk / "work"
            work.mkdir()
            output = forking.ready(work) if ready else shared.with_older(work)
            filler = disk / "filler"
            free = shutil.disk_usage(disk).free
            with filler.open("wb") as stream:
                stream.write(b"\0" * (free - room * 1024))
            code, said = forking.run(forking.reconstruct(output))
            bad = forking.one_line(code, said, 2, "No space left on device", str(output))
            wrong += [f"{when}: {bad}"] if bad else []
            places.add("OUT.partial" if "out.partial" in said else "OUT")
            wrong += intact(output, when, {"out.partial"})
            filler.unlink()
            code, said = forking.run(forking.reconstruct(output))
            if code or differing(output, whole) or shared.left_beside(output):
                wrong.append(f"{when}: with room the same command: {code} {said}")
    if places != {"OUT.partial", "OUT"}:
        wrong.append(f"the levels only reach {places}")
    found = "; ".join(wrong[:3]) or (
        "exit 2 and one line with the place, OUT the older material, at most OUT.partial beside it; with "
        "room again, identical materials"
    )
    levels = "60 or 700 KB left for checkpoints, 60 or 300 KB for the folder"
    return Row(f"a disk with {levels}, `reconstruct`", len(ROOM_KB), found, not wrong)


def _file_size(whole: dict[str, str]) -> Row:
    output = forking.ready(shared.emptied("disk"))

    def limited() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    code, said = forking.run(forking.reconstruct(output), before=limited)
    bad = forking.one_line(code, said, 2, "cannot be written")
    wrong = ([bad] if bad else []) + intact(output, "limit", {"out.partial"})
    code, said = forking.run(forking.reconstruct(output))
    if code or differing(output, whole):
        wrong.append(f"then: {code} {said}")
    found = "; ".join(wrong) or "exit 2 and one line, OUT the older material; identical without the limit"
    return Row("`ulimit -f`: a file grows past the limit", 1, found, not wrong)


def _writers_on_a_full_disk() -> Row:
    m, cameras = str(shared.whole()), str(shared.capture() / "test" / "transforms.json")
    commands: dict[str, list[str]] = {
        "relight": ["relight", m, "--cameras", cameras, "--samples", "1", "-o", "o"],
        "export --format gltf": ["export", m, "--format", "gltf", "-o", "o.glb"],
        "export --format maps": ["export", m, "--format", "maps", "-o", "o"],
        "view": ["view", m, "--no-open", "-o", "o.html"],
        "check": ["check", str(shared.capture()), "-o", "o.html"],
    }
    wrong = []
    for name, arguments in commands.items():
        with tmpfs(16) as disk:
            code, said = forking.run([*arguments[:-1], str(disk / arguments[-1]), "-q"])
            bad = forking.one_line(code, said, 2, "cannot be written")
            left = [
                p.name
                for p in disk.rglob("*")
                if (p.is_file() and p.stat().st_size == 0) or "unfin" in p.name
            ]
            wrong += [f"{name}: {w}" for w in (bad, *left) if w]
    found = "; ".join(wrong[:3]) or "exit 2 and one line with the place; nothing temporary or empty is left"
    return Row(f"a disk of 16 KB: {', '.join(commands)}", len(commands), found, not wrong)


def intact(output: Path, when: str, allowed: set[str]) -> list[str]:
    wrong = [f"{when}: leaves {name}" for name in shared.left_beside(output) if name not in allowed]
    if contents(output) != contents(shared.older()):
        wrong.append(f"{when}: OUT is not the older material")
    return wrong

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Full disks (a tmpfs, as root), a limit on file sizes, read-only disks, and names that are in the way."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import forking
import shared
from same_bits import contents, differing
from shared import Row

ROOM_KB = (60, 200, 400, 700, 1000)
"""Left on the disk: too little for the first checkpoint, for a later one, for the material folder."""
NOBODY = 65534


def measure() -> dict[str, Any]:
    whole = {name: of for name, of in contents(shared.whole()).items() if name != "viewer.html"}
    rows = [_full(whole), _file_size(whole), _writers_on_a_full_disk()] if os.geteuid() == 0 else []
    rows += [*_in_the_way(), *_read_only()]
    return shared.rows_of(rows)


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
    for room in ROOM_KB:
        with tmpfs(64_000) as disk:
            output = shared.with_older(disk)
            filler = disk / "filler"
            free = shutil.disk_usage(disk).free
            with filler.open("wb") as stream:
                stream.write(b"\0" * (free - room * 1024))
            code, said = forking.run(forking.reconstruct(output))
            bad = forking.one_line(code, said, 2, "No space left on device", "out")
            if bad:
                wrong.append(f"{room} KB: {bad}")
            places.add("OUT.partial" if "out.partial" in said else "OUT")
            wrong += _intact(output, f"{room} KB", {"out.partial", "filler"})
            filler.unlink()
            code, said = forking.run(forking.reconstruct(output))
            if code or differing(output, whole) or shared.left_beside(output):
                wrong.append(f"{room} KB: with room the same command: {code} {said}")
    if places != {"OUT.partial", "OUT"}:
        wrong.append(f"the levels only reach {places}")
    found = "; ".join(wrong[:3]) or (
        "exit 2 and one line with the place, OUT the older material, at most OUT.partial beside it; with "
        "room again, identical materials"
    )
    return Row(
        f"a disk with {', '.join(map(str, ROOM_KB))} KB left, `reconstruct`", len(ROOM_KB), found, not wrong
    )


def _file_size(whole: dict[str, str]) -> Row:
    output = forking.ready(shared.emptied("disk"))

    def limited() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    code, said = forking.run(forking.reconstruct(output), before=limited)
    bad = forking.one_line(code, said, 2, "cannot be written")
    wrong = ([bad] if bad else []) + _intact(output, "limit", {"out.partial"})
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
    for name, user in (("a folder of mode 0555, not as root", True), ("a read-only disk", False)):
        if os.geteuid() != 0:
            continue
        with tmpfs(32_000) as disk:
            output = shared.with_older(disk)
            if user:
                os.chmod(disk, 0o555)
            else:
                subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
            code, said = forking.run(
                forking.reconstruct(output), before=(lambda: os.setuid(NOBODY)) if user else lambda: None
            )
            bad = forking.one_line(
                code, said, 2, "Permission denied" if user else "Read-only file system", "out"
            )
            wrong = ([bad] if bad else []) + _intact(output, name, set())
            found = "; ".join(wrong) or "exit 2 and one line before any work, OUT the older material"
            rows.append(Row(name, 1, found, not wrong))
    return rows


def _intact(output: Path, when: str, allowed: set[str]) -> list[str]:
    wrong = [f"{when}: leaves {name}" for name in shared.left_beside(output) if name not in allowed]
    if contents(output) != contents(shared.older()):
        wrong.append(f"{when}: OUT is not the older material")
    return wrong

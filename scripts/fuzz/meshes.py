# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mutations of meshes: any of them, OBJ and PLY."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from random import Random

from mutating import flipped, mutation, some_file

SUFFIXES = (".obj", ".ply", ".glb", ".gltf", ".bin")
MANY = (2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63, 10**30)


@mutation("meshes", "truncated")
def mesh_truncated(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, *SUFFIXES)
    assert file is not None
    content = file.read_bytes().rstrip()
    # A text may end after any whole face and be none the worse; the last corner must go.
    cut = rng.randrange(len(content))
    if file.suffix == ".obj" or (file.suffix == ".ply" and b"ascii" in content[:32]):
        cut = content.rindex(b" ", 0, len(content) - rng.choice((2, 2, 20)))
    file.write_bytes(content[:cut])
    return f"{file.name}: the first {cut} of {len(content)} bytes"


@mutation("meshes", None)
def mesh_bits_flipped(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, *SUFFIXES)
    assert file is not None
    content = file.read_bytes()
    start = rng.choice((0, 0, len(content) // 2))
    file.write_bytes(flipped(content[: 2000 + start], rng, start) + content[2000 + start :])
    return f"{file.name}: bits from {start} on"


@mutation("meshes", None)
def mesh_cut_anywhere(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".obj", ".ply")
    if file is None:
        return None
    content = file.read_bytes()
    cut = rng.randrange(len(content))
    file.write_bytes(content[:cut])
    return f"{file.name}: the first {cut} of {len(content)} bytes"


def _obj(folder: Path, change: Callable[[list[str]], str]) -> str | None:
    file = folder / "mesh.obj"
    if not file.is_file():
        return None
    lines = file.read_text(encoding="utf-8").splitlines()
    what = change(lines)
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return f"{file.name}: {what}"


def _line(lines: list[str], rng: Random, tag: str) -> int:
    return rng.choice([i for i, line in enumerate(lines) if line.startswith(tag + " ")])


@mutation("meshes", "out of range")
def obj_index(folder: Path, rng: Random) -> str | None:
    def change(lines: list[str]) -> str:
        bad = rng.choice(
            ("0", "-99999999", "99999999", str(10**30), "-" + str(10**30), "1/0/0", "1/1/99999999", "1//0")
        )
        lines[_line(lines, rng, "f")] = f"f {bad} 2/2/2 3/3/3"
        return f"a corner {bad}"

    return _obj(folder, change)


@mutation("meshes", "wrong type")
def obj_words(folder: Path, rng: Random) -> str | None:
    def change(lines: list[str]) -> str:
        tag = rng.choice(("v", "vt", "vn", "f"))
        bad = rng.choice(("x y z", "1", "", "0x10 1 1", "1e", "1/2/3/4/x 2 3", "\0 \0 \0", "1,5 2,5 3,5"))
        lines[_line(lines, rng, tag)] = f"{tag} {bad}"
        return f"{tag} {bad!r}"

    return _obj(folder, change)


@mutation("meshes", "non-finite")
def obj_not_finite(folder: Path, rng: Random) -> str | None:
    def change(lines: list[str]) -> str:
        tag, value = rng.choice(("v", "vt", "vn")), rng.choice(("nan", "inf", "-inf", "1e400"))
        # Of each in turn, since every vertex of these meshes is used.
        lines[_line(lines, rng, tag)] = f"{tag} {value} 0.5 0.5"
        return f"{tag} {value}"

    return _obj(folder, change)


@mutation("meshes", "out of range")
def obj_far(folder: Path, rng: Random) -> str | None:
    def change(lines: list[str]) -> str:
        value = rng.choice(("1e30", "-1e300", "1e13"))
        lines[_line(lines, rng, "v")] = f"v {value} 0 0"
        return f"v {value}"

    return _obj(folder, change)


@mutation("meshes", "out of range")
def obj_without_area(folder: Path, rng: Random) -> str | None:
    def change(lines: list[str]) -> str:
        kind = rng.choice(("no faces", "one point", "one degenerate"))
        for i, line in enumerate(lines):
            if line.startswith("f "):
                corner = line.split()[1]
                lines[i] = "# " if kind == "no faces" else f"f {corner} {corner} {corner}"
                if kind == "one degenerate":
                    break
        return kind

    return _obj(folder, change)


@mutation("meshes", None)
def obj_names_files(folder: Path, rng: Random) -> str | None:
    """Materials and textures, which are not read wherever they point."""

    def change(lines: list[str]) -> str:
        bad = rng.choice(("/etc/passwd", "../../x.mtl", "/dev/zero", "http://127.0.0.1:9/x.mtl", "\x1b[31m"))
        lines[:0] = [
            f"mtllib {bad}",
            f"usemtl {bad}",
            f"o {bad}",
            "g <script>",
            "call x.obj",
            "curv 0 1",
            "l 1 2",
        ]
        return bad

    return _obj(folder, change)


def _ply(folder: Path, rng: Random, change: Callable[[bytes], bytes]) -> str | None:
    file = some_file(folder, rng, ".ply")
    if file is None:
        return None
    head, mark, body = file.read_bytes().partition(b"end_header\n")
    changed = change(head)
    file.write_bytes(changed + mark + body)
    return file.name


@mutation("meshes", "wrong size")
def ply_counts(folder: Path, rng: Random) -> str | None:
    many = str(rng.choice((*MANY, -1, 0, 10**6))).encode()
    element = rng.choice((b"vertex", b"face"))

    def change(head: bytes) -> bytes:
        lines = head.split(b"\n")
        return b"\n".join(
            b"element %b %b" % (element, many) if line.startswith(b"element " + element) else line
            for line in lines
        )

    found = _ply(folder, rng, change)
    return found and f"{found}: {many.decode()} of {element.decode()}"


@mutation("meshes", "wrong type")
def ply_header(folder: Path, rng: Random) -> str | None:
    old, new = rng.choice(
        (
            (b"ply\n", b"plx\n"),
            (b"property float x", b"property quad x"),
            (b"property float x\n", b""),
            (b"list uchar int", b"list float int"),
            (b"element vertex", b"element vertex 3"),
            (b"format ", b"format binary_middle_endian "),
            (b"vertex_indices\n", b"vertex_indices\nelement\n"),
        )
    )
    found = _ply(folder, rng, lambda head: head.replace(old, new, 1))
    return found and f"{found}: {new!r} for {old!r}"


@mutation("meshes", "out of range")
def ply_lists(folder: Path, rng: Random) -> str | None:
    """A face of another number of corners than it has, or of vertices that are not there."""
    file = some_file(folder, rng, ".ply")
    if file is None:
        return None
    head, mark, body = file.read_bytes().partition(b"end_header\n")
    faces = int(head.split(b"element face ")[1].split()[0])
    bad = rng.choice((0, 2, 255, "index", "negative"))
    if b"ascii" in head:
        lines = body.split(b"\n")
        first = next(i for i, line in enumerate(lines) if line.startswith(b"3 ") and len(line.split()) == 4)
        at = rng.randrange(first + 1, first + faces - 1)
        lines[at] = {"index": b"3 0 1 99999999", "negative": b"3 0 1 -1"}.get(
            str(bad), b"%d 0 1 2" % bad if bad in (0, 2, 255) else b""
        )
        body = b"\n".join(lines)
    else:
        changed = bytearray(body)
        at = len(body) - 13 * faces + 13 * rng.randrange(faces)
        if bad in ("index", "negative"):
            struct.pack_into("<i", changed, at + 1, 99_999_999 if bad == "index" else -1)
        else:
            changed[at] = int(bad)
        body = bytes(changed)
    file.write_bytes(head + mark + body)
    return f"{file.name}: a face of {bad}"


@mutation("meshes", None)
def ply_names_files(folder: Path, rng: Random) -> str | None:
    name = rng.choice((b"/etc/passwd", b"../../secret.png", b"/dev/zero"))
    return _ply(folder, rng, lambda head: head.rstrip() + b"\ncomment TextureFile " + name + b"\n")

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mutations of meshes: OBJ, PLY, glTF and GLB with their buffers."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

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


def _gltf(folder: Path, rng: Random, change: Callable[[dict[str, Any]], str]) -> str | None:
    file = some_file(folder, rng, ".gltf", ".glb")
    if file is None:
        return None
    content = file.read_bytes()
    if file.suffix == ".gltf":
        head = json.loads(content)
        what = change(head)
        file.write_text(json.dumps(head), encoding="utf-8")
    else:
        size = struct.unpack_from("<I", content, 12)[0]
        head = json.loads(content[20 : 20 + size])
        what = change(head)
        text = json.dumps(head).encode()
        text += b" " * (-len(text) % 4)
        rest = content[20 + size :]
        file.write_bytes(
            struct.pack("<4sIIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0, 0)[:16]
            + b"JSON"
            + text
            + rest
        )
    return f"{file.name}: {what}"


@mutation("meshes", "wrong size")
def gltf_counts(folder: Path, rng: Random) -> str | None:
    def change(head: dict[str, Any]) -> str:
        where, key = rng.choice(
            (
                ("accessors", "count"),
                ("accessors", "byteOffset"),
                ("accessors", "bufferView"),
                ("bufferViews", "byteLength"),
                ("bufferViews", "byteOffset"),
                ("bufferViews", "buffer"),
                ("buffers", "byteLength"),
            )
        )
        value = rng.choice((*MANY, -1, "1", 1.5, None, [], True))
        if key == "byteOffset" and value is None:
            value = -4
        rng.choice(head[where])[key] = value
        return f"{where}.{key} = {str(value)[:20]}"

    return _gltf(folder, rng, change)


@mutation("meshes", "outside the folder")
def gltf_uri(folder: Path, rng: Random) -> str | None:
    def change(head: dict[str, Any]) -> str:
        bad = rng.choice(
            (
                "../../x.bin",
                "/etc/passwd",
                "/dev/zero",
                "%2e%2e/%2e%2e/x.bin",
                "file:///etc/passwd",
                "http://127.0.0.1:9/x.bin",
                "\0",
            )
        )
        head["buffers"][0]["uri"] = bad
        return f"uri {bad!r}"

    return _gltf(folder, rng, change)


@mutation("meshes", "wrong type")
def gltf_structure(folder: Path, rng: Random) -> str | None:
    def change(head: dict[str, Any]) -> str:
        kind = rng.choice(
            (
                "cycle",
                "self",
                "two parents",
                "no mesh",
                "type",
                "component",
                "sparse",
                "accessors",
                "attributes",
                "data",
            )
        )
        if kind == "cycle":
            head["nodes"] = [{"children": [1]}, {"children": [2]}, {"children": [1], "mesh": 0}]
        elif kind == "self":
            head["nodes"] = [{"children": [0], "mesh": 0}]
        elif kind == "two parents":
            head["nodes"] = [{"children": [i + 1, i + 1]} for i in range(30)] + [{"mesh": 0}]
        elif kind == "no mesh":
            head["nodes"] = [{"mesh": 7}]
        elif kind == "type":
            head["accessors"][1]["type"] = rng.choice(("VEC9", 3, None, []))
        elif kind == "component":
            head["accessors"][1]["componentType"] = rng.choice((5124, 0, "5126", None))
        elif kind == "sparse":
            head["accessors"][1]["sparse"] = {"count": 10**9}
        elif kind == "accessors":
            head["accessors"] = rng.choice(({}, 5, [], [None] * 4))
        elif kind == "attributes":
            head["meshes"][0]["primitives"][0]["attributes"] = rng.choice(
                ({}, [], {"POSITION": 99}, {"POSITION": "x"})
            )
        else:
            head["buffers"][0]["uri"] = "data:application/octet-stream;base64,!!!!" + "A" * 100
        return kind

    return _gltf(folder, rng, change)


@mutation("meshes", "out of range")
def gltf_transform(folder: Path, rng: Random) -> str | None:
    def change(head: dict[str, Any]) -> str:
        bad = rng.choice(([0] * 16, [float("nan")] * 16, [1] * 15, [1e300] * 16, "x", [1.0, 0, 0, 0] * 4))
        head["nodes"][0]["matrix"] = bad
        return f"matrix {str(bad)[:20]}"

    return _gltf(folder, rng, change)


@mutation("meshes", None)
def gltf_names_files(folder: Path, rng: Random) -> str | None:
    """Pictures, which are not read wherever they point."""

    def change(head: dict[str, Any]) -> str:
        bad = rng.choice(
            ("/etc/passwd", "../../x.png", "http://127.0.0.1:9/x.png", "data:image/png;base64,AAAA")
        )
        head["images"] = [{"uri": bad}]
        head["textures"] = [{"source": 0}]
        head["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "name": "<b>"}]
        return bad

    return _gltf(folder, rng, change)


@mutation("meshes", "wrong size")
def glb_chunks(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".glb")
    if file is None:
        return None
    content = bytearray(file.read_bytes())
    at = rng.choice((4, 8, 12))
    struct.pack_into("<I", content, at, value := rng.choice((0, 1, 2**31, 2**32 - 1)))
    file.write_bytes(content)
    return f"{file.name}: {value} at {at}"

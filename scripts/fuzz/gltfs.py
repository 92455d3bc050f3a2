# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mutations of glTF and GLB, with their buffers."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from mutating import mutation, some_file

MANY = (2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63, 10**30)


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


@mutation("meshes", "wrong size")
def gltf_instances(folder: Path, rng: Random) -> str | None:
    """A small mesh as often as it takes for gigabytes, by its nodes, its primitives or both."""

    def change(head: dict[str, Any]) -> str:
        nodes, primitives = rng.choice(((16_000, 1), (1, 16_000), (200, 200), (20_000, 1), (1, 20_000)))
        head["meshes"][0]["primitives"] *= primitives
        head["nodes"] = [{"mesh": 0}] * nodes
        head["scenes"] = [{"nodes": list(range(nodes))}]
        return f"{nodes} nodes of {primitives} primitives"

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

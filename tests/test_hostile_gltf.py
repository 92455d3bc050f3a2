# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""glTF made to do harm: what it declares and points at, one wrong thing each, and the message."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.errors import InputError
from swatchwork.surface import read_mesh

BUFFER = np.array([0, 1, 2], "<u4").tobytes() + np.eye(3, dtype="<f4").tobytes()


def document() -> dict[str, Any]:
    """One triangle, its numbers in mesh.bin."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5125, "type": "SCALAR", "count": 3},
            {"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": 3},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 12},
            {"buffer": 0, "byteOffset": 12, "byteLength": 36},
        ],
        "buffers": [{"byteLength": 48, "uri": "mesh.bin"}],
    }


def written(folder: Path, head: Any) -> Path:
    (folder / "mesh.bin").write_bytes(BUFFER)
    (folder / "mesh.gltf").write_text(json.dumps(head))
    return folder / "mesh.gltf"


def part(where: str, number: int, **values: Any) -> Callable[[dict[str, Any]], None]:
    return lambda head: head[where][number].update(values)


def nodes(*made: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    return lambda head: head.update(nodes=list(made))


def primitive(**values: Any) -> Callable[[dict[str, Any]], None]:
    return lambda head: head["meshes"][0]["primitives"][0].update(values)


def primitives(count: int) -> Callable[[dict[str, Any]], None]:
    return lambda head: head["meshes"][0].update(primitives=head["meshes"][0]["primitives"] * count)


DEEP = [{"children": [i + 1]} for i in range(5000)] + [{"mesh": 0}]

WRONG: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "a buffer longer than its file": (part("buffers", 0, byteLength=2**40), "declares 1099511627776 bytes"),
    "a buffer of true bytes": (part("buffers", 0, byteLength=True), "declares True"),
    "a buffer outside": (part("buffers", 0, uri="../../mesh.bin"), "outside the capture folder"),
    "a buffer outside, coded": (part("buffers", 0, uri="%2e%2e/mesh.bin"), "outside the capture folder"),
    "an absolute buffer": (part("buffers", 0, uri="/dev/zero"), "outside the capture folder"),
    "a buffer of the network": (part("buffers", 0, uri="http://127.0.0.1:9/a"), "outside the capture folder"),
    "a buffer of no base64": (part("buffers", 0, uri="data:x;base64,!!!"), "no base64"),
    "a buffer that is a number": (part("buffers", 0, uri=5), "the uri 5"),
    "a view beyond its buffer": (part("bufferViews", 1, byteLength=10**12), "bufferView 1"),
    "a view that begins before": (part("bufferViews", 1, byteOffset=-4), "bufferView 1"),
    "a view of no buffer": (part("bufferViews", 1, buffer=3), "bufferView 1"),
    "a stride of zero": (part("bufferViews", 1, byteStride=0), "byteStride 0"),
    "billions of vertices": (part("accessors", 1, count=10**10), "accessor 1"),
    "a vertex more than there are": (part("accessors", 1, count=4), "ends beyond"),
    "an offset beyond": (part("accessors", 1, byteOffset=8), "ends beyond"),
    "zeros out of nothing": (lambda h: h["accessors"][1].pop("bufferView"), "numbers in a bufferView"),
    "a sparse accessor": (part("accessors", 1, sparse={"count": 10**9}), "sparse"),
    "an unknown type": (part("accessors", 1, type="VEC9"), "malformed"),
    "nodes in a circle": (nodes({"mesh": 0}, {"children": [2]}, {"children": [1]}), "below itself"),
    "a node below itself": (nodes({"children": [0], "mesh": 0}), "below itself"),
    "a node below two": (nodes({"children": [1, 1]}, {"mesh": 0}), "below two others"),
    "nodes 5000 deep": (nodes(*DEEP), "levels deep"),
    "a singular transform": (part("nodes", 0, scale=[0, 1, 1]), "transform"),
    "a transform that is no number": (part("nodes", 0, matrix=[float("nan")] * 16), "mesh.gltf"),
    "a root twice": (part("scenes", 0, nodes=[0, 0]), "twice in a scene"),
    "a mesh that is not there": (part("nodes", 0, mesh=1), "a node names mesh 1"),
    "a position that is not there": (primitive(attributes={"POSITION": 2}), "names accessor 2"),
    "too many nodes": (nodes(*[{} for _ in range(2**14 + 1)]), "has 16385 nodes"),
    "too many primitives": (primitives(2**14 + 1), "has 16385 primitives;"),
    "no asset": (lambda head: head.pop("asset"), "asset"),
    "an object for a list": (lambda head: head.update(accessors={"a": 1}), "names accessor"),
    "a list for a number": (lambda head: head.update(meshes=5), "malformed"),
}


def test_the_triangle_is_read(tmp_path: Path) -> None:
    assert len(read_mesh(written(tmp_path, document())).faces) == 1


@pytest.mark.parametrize("case", WRONG)
def test_gltf(case: str, tmp_path: Path) -> None:
    spoil, message = WRONG[case]
    head = document()
    spoil(head)
    with pytest.raises(InputError, match=message):
        read_mesh(written(tmp_path, head))


def test_buffers_are_regular_files_within_the_folder(tmp_path: Path) -> None:
    inside = tmp_path / "capture"
    inside.mkdir()
    file = written(inside, document())
    (inside / "mesh.bin").rename(tmp_path / "mesh.bin")
    (inside / "mesh.bin").symlink_to("../mesh.bin")
    with pytest.raises(InputError, match="a link that leads outside"):
        read_mesh(file)
    (inside / "mesh.bin").unlink()
    os.mkfifo(inside / "mesh.bin")
    with pytest.raises(InputError, match="is a pipe"):
        read_mesh(file)


def test_pictures_are_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    head = document() | {
        "images": [{"uri": "pipe.png"}, {"uri": "/etc/passwd"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    }
    head["meshes"][0]["primitives"][0]["material"] = 0
    assert len(read_mesh(written(tmp_path, head)).faces) == 1


def test_instances_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes that share a mesh, and primitives that share accessors, make much of few bytes."""
    head = document()
    nodes(*[{"mesh": 0}] * 20)(head)
    head["scenes"][0]["nodes"] = list(range(20))
    assert len(read_mesh(written(tmp_path, head)).faces) == 20
    # 20 times 3 vertices and 3 corners; 48 bytes of buffers may stand for 96 of them anyway.
    monkeypatch.setattr("swatchwork.surface.gltf_meshes.MOST_SHARED", 1)
    with pytest.raises(InputError, match="120 vertices and corners as its nodes place them; expected 96"):
        read_mesh(written(tmp_path, head))
    nodes(*[{"mesh": 0}] * 16)(head)
    head["scenes"][0]["nodes"] = list(range(16))
    assert len(read_mesh(written(tmp_path, head)).faces) == 16
    head = document()
    primitives(17)(head)
    with pytest.raises(InputError, match="102 vertices and corners in its primitives"):
        read_mesh(written(tmp_path, head))
    head = document()
    primitives(200)(head)
    nodes(*[{"mesh": 0}] * 100)(head)
    monkeypatch.setattr("swatchwork.surface.gltf_meshes.MOST_SHARED", 10**6)
    with pytest.raises(InputError, match="20000 primitives as its nodes place them"):
        read_mesh(written(tmp_path, head))


def test_accessors_that_no_triangle_uses_are_left_alone(tmp_path: Path) -> None:
    """Morph targets may be sparse, and a mesh have points and lines beside its triangles."""
    head = document()
    head["accessors"].insert(0, {"componentType": 5126, "type": "VEC3", "count": 3, "sparse": {"count": 1}})
    made = head["meshes"][0]["primitives"]
    made[0] = {"attributes": {"POSITION": 2}, "indices": 1, "targets": [{"POSITION": 0}]}
    made.append({"attributes": {"POSITION": 0}, "mode": 0})
    assert len(read_mesh(written(tmp_path, head)).faces) == 1
    del made[0]
    with pytest.raises(InputError, match="no faces"):
        read_mesh(written(tmp_path, head))


def glb(text: bytes, binary: bytes, length: int | None = None, sizes: tuple[int, int] | None = None) -> bytes:
    text += b" " * (-len(text) % 4)
    first, second = sizes or (len(text), len(binary))
    body = struct.pack("<I4s", first, b"JSON") + text + struct.pack("<I4s", second, b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body) if length is None else length) + body


def test_glb_chunks(tmp_path: Path) -> None:
    head = document()
    del head["buffers"][0]["uri"]
    text = json.dumps(head).encode()
    file = tmp_path / "mesh.glb"
    file.write_bytes(glb(text, BUFFER))
    assert len(read_mesh(file).faces) == 1
    whole = len(text) + (-len(text) % 4)
    for content, message in (
        (glb(text, BUFFER, length=2**32 - 1), "4294967295 bytes long"),
        (glb(text, BUFFER, sizes=(2**32 - 1, 48)), "ends beyond the file"),
        (glb(text, BUFFER, sizes=(whole, 2**31)), "ends beyond the file"),
        (glb(text, BUFFER)[:-5], "truncated"),
        (b"glTF", "no GLB"),
        (glb(b"[" * 100_000, BUFFER), "nested too deeply"),
        (glb(b"[]", BUFFER), "asset"),
    ):
        file.write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_mesh(file)

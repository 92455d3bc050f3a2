# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The meshes of a glTF, reduced to what is read of them, and counted as often as nodes place them.

Primitives may share accessors, and nodes a mesh: a small file can stand for any number of triangles.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from swatchwork.capture import shown
from swatchwork.capture.guarding import MOST_ELEMENTS
from swatchwork.errors import InputError

_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TRIANGLES, _STRIP = 4, 5
_ATTRIBUTES = ("POSITION", "NORMAL", "TEXCOORD_0")

MOST_PARTS = 1 << 14
"""Nodes, primitives, and primitives as nodes place them; scans have a few, scenes of CAD thousands."""
MOST_SHARED = 1 << 22
"""Vertices and corners that a scene may make of however few bytes: a million triangles or so."""
ROWS_A_BYTE = 2
"""Vertices and corners that a scene may make of one byte of buffers, beyond that; a corner takes 2 or 4 bytes
and a vertex 12 or more, so that a large mesh may still be placed some ten times."""


def reduced_meshes(
    path: Path, head: dict[str, Any], buffer_bytes: int
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Meshes and accessors with triangles, normals and UVs alone; each accessor that these use is checked.

    Raises:
        InputError: an accessor is not what its buffers hold, or meshes are placed too often.
    """
    accessors, numbers = head.get("accessors", []), dict[int, int]()

    def used(of: Any) -> int:
        if not is_count(of) or of >= len(accessors):
            raise InputError(
                f"a primitive names accessor {shown(of)}", file=path, expected="one that is there"
            )
        if of not in numbers:
            _check_accessor(path, of, accessors[of], head.get("bufferViews", []))
            numbers[of] = len(numbers)
        return numbers[of]

    meshes = []
    for mesh in head.get("meshes", []):
        kept = [p for p in mesh["primitives"] if p.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP)]
        meshes.append({"primitives": [_reduced(p, used) for p in kept]})
    reduced = [accessors[of] for of in numbers]
    _check_placed(path, head.get("nodes", []), meshes, reduced, buffer_bytes)
    return meshes, reduced


def is_count(value: Any) -> bool:
    """Whether it is a whole number from 0 on."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _reduced(primitive: dict[str, Any], used: Any) -> dict[str, Any]:
    attributes = primitive["attributes"]
    names = ["POSITION", *(name for name in _ATTRIBUTES[1:] if name in attributes)]
    made: dict[str, Any] = {"attributes": {name: used(attributes[name]) for name in names}}
    if "indices" in primitive:
        made["indices"] = used(primitive["indices"])
    return made | {key: primitive[key] for key in ("mode", "material") if key in primitive}


def _check_accessor(path: Path, number: int, accessor: dict[str, Any], views: list[dict[str, Any]]) -> None:
    count, start, of = accessor["count"], accessor.get("byteOffset", 0), accessor.get("bufferView")
    row = _BYTES[accessor["componentType"]] * _NUMBERS[accessor["type"]]
    if "sparse" in accessor:
        raise InputError(f"accessor {number} is sparse", file=path, expected="plain accessors")
    if of is None or not all(map(is_count, (count, start, of))) or not 1 <= count <= MOST_ELEMENTS:
        raise InputError(
            f"accessor {number} has {shown(count)} elements at {shown(start)} of view {shown(of)}",
            file=path,
            expected="numbers in a bufferView (Draco-compressed meshes must be decompressed first)",
        )
    view = views[of]
    if start + (count - 1) * view.get("byteStride", row) + row > view["byteLength"]:
        raise InputError(
            f"accessor {number} of {count} elements ends beyond its bufferView",
            file=path,
            expected=f"what {view['byteLength']} bytes hold",
        )


def _check_placed(
    path: Path,
    nodes: list[dict[str, Any]],
    meshes: list[dict[str, Any]],
    accessors: list[dict[str, Any]],
    buffer_bytes: int,
) -> None:
    """What all nodes place together; in a tree, no scene can place more."""
    rows = [sum(_rows(p, accessors) for p in mesh["primitives"]) for mesh in meshes]
    placed, parts = sum(rows), sum(len(mesh["primitives"]) for mesh in meshes)
    most = max(MOST_SHARED, ROWS_A_BYTE * buffer_bytes)
    _check_count(path, len(nodes), MOST_PARTS, "nodes")
    _check_count(path, parts, MOST_PARTS, "primitives")
    _check_count(path, placed, most, "vertices and corners in its primitives")
    placed = parts = 0
    for node in nodes:
        if (mesh := node.get("mesh")) is None:
            continue
        if not is_count(mesh) or mesh >= len(meshes):
            raise InputError(f"a node names mesh {shown(mesh)}", file=path, expected="one that is there")
        placed, parts = placed + rows[mesh], parts + len(meshes[mesh]["primitives"])
    _check_count(path, parts, MOST_PARTS, "primitives as its nodes place them")
    _check_count(path, placed, most, "vertices and corners as its nodes place them")


def _rows(primitive: dict[str, Any], accessors: list[dict[str, Any]]) -> int:
    of = [primitive["attributes"]["POSITION"], *([primitive["indices"]] if "indices" in primitive else [])]
    return sum(accessors[i]["count"] for i in of)


def _check_count(path: Path, found: int, most: int, what: str) -> None:
    if found > most:
        raise InputError(
            f"has {found} {what}",
            file=path,
            expected=f"{most} at most of a file of this size",
            hint="Join the parts into one mesh, without instances",
        )

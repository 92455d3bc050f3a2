# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mesh files (OBJ here, PLY and glTF through trimesh), with nothing merged, reordered or thrown away."""

from __future__ import annotations

import io
import json
import logging
import os
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.capture import MOST_MESH_BYTES, need_file
from swatchwork.errors import InputError, is_out_of_memory
from swatchwork.surface.gltf import buffer_files, read_gltf
from swatchwork.surface.mesh import Mesh, mesh_from_arrays
from swatchwork.surface.obj import read_obj
from swatchwork.surface.ply import check_ply

SUFFIXES = (".obj", ".ply", ".glb", ".gltf")


def read_mesh(path: str | PathLike[str]) -> Mesh:
    """Read a mesh: UVs with their seams, normals from the file where it has them, scene graphs flattened.

    Raises:
        InputError: missing, unreadable or truncated file, no faces, NaN vertices, a face naming no vertex.
    """
    path = Path(path)
    if not os.path.lexists(path):
        raise InputError(
            "the mesh file does not exist", file=path, hint="Check the key 'mesh' of transforms.json."
        )
    need_file(path, "a mesh", most=MOST_MESH_BYTES, hint="Check the key 'mesh' of transforms.json")
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"unknown mesh format '{path.suffix}'", file=path, expected=", ".join(SUFFIXES))
    if path.suffix.lower() == ".obj":
        vertices, faces, normals, uv = read_obj(path)
        return mesh_from_arrays(vertices, faces, normals, uv, file=path)
    parts = [_arrays(path, geometry, transform) for geometry, transform in _load(path)]
    parts = [part for part in parts if len(part["faces"])]
    if not parts:
        raise InputError(
            "the mesh has no faces", file=path, expected="a triangle mesh", hint="Point clouds need meshing."
        )
    first = np.cumsum([0] + [len(part["vertices"]) for part in parts])
    joined: dict[str, Any] = {"vertices": np.concatenate([part["vertices"] for part in parts])}
    joined["faces"] = np.concatenate(
        [part["faces"] + start for part, start in zip(parts, first, strict=False)]
    )
    for name in ("normals", "uv"):
        # Half a parametrisation is none; half the normals are none either.
        whole = all(part[name] is not None for part in parts)
        joined[name] = np.concatenate([part[name] for part in parts]) if whole else None
    return mesh_from_arrays(**joined, file=path)


def buffers_of(path: Path) -> list[Path]:
    """The files beside a .gltf that hold its numbers; none for other formats, or where it cannot be read."""
    return [file for file in buffer_files(path) if file.is_file()]


def _load(path: Path) -> list[tuple[Any, Any]]:
    import trimesh

    if path.suffix.lower() == ".ply":
        content, resolver, kind = path.read_bytes(), _Nothing(), "ply"
        check_ply(path, content)
    else:
        head, buffers = read_gltf(path)
        content, resolver, kind = json.dumps(head).encode(), _Nothing(buffers), "gltf"
    logger = logging.getLogger("trimesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        loaded = trimesh.load(io.BytesIO(content), file_type=kind, resolver=resolver, process=False)
    except Exception as error:  # trimesh raises whatever its parsers trip over
        if is_out_of_memory(error):
            raise
        raise InputError(
            f"cannot be read as a mesh ({type(error).__name__}: {error})",
            file=path,
            expected=f"a whole {path.suffix[1:].upper()} file",
            hint="Is it truncated, or does a face name a vertex that does not exist?",
        ) from error
    finally:
        logger.setLevel(level)
    if not isinstance(loaded, trimesh.Scene):
        return [(loaded, np.eye(4))]
    placed = []
    for node in loaded.graph.nodes_geometry:
        transform, name = loaded.graph[node]
        placed.append((loaded.geometry[name], np.asarray(transform, dtype=np.float64)))
    return placed


class _Nothing:
    """What trimesh asks for files that a mesh names: it gets the buffers by their number, and no other."""

    def __init__(self, buffers: list[bytes] | None = None) -> None:
        self.buffers = buffers or []

    def get(self, name: str) -> bytes:
        return self.buffers[int(name)]

    __getitem__ = get


def _arrays(path: Path, geometry: Any, world_from_part: Any) -> dict[str, Any]:
    faces = np.asarray(getattr(geometry, "faces", np.zeros((0, 3))), dtype=np.int64)
    vertices = np.asarray(geometry.vertices, dtype=np.float64)
    linear = world_from_part[:3, :3]
    if not np.isfinite(world_from_part).all() or abs(np.linalg.det(linear)) < 1e-30:
        raise InputError(
            f"a node's transform is {world_from_part.tolist()}", file=path, expected="one that can be undone"
        )
    uv = getattr(getattr(geometry, "visual", None), "uv", None)
    normals = None
    # trimesh keeps the file's normals in its cache, and would compute (split at seams) what is not there.
    if len(faces) and "vertex_normals" in geometry._cache.cache:
        normals = np.asarray(geometry.vertex_normals, dtype=np.float64)
        # Normals are covectors: they stay outward under a mirror, where the winding turns.
        normals = normals @ np.linalg.inv(linear)
    if np.linalg.det(linear) < 0:
        faces = faces[:, ::-1]
    return {
        "vertices": vertices @ linear.T + world_from_part[:3, 3],
        "faces": faces,
        "normals": normals,
        "uv": None if uv is None or len(uv) != len(vertices) else np.asarray(uv, dtype=np.float64),
    }

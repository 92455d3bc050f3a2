# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Triangle meshes: validation, shading normals, writing OBJ."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.arrays import F64, I32, I64, unit
from swatchwork.capture.camera import FARTHEST
from swatchwork.errors import CaptureWarning, InputError

# Twice the area of a triangle over its longest edge squared; below this its plane is rounding noise.
DEGENERATE = 1e-12


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh in world space, its vertices split at UV seams.

    ``vertices`` F64[V, 3]; ``faces`` I32[F, 3], counter-clockwise from outside; ``normals`` F64[V, 3],
    unit shading normals; ``uv`` F64[V, 2] or None, v upward.
    """

    vertices: F64
    faces: I32
    normals: F64
    uv: F64 | None = None

    @property
    def crosses(self) -> F64:
        """Edge cross products F64[F, 3]: outward, twice the area long."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        return np.cross(b - a, c - a)

    @property
    def bounds(self) -> tuple[F64, float]:
        """Centre F64[3] and radius of the ball around the bounding box (world units)."""
        used = self.vertices[self.faces]
        low, high = used.min(axis=(0, 1)), used.max(axis=(0, 1))
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2


def mesh_from_arrays(
    vertices: Any,
    faces: Any,
    normals: Any = None,
    uv: Any = None,
    *,
    file: str | PathLike[str] | None = None,
) -> Mesh:
    """Validate plain arrays and make a ``Mesh`` of them.

    Args:
        vertices: [V, 3], world units.
        faces: [F, 3], numbers of vertices.
        normals: [V, 3] or None: angle-weighted over vertices of equal position, so that UV seams
            do not split the shading.
        uv: [V, 2] or None.
        file: named in errors and warnings.

    Raises:
        InputError: no faces, values that are not finite, a face naming no vertex, no face with an area.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
    index = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    if len(index) == 0:
        raise InputError(
            "the mesh has no faces", file=file, expected="a triangle mesh", hint="Point clouds need meshing."
        )
    if index.min() < 0 or index.max() >= len(vertices):
        bad = index.min() if index.min() < 0 else index.max()
        raise InputError(f"a face names vertex {bad}", file=file, expected=f"0 to {len(vertices) - 1}")
    broken = ~np.isfinite(vertices).all(axis=1)
    if broken.any():
        raise InputError(
            f"{broken.sum()} vertices are NaN or infinite, the first is number {np.argmax(broken)}",
            file=file,
            expected="finite coordinates",
        )
    far = np.abs(vertices).max()
    if far > FARTHEST:
        raise InputError(
            f"a vertex has the coordinate {far:g}",
            file=file,
            expected=f"{FARTHEST:g} at most, of either sign",
        )
    index = _without_degenerate(vertices, index, file)
    given = None if normals is None else np.asarray(normals, dtype=np.float64)
    if given is not None and not np.isfinite(given).all():
        _warn(file, "some normals are NaN or infinite; those of the triangles are taken there")
    index = _outward(vertices, index, given, file)
    smooth = angle_weighted_normals(vertices, index)
    if given is not None:
        kept = np.isfinite(given).all(axis=1) & (np.linalg.norm(given, axis=1) > 1e-6)
        smooth = np.where(kept[:, None], unit(np.where(kept[:, None], given, 1.0)), smooth)
    if uv is not None:
        uv = np.ascontiguousarray(uv, dtype=np.float64)[:, :2]
        if not np.isfinite(uv).all():
            _warn(file, "some texture coordinates are NaN or infinite; all are left out")
            uv = None
    return Mesh(vertices, index.astype(np.int32), smooth, uv)


def _warn(file: str | PathLike[str] | None, what: str) -> None:
    warnings.warn(CaptureWarning(f"{file or 'mesh'}: {what}"), stacklevel=4)


def _without_degenerate(vertices: F64, index: I64, file: str | PathLike[str] | None) -> I64:
    a, b, c = (vertices[index[:, i]] for i in range(3))
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((b - a) ** 2).sum(1), ((c - b) ** 2).sum(1), ((a - c) ** 2).sum(1)], axis=0)
    flat = doubled <= DEGENERATE * longest
    if flat.all():
        raise InputError(
            f"all {len(index)} triangles are degenerate", file=file, expected="triangles with an area"
        )
    if flat.any():
        _warn(file, f"{flat.sum()} of {len(index)} triangles are degenerate and dropped")
    return np.asarray(index[~flat])


def _outward(vertices: F64, index: I64, normals: F64 | None, file: str | PathLike[str] | None) -> I64:
    """Turn every face over where the file's normals, or the enclosed volume, say that it is inside out."""
    a, b, c = (vertices[index[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    if normals is not None and np.isfinite(normals).all():
        agreement = float((cross * normals[index].sum(axis=1)).sum())
    elif _is_closed(vertices, index):
        agreement = float((cross * (a - vertices.mean(axis=0))).sum())
    else:
        agreement = 1.0
    if agreement >= 0:
        return index
    _warn(file, "the triangles wind clockwise seen from outside; they are turned over")
    return np.asarray(index[:, ::-1])


def _is_closed(vertices: F64, index: I64) -> bool:
    faces = welded(vertices)[index]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = edges[:, 0] * len(vertices) + edges[:, 1]
    backward = edges[:, 1] * len(vertices) + edges[:, 0]
    return bool(np.array_equal(np.sort(forward), np.sort(backward)))


def welded(vertices: F64) -> I64:
    """Number of the distinct position of each vertex, I64[V]."""
    keys = np.ascontiguousarray(vertices + 0.0).view(np.dtype((np.void, 24))).ravel()
    return np.unique(keys, return_inverse=True)[1].astype(np.int64)


def angle_weighted_normals(vertices: F64, faces: I64 | I32) -> F64:
    """Unit normals F64[V, 3]: faces around a position, weighted by their angle there."""
    corner = vertices[faces]
    group = welded(vertices)
    normal = unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    total = np.zeros((group.max() + 1, 3))
    for i in range(3):
        one = unit(corner[:, (i + 1) % 3] - corner[:, i])
        two = unit(corner[:, (i + 2) % 3] - corner[:, i])
        # atan2 keeps its digits for slivers, where arccos of the dot product has none.
        angle = np.arctan2(np.linalg.norm(np.cross(one, two), axis=1), (one * two).sum(axis=1))
        for axis in range(3):
            total[:, axis] += np.bincount(group[faces[:, i]], normal[:, axis] * angle, minlength=len(total))
    result = unit(total)[group]
    # A position where faces cancel (a thin sheet's rim), or that no face uses, still needs a unit vector.
    result[np.linalg.norm(result, axis=1) < 0.5] = (0.0, 0.0, 1.0)
    return result


def write_mesh_obj(path: str | PathLike[str], mesh: Mesh) -> None:
    """Write vertices, shading normals, UVs (if any) and faces; ten digits of each."""
    lines = [f"v {x:.10g} {y:.10g} {z:.10g}" for x, y, z in mesh.vertices]
    if mesh.uv is not None:
        lines += [f"vt {u:.10g} {v:.10g}" for u, v in mesh.uv]
    lines += [f"vn {x:.10g} {y:.10g} {z:.10g}" for x, y, z in mesh.normals]
    corner = "{0}/{0}/{0}" if mesh.uv is not None else "{0}//{0}"
    lines += ["f " + " ".join(corner.format(i + 1) for i in face) for face in mesh.faces.tolist()]
    Path(path).write_text("\n".join(lines) + "\n", encoding="ascii")

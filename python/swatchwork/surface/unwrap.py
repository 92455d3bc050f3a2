# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Judging given UVs, and unwrapping (xatlas) what has none or overlapping ones."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from swatchwork.arrays import F64
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.surface.atlas import uv_doubled_areas
from swatchwork.surface.mesh import Mesh
from swatchwork.surface.raster import covered_centres

# Texel centres claimed twice, or surface area without UVs, beyond which a parametrisation is no atlas.
TOLERATED = 2e-4
# Raster on which overlaps are looked for; centres sample the overlapping area without bias.
RASTER = 1024


def uv_problem(mesh: Mesh) -> str | None:
    """Why the mesh's UVs cannot serve as an atlas, in words; None where they can.

    They can where they lie in [0, 1], give every face an area and map no two surface points to one UV:
    at most 0.02 % of the covered centres of a 1024 x 1024 raster claimed twice, and at most 0.02 % of
    the surface without UV area.
    """
    if mesh.uv is None:
        return "there are no UVs"
    used = mesh.uv[np.unique(mesh.faces)]
    if not np.isfinite(used).all():
        return "some UVs are NaN or infinite"
    if used.min() < -1e-6 or used.max() > 1 + 1e-6:
        return f"UVs range from {used.min():.3g} to {used.max():.3g}, outside [0, 1]"
    area = np.linalg.norm(mesh.crosses, axis=1)
    lost = area[uv_doubled_areas(mesh) <= 1e-14].sum() / area.sum()
    if lost > TOLERATED:
        return f"{100 * lost:.3g} % of the surface has no UV area"
    _, row, col = covered_centres(mesh.uv, mesh.faces, RASTER)
    times = np.bincount(row * RASTER + col, minlength=1)
    twice = (times > 1).sum() / max((times > 0).sum(), 1)
    if twice > TOLERATED:
        return f"the UVs overlap: {100 * twice:.3g} % of the area used is used more than once"
    return None


def has_injective_uv(mesh: Mesh) -> bool:
    """Whether the mesh's own UVs can serve as the atlas (``uv_problem`` says why not)."""
    return uv_problem(mesh) is None


def parametrised(
    mesh: Mesh, resolution: int = RASTER, cut: Callable[[Mesh, int], Mesh] | None = None
) -> Mesh:
    """The mesh itself where its UVs are injective, else unwrapped; warns where there were UVs, but unfit.

    Args:
        cut: unwraps mesh and resolution; by default ``unwrap`` does.
    """
    problem = uv_problem(mesh)
    if problem is None:
        return mesh
    if mesh.uv is not None:
        warnings.warn(CaptureWarning(f"mesh: {problem}; it is unwrapped anew"), stacklevel=2)
    return (cut or unwrap)(mesh, resolution)


def unwrap(mesh: Mesh, resolution: int = RASTER) -> Mesh:
    """Cut the surface into charts and pack them into [0, 1]^2 (xatlas), two texels apart at ``resolution``.

    Geometry and shading normals stay; vertices are split at the new seams.

    Raises:
        InputError: xatlas left much of the surface without UVs, or overlapping.
    """
    import xatlas

    # xatlas fails silently on meshes of small extent: it sees the mesh in the unit ball.
    centre, radius = mesh.bounds
    atlas = xatlas.Atlas()
    atlas.add_mesh(
        ((mesh.vertices - centre) / radius).astype(np.float32),
        mesh.faces.astype(np.uint32),
        mesh.normals.astype(np.float32),
    )
    charts, pack = xatlas.ChartOptions(), xatlas.PackOptions()
    pack.resolution, pack.padding, pack.bilinear = resolution, 2, True
    atlas.generate(charts, pack)
    source, faces, uv = atlas[0]
    # xatlas scales each axis by its own side: undo, then fit the longer one.
    uv = np.asarray(uv, dtype=np.float64) * (atlas.width, atlas.height) / max(atlas.width, atlas.height)
    uv = np.clip(uv, 0.0, 1.0)
    source = np.asarray(source, dtype=np.int64)
    result = Mesh(mesh.vertices[source], np.asarray(faces, dtype=np.int32), mesh.normals[source], uv)
    result = _with_strip_for_lost(result)
    problem = uv_problem(result)
    if problem is not None or len(result.faces) != len(mesh.faces):
        raise InputError(
            f"unwrapping failed: {problem or 'faces were lost'}",
            expected="a surface that xatlas can flatten",
            hint="Give the mesh UVs of its own, or repair it (duplicate or non-manifold faces).",
        )
    return result


def _with_strip_for_lost(mesh: Mesh) -> Mesh:
    """Give faces that xatlas left without UV area a place of their own, in a strip at the right side."""
    assert mesh.uv is not None
    area = np.linalg.norm(mesh.crosses, axis=1)
    # A thousandth of the mean UV density: such a face would get no texel although it has an area.
    density = uv_doubled_areas(mesh) / area
    lost = np.flatnonzero(density < 1e-3 * np.average(density, weights=area))
    if not len(lost) or area[lost].sum() <= TOLERATED * area.sum():
        return mesh
    cells = int(np.ceil(np.sqrt(len(lost) / 0.1)))
    columns = int(np.ceil(len(lost) / cells))
    size = 0.1 / columns
    place = np.stack(
        [0.9 + (np.arange(len(lost)) // cells) * size, (np.arange(len(lost)) % cells) / cells], axis=1
    )
    corner = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]]) * (size, 1 / cells)
    added: F64 = (place[:, None] + corner).reshape(-1, 2)
    split = mesh.faces[lost].ravel()
    faces = mesh.faces.copy()
    faces[lost] = (len(mesh.vertices) + np.arange(len(split))).reshape(-1, 3)
    return Mesh(
        np.concatenate([mesh.vertices, mesh.vertices[split]]),
        faces,
        np.concatenate([mesh.normals, mesh.normals[split]]),
        np.concatenate([mesh.uv * (0.89, 0.89), added]),
    )

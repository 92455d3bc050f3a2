# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The atlas: texels of the UV square and where each lies on the surface (the paper's points x, section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from swatchwork.arrays import F32, F64, I32, I64, unit
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.surface.mesh import Mesh
from swatchwork.surface.raster import barycentric, covered_centres

# Share of the UV square that charts of an xatlas packing typically fill.
PACKING = 0.6
CHUNK = 1 << 18
"""Texels whose corners are gathered at once: 40 MB."""


@dataclass(frozen=True)
class Atlas:
    """M texels of a square atlas, ordered by row, then column; row 0 is v = 1.

    ``texel_at`` I32[H, W], the texel's number or -1; ``row``, ``col``, ``face`` I32[M]; ``position``
    F64[M, 3]; ``normal`` F32[M, 3], unit, shading; ``face_normal`` F64[F, 3], unit; ``face_footprint``
    F64[F], area of surface in a texel of each face (world units squared). A texel takes 48 bytes, a pixel 4.
    """

    resolution: int
    texel_at: I32
    row: I32
    col: I32
    face: I32
    position: F64
    normal: F32
    face_normal: F64
    face_footprint: F64

    def __len__(self) -> int:
        return len(self.row)

    def geometric_normal(self, texel: I64 | slice) -> F64:
        """Unit normals [T, 3] of the triangles that texels [T] lie in."""
        return np.asarray(self.face_normal[self.face[texel]])

    def footprint(self, texel: I64 | slice) -> F64:
        """Area of surface [T] in texels [T] (world units squared)."""
        return np.asarray(self.face_footprint[self.face[texel]])


def build_atlas(mesh: Mesh, resolution: int) -> Atlas:
    """Rasterise the mesh's UVs: every texel whose centre lies in a triangle is a surface point.

    Raises:
        InputError: the mesh has no UVs, or no texel centre lies in a triangle.
    """
    if mesh.uv is None:
        raise InputError(
            "the mesh has no UVs", expected="a parametrised mesh", hint="Use parametrised(mesh) first."
        )
    if resolution < 1:
        raise InputError(f"atlas resolution is {resolution}", expected="at least 1")
    face, row, col = covered_centres(mesh.uv, mesh.faces, resolution)
    # Overlaps are the caller's to judge (uv_problem); the first face keeps a texel that two want.
    pixel, kept = np.unique(row * resolution + col, return_index=True)
    if not len(pixel):
        raise InputError(
            "no texel lies on the surface", expected="UVs inside [0, 1]", hint="Raise --resolution."
        )
    face, row, col = face[kept], row[kept], col[kept]
    texel_at = np.full(resolution * resolution, -1, dtype=np.int32)
    texel_at[pixel] = np.arange(len(pixel), dtype=np.int32)
    cross = mesh.crosses
    flat = unit(cross)
    position, normal = np.empty((len(face), 3)), np.empty((len(face), 3), dtype=np.float32)
    for start in range(0, len(face), CHUNK):
        part = slice(start, start + CHUNK)
        centre = np.stack([(col[part] + 0.5) / resolution, 1 - (row[part] + 0.5) / resolution], axis=1)
        bary = barycentric(mesh.uv, mesh.faces, face[part], centre)
        corners = mesh.faces[face[part]]
        position[part] = np.einsum("pc,pcx->px", bary, mesh.vertices[corners])
        smooth = unit(np.einsum("pc,pcx->px", bary, mesh.normals[corners]))
        # Opposite vertex normals may cancel in the middle of a triangle.
        whole = np.linalg.norm(smooth, axis=1, keepdims=True) > 0.5
        normal[part] = np.where(whole, smooth, flat[face[part]])
    stretch = np.linalg.norm(cross, axis=1) / np.maximum(uv_doubled_areas(mesh), 1e-300)
    return Atlas(
        resolution=resolution,
        texel_at=texel_at.reshape(resolution, resolution),
        row=row.astype(np.int32),
        col=col.astype(np.int32),
        face=face.astype(np.int32),
        position=position,
        normal=normal,
        face_normal=flat,
        face_footprint=stretch / resolution**2,
    )


def uv_doubled_areas(mesh: Mesh) -> F64:
    """Twice the UV area of each face, F64[F] (of either orientation)."""
    assert mesh.uv is not None
    a, b, c = (mesh.uv[mesh.faces[:, i]] for i in range(3))
    ab, ac = b - a, c - a
    return np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])


def padded(atlas: Atlas) -> I32:
    """I32[H, W]: the texel at each pixel, or the nearest one in the gutter, for lookups across seams."""
    nearest = distance_transform_edt(atlas.texel_at < 0, return_distances=False, return_indices=True)
    return np.asarray(atlas.texel_at[nearest[0], nearest[1]])


def default_resolution(mesh: Mesh, cameras: Sequence[Camera]) -> int:
    """The resolution at which the median texel is about one pixel of the view that sees it best.

    A face that covers p pixels of its best view (facing it and inside the image; occlusion is ignored) and
    a share q of the UV square wants sqrt(p / q) texels along a side. The median of that over faces, weighted
    by their texels, is rounded up to a multiple of 64 and kept within [64, 2048]. Without UVs, q is the
    face's share of the surface times 0.6, what an unwrapping typically fills.
    """
    area = np.linalg.norm(mesh.crosses, axis=1)
    share = area / area.sum() * PACKING if mesh.uv is None else uv_doubled_areas(mesh) / 2
    best = np.zeros(len(mesh.faces))
    for camera in cameras:
        uv_px, depth = camera.project(mesh.vertices)
        corner, near = uv_px[mesh.faces], depth[mesh.faces].min(axis=1)
        ab, ac = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        # Counter-clockwise seen from outside turns clockwise with y down.
        pixels = (ab[:, 1] * ac[:, 0] - ab[:, 0] * ac[:, 1]) / 2
        middle = corner.mean(axis=1)
        inside = ((middle >= 0) & (middle < (camera.width, camera.height))).all(axis=1) & (near > 0)
        best = np.maximum(best, np.where(inside, pixels, 0.0))
    seen = (best > 0) & (share > 0)
    if not seen.any():
        return 64
    wanted = np.sqrt(best[seen] / share[seen])
    order = np.argsort(wanted)
    weight = np.cumsum(share[seen][order])
    median = wanted[order][np.searchsorted(weight, weight[-1] / 2)]
    return int(np.clip(np.ceil(median / 64) * 64, 64, 2048))

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The atlas: texels of the UV square and where each lies on the surface (the paper's points x, section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import distance_transform_edt

from swatchwork.arrays import F32, F64, I32, I64, norm, unit
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.keeping import Array
from swatchwork.surface.mesh import Mesh
from swatchwork.surface.raster import barycentric, covered_centres

# Share of the UV square that charts of an xatlas packing typically fill.
PACKING = 0.6
CHUNK = 1 << 18
"""Texels that are rasterised at once, about: 30 MB; a larger face is by itself."""


@dataclass(frozen=True)
class Atlas:
    """M texels of a square atlas, ordered by row, then column; row 0 is v = 1.

    ``pixel`` I32[M], row * W + column; ``face`` I32[M]; ``face_normal`` F64[F, 3], unit; ``face_footprint``
    F64[F], area of surface in a texel of each face (world units squared). A texel takes 8 bytes: what else
    there is of it is computed when asked.
    """

    resolution: int
    mesh: Mesh
    pixel: I32
    face: I32
    face_normal: F64
    face_footprint: F64

    def __len__(self) -> int:
        return len(self.pixel)

    @property
    def texel_at(self) -> I32:
        """[H, W]: the texel's number at each pixel, or -1."""
        found = np.full(self.resolution**2, -1, dtype=np.int32)
        found[self.pixel] = np.arange(len(self), dtype=np.int32)
        return found.reshape(self.resolution, self.resolution)

    @property
    def row(self) -> I32:
        """[M]"""
        return np.asarray(self.pixel // self.resolution)

    @property
    def col(self) -> I32:
        """[M]"""
        return np.asarray(self.pixel % self.resolution)

    def points(self, texel: I64 | slice) -> tuple[F64, F32]:
        """Positions [T, 3] in the world and unit shading normals [T, 3] of texels [T]."""
        mesh, face, pixel = self.mesh, self.face[texel], self.pixel[texel]
        assert mesh.uv is not None, "the atlas was made from them"
        row, col = np.divmod(pixel, self.resolution)
        centre = np.stack([(col + 0.5) / self.resolution, 1 - (row + 0.5) / self.resolution], axis=1)
        corners = mesh.faces.take(face, axis=0)
        bary = barycentric(mesh.uv, corners, centre)
        position = np.einsum("pc,pcx->px", bary, mesh.vertices.take(corners, axis=0))
        normal = unit(np.einsum("pc,pcx->px", bary, mesh.normals.take(corners, axis=0)))
        # Opposite vertex normals may cancel in the middle of a triangle.
        none = norm(normal) < 0.5
        normal[none] = self.face_normal[face[none]]
        return position, normal.astype(np.float32)

    def position(self, texel: I64 | slice) -> F64:
        """Positions [T, 3] of texels [T] in the world."""
        return self.points(texel)[0]

    def normal(self, texel: I64 | slice) -> F32:
        """Unit shading normals [T, 3] of texels [T]."""
        return self.points(texel)[1]

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
    if not np.isfinite(mesh.uv).all():
        raise InputError("a UV is not a finite number", expected="UVs in [0, 1]")
    if resolution < 1:
        raise InputError(f"atlas resolution is {resolution}", expected="at least 1")
    flat_areas = uv_doubled_areas(mesh)
    at = _first_face_at(mesh.uv, mesh.faces, flat_areas / 2, resolution)
    pixel = np.flatnonzero(at >= 0).astype(np.int32)
    if not len(pixel):
        raise InputError(
            "no texel lies on the surface", expected="UVs inside [0, 1]", hint="Raise --resolution."
        )
    cross = mesh.crosses
    stretch = np.linalg.norm(cross, axis=1) / np.maximum(flat_areas, 1e-300)
    return Atlas(
        resolution=resolution,
        mesh=mesh,
        pixel=pixel,
        face=at[pixel],
        face_normal=unit(cross),
        face_footprint=stretch / resolution**2,
    )


def _first_face_at(uv: F64, faces: I32, area: F64, resolution: int) -> I32:
    """I32[H * W]: the first face that holds each texel's centre, or -1.

    Overlaps are the caller's to judge (uv_problem).
    """
    at = np.full(resolution * resolution, -1, dtype=np.int32)
    texels = np.cumsum(np.minimum(area, 1)) * resolution**2
    cuts = np.unique(np.searchsorted(texels, np.arange(CHUNK, texels[-1], CHUNK)))
    for first, last in pairwise([0, *cuts, len(faces)]):
        face, row, col = covered_centres(uv, faces[first:last], resolution)
        pixel = row * resolution + col
        free = at[pixel] < 0
        # Of repeated places the last is kept.
        at[pixel[free][::-1]] = face[free][::-1] + first
    return at


def uv_doubled_areas(mesh: Mesh) -> F64:
    """Twice the UV area of each face, F64[F] (of either orientation)."""
    assert mesh.uv is not None
    a, b, c = (mesh.uv[mesh.faces[:, i]] for i in range(3))
    ab, ac = b - a, c - a
    return np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])


def padded(atlas: Atlas) -> I32:
    """I32[H, W]: the texel at each pixel, or the nearest one in the gutter, for lookups across seams."""
    texel_at = atlas.texel_at
    row, col = distance_transform_edt(texel_at < 0, return_distances=False, return_indices=True)
    found = np.empty_like(texel_at)
    for i in range(atlas.resolution):
        found[i] = texel_at[row[i], col[i]]
    return found


def fill_gutter(image: Array, atlas: Atlas, texel_of_pixel: I32) -> None:
    """Give each pixel in the gutter of an image [H, W, ...] its nearest texel's value, in place."""
    flat = image.reshape(atlas.resolution**2, *image.shape[2:])
    on_atlas = np.zeros(texel_of_pixel.shape, dtype=bool)
    on_atlas.ravel()[atlas.pixel] = True
    # Row by row: places of all pixels at once would be as large as the image.
    for row, texel, here in zip(image, texel_of_pixel, on_atlas, strict=True):
        row[~here] = flat[atlas.pixel[texel[~here]]]


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

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs of a known blend: rendered from the blend as a function of position, without any atlas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import F32, F64, I32, I64, U32, unit
from ..capture import Camera
from ..light import Environment
from ..reflectance import GenericBasis
from ..response import representative_responses
from ..surface import Mesh, RayScene, SkyMasks, build_atlas, padded, sky_masks
from .blends import dense_weights

RAYS = 4
"""Rays along the side of a shading cell; they measure coverage and average normals."""
CELLS_AT_ONCE = 1 << 15

Blend = Callable[[F64], tuple[U32, F64]]
"""Positions [S, 3] to indices [S, n] and weights [S, n]."""


@dataclass(frozen=True, eq=False)
class Subject:
    """An object with a known material."""

    mesh: Mesh
    basis: GenericBasis
    representatives: F64
    """[N, J, 3]"""
    blend: Blend
    rays: RayScene
    sky: SkyMasks
    sky_at: I32
    """[R, R]: rows of ``sky.of_texel`` over the mesh's UVs, row 0 at v = 1."""

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        basis: GenericBasis,
        representatives: F64,
        blend: Blend,
        sky_resolution: int = 192,
        sky_samples: int = 4000,
    ) -> Subject:
        """Trace the self-shadowing of a mesh with UVs, and keep it with the material."""
        rays, atlas = RayScene([mesh]), build_atlas(mesh, sky_resolution)
        sky = sky_masks(rays, atlas, sky_samples)
        return cls(mesh, basis, representatives, blend, rays, sky, padded(atlas))


def photograph(subject: Subject, camera: Camera, light: Environment, cells: int = 1) -> F32:
    """An image [H, W, 4], RGB premultiplied by coverage; cells x cells shadings of 4 x 4 rays a pixel."""
    image = np.zeros((camera.width * camera.height, 4))
    of_mesh = _box(subject.mesh, camera)
    at_once = max(1, (1 << 18) // (cells * RAYS) ** 2)
    for first in range(0, len(of_mesh), at_once):
        pixels = of_mesh[first : first + at_once]
        pixel, share, position, normal, texel = _cells(subject, camera, pixels, cells)
        for start in range(0, len(pixel), CELLS_AT_ONCE):
            part = slice(start, start + CELLS_AT_ONCE)
            radiance = _radiance(subject, camera, light, (position[part], normal[part], texel[part]))
            found = np.concatenate([radiance, np.ones((len(radiance), 1))], axis=1) * share[part, None]
            np.add.at(image, pixel[part], found)
    return image.reshape(camera.height, camera.width, 4).astype(np.float32)


def _box(mesh: Mesh, camera: Camera) -> I64:
    """Pixels of the rectangle that the mesh's vertices span."""
    uv, _ = camera.project(mesh.vertices)
    size = [camera.width, camera.height]
    low = np.clip(np.floor(np.nanmin(uv, axis=0)).astype(int) - 1, 0, size)
    high = np.clip(np.ceil(np.nanmax(uv, axis=0)).astype(int) + 1, low, size)
    rows, columns = np.arange(low[1], high[1]), np.arange(low[0], high[0])
    return np.asarray((rows[:, None] * camera.width + columns).ravel(), dtype=np.int64)


def _cells(subject: Subject, camera: Camera, pixels: I64, cells: int) -> tuple[I64, F64, F64, F64, I64]:
    """Pixel, share, mean position and normal, and a texel for shadows, of each cell that was hit.

    Where a cell spans a depth discontinuity its hits are not averaged: each is a cell of its own.
    """
    side = cells * RAYS
    offset = (np.arange(side) + 0.5) / side
    grid = np.stack(np.meshgrid(offset, offset), axis=-1).reshape(-1, 2)
    corner = np.stack([pixels % camera.width, pixels // camera.width], axis=-1)
    direction = camera.rays((corner[:, None] + grid).reshape(-1, 2))
    hit = subject.rays.first_hit(np.broadcast_to(camera.position, direction.shape), direction)
    at = np.flatnonzero(hit.mesh == 0)
    line = np.arange(side) // RAYS
    cell = (line[:, None] * cells + line).ravel()
    key = (at // side**2) * cells**2 + cell[at % side**2]
    order = np.argsort(key, kind="stable")
    at, key = at[order], key[order]
    if not len(at):
        return np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    t = hit.t[at]
    deep = np.maximum.reduceat(t, first) - np.minimum.reduceat(t, first) > 0.1 * subject.rays.radius
    starts = np.unique(np.concatenate([first, np.flatnonzero(deep[inverse])]))
    count = np.diff(np.append(starts, len(at)))[:, None]

    corners, bary = subject.mesh.faces[hit.face[at]], hit.bary[at]
    position = np.einsum("sc,scx->sx", bary, subject.mesh.vertices[corners])
    normal = np.einsum("sc,scx->sx", bary, subject.mesh.normals[corners])
    assert subject.mesh.uv is not None
    uv = np.einsum("sc,scx->sx", bary[starts], subject.mesh.uv[corners[starts]])
    size = len(subject.sky_at)
    place = np.clip((np.stack([1 - uv[:, 1], uv[:, 0]]) * size).astype(int), 0, size - 1)
    return (
        pixels[at[starts] // side**2],
        count[:, 0] / side**2,
        np.add.reduceat(position, starts) / count,
        unit(np.add.reduceat(normal, starts)),
        subject.sky_at[place[0], place[1]].astype(np.int64),
    )


def _radiance(subject: Subject, camera: Camera, light: Environment, points: tuple[F64, F64, I64]) -> F64:
    position, normal, texel = points
    to_viewer = unit(camera.position - position)
    # An interpolated normal may turn away at the rim, where the surface itself is still seen.
    cosine = np.einsum("sx,sx->s", normal, to_viewer)[:, None]
    bent = 0.02 * to_viewer + np.sqrt(1 - 0.02**2) * unit(normal - cosine * to_viewer)
    s = representative_responses(
        subject.basis,
        subject.representatives,
        light.pyramid(),
        np.where(cosine < 0.02, bent, normal),
        to_viewer,
        subject.sky.words,
        subject.sky.of_texel[texel],
    )
    full = dense_weights(*subject.blend(position), len(subject.representatives))
    return np.asarray(np.einsum("sn,snc->sc", full, s), dtype=np.float64)

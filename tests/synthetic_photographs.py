# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs of a textured, slightly glossy, bumpy object from known places; the lens distorts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import binary_erosion, map_coordinates

from swatchwork.arrays import dot, unit
from swatchwork.capture import Camera
from swatchwork.prepare.registering import View
from swatchwork.simulate.shapes import shape
from swatchwork.simulate.viewpoints import look_at
from swatchwork.surface import RayScene

LENS = Camera(600, 450, 980.0, 972.0, 304.0, 221.0, np.eye(4), k1=-0.15, k2=0.06, p1=0.001, p2=-0.0015)
COUNT = 8
STEP_DEG = 22.0
DISTANCE = 4.0
LIGHT = unit(np.array([0.3, -0.8, 0.6]))


@cache
def blob() -> RayScene:
    return RayScene([shape("blob", 96)])


@cache
def true_camera(index: int) -> Camera:
    """Photograph ``index`` of the round: 22 degrees about z after the last, at three heights."""
    rng = np.random.default_rng([index, 8])
    azimuth = np.radians(STEP_DEG * index - 100)
    height = (0.15, 0.5, 0.3)[index % 3]
    direction = unit(np.array([np.cos(azimuth), np.sin(azimuth), height]))
    pose = look_at(direction * DISTANCE * rng.uniform(0.95, 1.1), rng.normal(0, 0.03, 3))
    return replace(LENS, world_from_camera=pose)


def lens() -> Camera:
    return LENS


def noise(x: np.ndarray, seed: int) -> np.ndarray:
    """Values about 0.5 [P] at points [P, 3]: seeded grids of four finenesses, linear in between."""
    total = np.full(len(x), 0.5, dtype=np.float32)
    for octave, (cells, weight) in enumerate(((9, 0.25), (23, 0.25), (56, 0.25), (110, 0.3))):
        grid = np.random.default_rng([seed, octave]).uniform(-1, 1, (32,) * 3).astype(np.float32)
        at = (x.T * cells / 2 + 7.3).astype(np.float32)
        total += weight * map_coordinates(grid, at, order=1, mode="grid-wrap")
    return np.clip(total, 0.02, 1)


@cache
def photograph(index: int, texture: int | None = 1, size: float = 1.0) -> View:
    """Photograph ``index`` with the texture of a seed (None: plain), four samples a pixel, as displayed.

    ``size`` scales the lens's pixels.
    """
    scene, given = blob(), true_camera(index)
    camera = replace(
        given,
        width=round(given.width * size),
        height=round(given.height * size),
        **{name: getattr(given, name) * size for name in ("fx", "fy", "cx", "cy")},
    )
    total = np.zeros(camera.width * camera.height)
    covered = np.zeros(len(total), dtype=bool)
    for offset in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
        d = camera.rays(camera.pixel_centres() + offset)
        hit = scene.first_hit(np.broadcast_to(camera.position, d.shape), d)
        on = np.flatnonzero(hit.mesh >= 0)
        corner, bary = scene.meshes[0].faces[hit.face[on]], hit.bary[on]
        x = np.einsum("pc,pcx->px", bary, scene.meshes[0].vertices[corner])
        n = unit(np.einsum("pc,pcx->px", bary, scene.meshes[0].normals[corner]))
        albedo = np.full(len(x), 0.5) if texture is None else noise(x, texture)
        lit = 0.35 + 0.25 * n[:, 2] + 0.4 * np.maximum(0, n @ LIGHT)
        gloss = 0.5 * np.maximum(0, dot(n, unit(LIGHT - d[on]))) ** 40
        total[on] += albedo * lit + gloss
        covered[on] = True
    sensor = np.random.default_rng([index, 9]).normal(0, 0.003, len(total))
    code = 255 * np.clip(total / 4 + sensor, 0, 1) ** (1 / 2.2)
    gray = (code + 0.5).astype(np.uint8).reshape(camera.height, camera.width)
    region = covered.reshape(gray.shape)
    at_origin = replace(camera, world_from_camera=np.eye(4))
    return View(Path(f"p{index}.png"), at_origin, gray, binary_erosion(region))


def photographs(count: int = COUNT) -> list[View]:
    return [photograph(i) for i in range(count)]


def truth(count: int = COUNT) -> dict[str, Camera]:
    return {f"p{i}": true_camera(i) for i in range(count)}

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
from swatchwork.prepare.registering import Tracks, View, apart, moved
from swatchwork.simulate.shapes import shape
from swatchwork.simulate.viewpoints import look_at
from swatchwork.surface import RayScene, points_in_sight, surface_points

LENS = Camera(600, 450, 620.0, 615.0, 304.0, 221.0, np.eye(4), k1=-0.15, k2=0.06, p1=0.001, p2=-0.0015)
COUNT = 8
STEP_DEG = 20.0
DISTANCE = 2.6
LIGHT = unit(np.array([0.3, -0.8, 0.6]))


@cache
def blob() -> RayScene:
    return RayScene([shape("blob", 96)])


@cache
def true_camera(index: int) -> Camera:
    """Photograph ``index`` of the round: 20 degrees about z after the last, at three heights."""
    rng = np.random.default_rng([index, 8])
    azimuth = np.radians(STEP_DEG * index - 100)
    height = (0.15, 0.5, 0.3)[index % 3]
    direction = unit(np.array([np.cos(azimuth), np.sin(azimuth), height]))
    pose = look_at(direction * DISTANCE * rng.uniform(0.95, 1.1), rng.normal(0, 0.03, 3))
    return replace(LENS, world_from_camera=pose)


@cache
def lens(size: float = 1.0) -> Camera:
    return replace(
        LENS,
        width=round(LENS.width * size),
        height=round(LENS.height * size),
        **{name: getattr(LENS, name) * size for name in ("fx", "fy", "cx", "cy")},
    )


@cache
def rays(sample: int, size: float) -> np.ndarray:
    """Directions along the camera's axes through one of four places in each pixel."""
    offset = np.array([sample % 2, sample // 2]) / 2 - 0.25
    return lens(size).rays(lens(size).pixel_centres() + offset)


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
    camera = replace(lens(size), world_from_camera=given.world_from_camera)
    total = np.zeros(camera.width * camera.height)
    covered = np.zeros(len(total), dtype=bool)
    for sample in range(4):
        d = rays(sample, size) @ given.world_from_camera[:3, :3].T
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
    return View(Path(f"p{index}.png"), lens(size), gray, binary_erosion(region))


def photographs(count: int = COUNT) -> list[View]:
    return [photograph(i) for i in range(count)]


def truth(count: int = COUNT) -> dict[str, Camera]:
    return {f"p{i}": true_camera(i) for i in range(count)}


def true_tracks(count: int, noise_px: float, seed: int = 0, wrong: float = 0.0, bump: float = 0.0) -> Tracks:
    """Sightings of points spread over the object, without any picture.

    Args:
        noise_px: standard deviation along each axis.
        wrong: share of the sightings that are somewhere within 60 px instead.
        bump: standard deviation of the points from the mesh along its normals, world units.
    """
    rng = np.random.default_rng([seed, 10])
    points = surface_points(blob().meshes[0], count, seed)
    x = points.position + bump * rng.normal(size=count)[:, None] * points.normal
    track, frame, uv = [], [], []
    for f, camera in enumerate(truth().values()):
        to_camera = unit(camera.position - points.position)
        seen = points_in_sight(blob(), points, camera) & (dot(points.upright, to_camera) > 0.3)
        at = np.flatnonzero(seen)
        track.append(at)
        frame.append(np.full(len(at), f))
        uv.append(camera.project(x[at])[0])
    track, frame, uv = np.concatenate(track), np.concatenate(frame), np.concatenate(uv)
    uv += rng.normal(0, noise_px, uv.shape)
    off = rng.random(len(uv)) < wrong
    uv[off] += rng.uniform(-60, 60, (int(off.sum()), 2))
    keep = np.bincount(track, minlength=count)[track] > 1
    _, track = np.unique(track[keep], return_inverse=True)
    order = np.lexsort((frame[keep], track))
    names = tuple(truth())
    return Tracks(
        names,
        int(track.max()) + 1,
        track[order].astype(np.int32),
        frame[keep][order].astype(np.int32),
        uv[keep][order],
        np.full(len(order), max(noise_px, 0.1)),
        (),
        np.zeros((len(names), len(names)), np.int32),
    )


def worst(cameras: dict[str, Camera]) -> tuple[float, float]:
    """Largest angle (degrees) and share of the distance between poses by name and the true ones."""
    off = [apart(camera, cameras[name], np.zeros(3)) for name, camera in truth().items() if name in cameras]
    return max(angle for angle, _ in off), max(away for _, away in off)


def shaken(cameras: dict[str, Camera], degrees: float, away: float, seed: int = 3) -> dict[str, Camera]:
    """Each pose turned by an angle about some axis, and moved by about ``away`` (world units)."""
    rng = np.random.default_rng(seed)
    out = {}
    for name, camera in cameras.items():
        turn = np.radians(degrees) * unit(rng.normal(size=3))
        out[name] = moved(camera, np.concatenate([turn, away * unit(rng.normal(size=3))]))
    return out

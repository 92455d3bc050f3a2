# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs of a plain, textureless object that stands on a checkerboard, from known places."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from swatchwork.capture import Camera
from swatchwork.prepare import Checkerboard
from swatchwork.prepare.registering import Pairs, View
from swatchwork.simulate.shapes import shape
from swatchwork.simulate.viewpoints import look_at
from swatchwork.surface import RayScene, points_in_sight, surface_points

BOARD, SQUARE = Checkerboard(7, 4), 0.18
LENS = Camera(720, 560, 1000.0, 990.0, 365.0, 276.0, np.eye(4), k1=-0.12, k2=0.04, p1=0.001, p2=-0.0015)
COUNT = 4
SAMPLES = 2
"""Along each side of a pixel."""
MESH_FROM_BOARD = np.eye(4)
# The board's z looks down; it lies beside the object, in front of the first cameras, and a little turned.
MESH_FROM_BOARD[:3, :3] = Rotation.from_euler("zx", [20, 180], degrees=True).as_matrix()
MESH_FROM_BOARD[:3, 3] = [-0.75, 1.35, -0.75]


@cache
def thing() -> RayScene:
    return RayScene([shape("blob", 64)])


@cache
def true_camera(index: int) -> Camera:
    """In the mesh's world: on an arc of 120 degrees, from above."""
    azimuth, height = np.radians(30 + 40 * index), (0.9, 0.7, 1.0, 0.8)[index % 4]
    away = 5.5 * np.array([np.cos(azimuth), np.sin(azimuth), height]) / np.hypot(1, height)
    return replace(LENS, world_from_camera=look_at(away, np.array([0.0, 0.5, -0.3])))


@cache
def photograph(index: int) -> View:
    """Object, board and table, averaged over the samples of a pixel; its region where most samples hit."""
    camera, scene = true_camera(index), thing()
    total, share = np.zeros(LENS.width * LENS.height), np.zeros(LENS.width * LENS.height)
    board_from_mesh = np.linalg.inv(MESH_FROM_BOARD)
    for sample in range(SAMPLES**2):
        offset = (np.array([sample % SAMPLES, sample // SAMPLES]) + 0.5) / SAMPLES - 0.5
        d = camera.rays(camera.pixel_centres() + offset)
        hit = scene.first_hit(np.broadcast_to(camera.position, d.shape), d)
        on = hit.mesh == 0
        normal = np.einsum("sc,scx->sx", hit.bary, scene.meshes[0].normals[scene.meshes[0].faces[hit.face]])
        origin, way = board_from_mesh[:3] @ [*camera.position, 1], d @ board_from_mesh[:3, :3].T
        x, y = ((origin - origin[2] / way[:, 2:] * way)[:, :2] / SQUARE).T
        column, row = np.floor(x).astype(int), np.floor(y).astype(int)
        squares = (np.abs(column - 2.5) < 4) & (np.abs(row - 1) < 3)
        print_ = np.where(squares, np.where((column + row) % 2 == 0, 25, 225), 225)
        paper = (np.abs(x - 3) < 5) & (np.abs(y - 1.5) < 3.5)
        total += np.where(
            on, 70 + 110 * np.clip(normal @ [0.3, 0.5, 0.8], 0, 1), np.where(paper, print_, 120)
        )
        share += on
    gray = cv2.GaussianBlur(total.reshape(LENS.height, LENS.width) / SAMPLES**2, (0, 0), 0.7)
    region = (share > SAMPLES**2 / 2).reshape(gray.shape)
    return View(Path(f"b{index}.png"), LENS, (gray + 0.5).astype(np.uint8), region)


def photographs() -> list[View]:
    return [photograph(i) for i in range(COUNT)]


def truth() -> dict[str, Camera]:
    return {f"b{i}": true_camera(i) for i in range(COUNT)}


def clicks(index: int = 0, count: int = 8, noise_px: float = 1.5, seed: int = 5, scale: float = 1.0) -> Pairs:
    """Pairs of a photograph; the mesh's points times ``scale``."""
    rng = np.random.default_rng([seed, index])
    camera, points = true_camera(index), surface_points(thing().meshes[0], 400, seed)
    seen = np.flatnonzero(points_in_sight(thing(), points, camera))
    x = points.position[rng.choice(seen, count, replace=False)]
    return Pairs(f"b{index}.png", camera.project(x)[0] + rng.normal(0, noise_px, (count, 2)), scale * x)

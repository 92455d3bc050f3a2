# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A checkerboard before a lens: each pixel is the mean of where its rays meet the board's plane."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F32, F64
from swatchwork.capture import Camera

from . import lens

COLUMNS, ROWS = 9, 6
"""Inner corners."""
SAMPLES = 4
"""Along a pixel's side."""
WHITE, BLACK, BEHIND = 0.7, 0.04, 0.18
MARGIN = 1.0
"""Of white around the squares, in squares."""


def poses(count: int, seed: int) -> list[tuple[F64, F64]]:
    """Rotations and places of boards before a camera (x right, y down, z ahead), in squares: tilted by 15 to
    40 degrees in all directions, at places that fill the picture together."""
    rng = np.random.default_rng(seed)
    found = []
    for i in range(count):
        turn = 2 * np.pi * i / count * 5
        tilt = np.deg2rad(rng.uniform(15, 40))
        axis = np.array([np.cos(turn), np.sin(turn), 0.0]) * tilt
        rotation = Rotation.from_rotvec([0, 0, rng.normal() * 0.15]) * Rotation.from_rotvec(axis)
        depth = rng.uniform(17, 24)
        # A 4 x 3 grid of places.
        x, y = (i % 4 - 1.5) / 1.5, (i // 4 % 3 - 1.0)
        found.append(
            (np.asarray(rotation.as_matrix()), np.array([x * 0.16 * depth, y * 0.095 * depth, depth]))
        )
    return found


def seen_by(camera: Camera, pose: tuple[F64, F64]) -> F32:
    """Radiance F32[H, W, 3] of a board in a pose."""
    rotation, place = pose
    corners = lens.corner_slopes(camera)
    total = np.zeros((camera.height, camera.width))
    to_board = rotation.T
    start = to_board @ -place
    for s in (np.arange(SAMPLES) + 0.5) / SAMPLES:
        for t in (np.arange(SAMPLES) + 0.5) / SAMPLES:
            top = (1 - s) * corners[:-1, :-1] + s * corners[:-1, 1:]
            bottom = (1 - s) * corners[1:, :-1] + s * corners[1:, 1:]
            slopes = (1 - t) * top + t * bottom
            d = np.dstack([slopes, np.ones(slopes.shape[:2])]) @ to_board.T
            x = start[:2] - start[2] / d[..., 2:] * d[..., :2]
            total += shade(x)
    return np.repeat((total / SAMPLES**2)[..., None], 3, axis=-1).astype(np.float32)


def shade(x: F64) -> F64:
    """What is printed at points [..., 2] of the board's plane, the board's middle being 0."""
    square = np.floor(x + np.array([COLUMNS + 1, ROWS + 1]) / 2)
    inside = (np.abs(x) < [(COLUMNS + 1) / 2, (ROWS + 1) / 2]).all(axis=-1)
    paper = (np.abs(x) < [(COLUMNS + 1) / 2 + MARGIN, (ROWS + 1) / 2 + MARGIN]).all(axis=-1)
    printed = np.where(square.sum(axis=-1) % 2 == 0, BLACK, WHITE)
    return np.where(inside, printed, np.where(paper, WHITE, BEHIND))

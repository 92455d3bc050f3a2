# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Small motions of a camera, and what they do to points in its image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F64
from swatchwork.capture import Camera


def moved(camera: Camera, step: F64) -> Camera:
    """The camera after a small motion [6] in its own axes: rotation vector (radians), then translation.

    world_from_camera' = world_from_camera exp(step), to first order in the coupling of the two.
    """
    local = np.eye(4)
    local[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix()
    local[:3, 3] = step[3:]
    return replace(camera, world_from_camera=camera.world_from_camera @ local)


def motion_between(start: Camera, end: Camera) -> F64:
    """The motion [6] in the axes of ``start`` by which `moved` makes ``end`` of it."""
    local = np.linalg.inv(start.world_from_camera) @ end.world_from_camera
    return np.concatenate([Rotation.from_matrix(local[:3, :3]).as_rotvec(), local[:3, 3]])


def projected(camera: Camera, x_in_world: F64) -> tuple[F64, F64, F64]:
    """Points [P, 3] in the image, and how that changes.

    Returns:
        uv_px F64[P, 2] (NaN where not seen), its derivatives F64[P, 2, 6] by the step of `moved`, and
        F64[P, 2, 3] by the points in the world.
    """
    uv_px, _ = camera.project(x_in_world)
    rotation = camera.world_from_camera[:3, :3]
    x_in_camera = (x_in_world - camera.position) @ rotation
    by_camera = camera.slopes(x_in_world)
    # A camera that turns by w and moves by t sees x - w x x - t.
    x, y, z = x_in_camera.T
    zero = np.zeros_like(x)
    cross = np.stack([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    by_step = np.concatenate([by_camera @ cross, -by_camera], axis=-1)
    return uv_px, by_step, by_camera @ rotation.T


def turned_degrees(a: Camera, b: Camera) -> float:
    """Angle between the axes of two cameras."""
    turn = a.world_from_camera[:3, :3].T @ b.world_from_camera[:3, :3]
    return float(np.degrees(Rotation.from_matrix(turn).magnitude()))


def apart(a: Camera, b: Camera, about: F64) -> tuple[float, float]:
    """Angle between two poses in degrees, and the distance of their positions over a's from ``about``."""
    away = float(np.linalg.norm(a.position - b.position) / np.linalg.norm(a.position - about))
    return turned_degrees(a, b), away

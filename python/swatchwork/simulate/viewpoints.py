# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where cameras stand: uniform over the sphere with a shared initial subsequence, or on a ring."""

from __future__ import annotations

import numpy as np

from ..arrays import F64, Float, unit
from ..capture import Camera

DISTANCE = 4.0
"""From the object's centre, in units of its radius."""


ORIGIN = np.zeros(3)


def random_directions(count: int, seed: int = 0) -> F64:
    """Directions [count, 3] uniform over the sphere; fewer views of a seed are the first of more."""
    return unit(np.random.default_rng([seed, 3]).normal(size=(count, 3)))


def ring_directions(count: int, elevation_rad: float = 0.35) -> F64:
    """Directions [count, 3] evenly around the z axis at one elevation."""
    phi = 2 * np.pi * np.arange(count) / count
    level = np.cos(elevation_rad)
    return np.stack(
        [level * np.cos(phi), level * np.sin(phi), np.full(count, np.sin(elevation_rad))], axis=-1
    )


def look_at(position: Float, target: Float = ORIGIN) -> F64:
    """world_from_camera [4, 4] of a camera at ``position`` that looks at ``target``, z up."""
    backward = unit(np.asarray(position, np.float64) - np.asarray(target, np.float64))
    up = np.array([0.0, 0.0, 1.0]) if abs(backward[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = unit(np.cross(up, backward))
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(backward, right), backward], axis=-1)
    pose[:3, 3] = position
    return pose


def camera_towards(direction: Float, size: int, radius: float = 1.0, distance: float = DISTANCE) -> Camera:
    """A square camera whose picture a sphere of ``radius`` about the origin fills to 92 %."""
    tangent = 1 / np.sqrt(distance**2 - 1)
    focal = 0.92 * size / 2 / tangent
    return Camera(
        width=size,
        height=size,
        fx=focal,
        fy=focal,
        cx=size / 2,
        cy=size / 2,
        world_from_camera=look_at(unit(direction) * distance * radius),
    )

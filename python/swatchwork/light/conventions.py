# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How pixels of an environment map stand for directions, in the environment's own axes.

With (u, v) in [0, 1] right and down from the image's top left corner:

- ``blender`` (z up): phi = pi - 2 pi u, theta = pi v,
  d = (sin theta cos phi, sin theta sin phi, cos theta)
- ``mitsuba`` (y up): u = atan2(x, -z) / 2 pi (mod 1), v = acos(y) / pi
- ``debevec-angular`` (x right, y up, centre -z): with a, b in [-1, 1] right and up,
  (a, b) = (x, y) r, r = acos(-z) / (pi sqrt(x^2 + y^2)); only a^2 + b^2 <= 1 is part of the sphere

The functions keep float32 as float32, and stay accurate there: polar angles come from atan2, not acos.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from swatchwork.arrays import F64, Float
from swatchwork.capture import CONVENTIONS
from swatchwork.errors import InputError

PI = np.pi
Floats = npt.NDArray[Any]


def check_convention(convention: str) -> None:
    """Raises InputError for a name that is none of `CONVENTIONS`."""
    if convention not in CONVENTIONS:
        raise InputError(
            f"environment convention {convention!r}", expected="one of " + ", ".join(CONVENTIONS)
        )


def direction_from_uv(convention: str, uv: Float) -> Floats:
    """Unit directions [..., 3] of image points [..., 2]; NaN outside an angular map's disc.

    Raises:
        InputError: unknown convention.
    """
    check_convention(convention)
    points = _floating(uv)
    u, v = points[..., 0], points[..., 1]
    if convention == "debevec-angular":
        a, b = 2 * u - 1, 1 - 2 * v
        radius = np.hypot(a, b)
        theta = PI * radius
        # sin(theta) / radius, through sinc so that the centre needs no case of its own.
        slope = PI * np.sinc(radius)
        directions = np.stack([slope * a, slope * b, -np.cos(theta)], axis=-1)
        directions[radius > 1] = np.nan
        return directions
    theta = PI * v
    if convention == "blender":
        phi = PI - 2 * PI * u
        return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    phi = 2 * PI * u
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=-1)


def uv_from_direction(convention: str, d: Float) -> Floats:
    """Image points [..., 2] in [0, 1] of directions [..., 3], which need not be of unit length.

    Raises:
        InputError: unknown convention.
    """
    check_convention(convention)
    vectors = _floating(d)
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    if convention == "debevec-angular":
        across = np.hypot(x, y)
        radius = np.arctan2(across, -z) / PI
        # Straight ahead is the centre; straight behind is all of the rim, of which one point is taken.
        on_axis = across == 0
        scale = radius / np.where(on_axis, 1, across)
        a = np.where(on_axis, radius, x * scale)
        return np.stack([(1 + a) / 2, (1 - y * scale) / 2], axis=-1)
    if convention == "blender":
        u = 0.5 - np.arctan2(y, x) / (2 * PI)
        return np.stack([u, np.arctan2(np.hypot(x, y), z) / PI], axis=-1)
    u = np.mod(np.arctan2(x, -z) / (2 * PI), 1)
    return np.stack([u, np.arctan2(np.hypot(x, z), y) / PI], axis=-1)


def solid_angles(convention: str, height: int, width: int) -> F64:
    """Steradians of each pixel, F64[H, W], 4 pi in all; 0 outside an angular map's disc.

    Raises:
        InputError: unknown convention.
    """
    check_convention(convention)
    if convention == "debevec-angular":
        # d omega = pi sin(pi r) / r da db, at pixel centres; vanishes towards the rim.
        a, b = (2 * np.arange(width) + 1) / width - 1, 1 - (2 * np.arange(height) + 1) / height
        radius = np.hypot(a[None, :], b[:, None])
        weight = np.where(radius <= 1, np.sinc(radius), 0.0)
        return np.asarray(weight * (4 * PI / weight.sum()))
    edges = np.cos(np.linspace(0, PI, height + 1))
    rows = (edges[:-1] - edges[1:]) * (2 * PI / width)
    return np.asarray(np.repeat(rows[:, None], width, axis=1))


def vertical(convention: str, world_from_environment: F64) -> F64:
    """The world's direction F64[3] that an environment's up axis points along.

    Raises:
        InputError: unknown convention.
    """
    check_convention(convention)
    return np.asarray(world_from_environment[:, 2 if convention == "blender" else 1], dtype=np.float64)


def _floating(values: Any) -> Floats:
    array = np.asarray(values)
    return array if array.dtype == np.float32 else np.asarray(array, dtype=np.float64)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The equal-area octahedral map (Clarberg 2008) between the square [0, 1]^2 and the unit sphere.

Environments are stored, and self-shadowing is masked, on this square: every pixel of a size-S raster
subtends the same solid angle, 4 pi / S^2, so a mip level is an area mean. Pixel (row j, column i)
covers a in [i/S, (i+1)/S] and b in [j/S, (j+1)/S]. The pole +z lies in the middle, -z at the corners.
The Rust core has the same mapping; this is its plain twin.
"""

from __future__ import annotations

import numpy as np

from swatchwork.arrays import F64, Float


def square_from_direction(d: Float) -> F64:
    """Unit directions [..., 3] to points (a, b) [..., 2] of the square; the sign of 0 is +1."""
    d = np.asarray(d, dtype=np.float64)
    x, y, z = np.abs(d[..., 0]), np.abs(d[..., 1]), np.abs(d[..., 2])
    # sqrt(1 - z) cancels near the poles; (x^2 + y^2) / (1 + z) is the same for unit vectors.
    r = np.sqrt((x * x + y * y) / (1 + z))
    b = np.arctan2(y, x) * (2 / np.pi) * r
    a = r - b
    lower = d[..., 2] < 0
    a, b = np.where(lower, 1 - b, a), np.where(lower, 1 - a, b)
    a = np.where(d[..., 0] < 0, -a, a)
    b = np.where(d[..., 1] < 0, -b, b)
    return np.stack([(a + 1) / 2, (b + 1) / 2], axis=-1)


def direction_from_square(ab: Float) -> F64:
    """Points (a, b) [..., 2] of the square to unit directions [..., 3]; inverse of the above."""
    ab = 2 * np.asarray(ab, dtype=np.float64) - 1
    a, b = np.abs(ab[..., 0]), np.abs(ab[..., 1])
    # Signed distance from the diamond |a| + |b| = 1, the image of the equator.
    d = 1 - (a + b)
    r = 1 - np.abs(d)
    lower = d < 0
    # In the lower half (a, b) = (1 - b', 1 - a'), hence b' = 1 - a where b' = phi' r.
    folded = np.where(lower, 1 - a, b)
    phi = np.where(r > 0, folded / np.where(r > 0, r, 1.0), 0.0) * (np.pi / 2)
    s = r * np.sqrt(np.maximum(2 - r * r, 0.0))
    x = np.copysign(np.cos(phi) * s, ab[..., 0])
    y = np.copysign(np.sin(phi) * s, ab[..., 1])
    z = np.where(lower, r * r - 1, 1 - r * r)
    return np.stack([x, y, z], axis=-1)


def cell_directions(size: int) -> F64:
    """Directions of the cell centres of a size x size raster, [size, size, 3] (row, column)."""
    centre = (np.arange(size) + 0.5) / size
    a, b = np.meshgrid(centre, centre)
    return direction_from_square(np.stack([a, b], axis=-1))

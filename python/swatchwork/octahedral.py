# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The equal-area octahedral map (Clarberg 2008) between the square [0, 1]^2 and the unit sphere.

Environments are stored, and self-shadowing is masked, on this square: every pixel of a size-S raster
subtends the same solid angle, 4 pi / S^2, so a mip level is an area mean. Pixel (row j, column i)
covers a in [i/S, (i+1)/S] and b in [j/S, (j+1)/S]. The pole +z lies in the middle, -z at the corners.
The Rust core has the same mapping; this is its plain twin.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from swatchwork.arrays import Float

Floats = npt.NDArray[Any]


def square_from_direction(d: Float) -> Floats:
    """Unit directions [..., 3] to points (a, b) [..., 2]; the sign of 0 is +1; float32 stays float32."""
    d = _floating(d)
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    # sqrt(1 - |z|) cancels near the poles; this is the same for unit vectors.
    r = np.sqrt((x * x + y * y) / (1 + np.abs(z)))
    b = np.arctan2(np.abs(y), np.abs(x)) * d.dtype.type(2 / np.pi) * r
    a = r - b
    a, b = np.where(z < 0, 1 - b, a), np.where(z < 0, 1 - a, b)
    return np.stack([(np.where(x < 0, -a, a) + 1) / 2, (np.where(y < 0, -b, b) + 1) / 2], axis=-1)


def direction_from_square(ab: Float) -> Floats:
    """Points (a, b) [..., 2] of the square to unit directions [..., 3]; float32 stays float32."""
    ab = _floating(ab)
    signed = 2 * ab - 1
    a, b = np.abs(signed[..., 0]), np.abs(signed[..., 1])
    # In the lower half, beyond the diamond |a| + |b| = 1, (a, b) = (1 - b', 1 - a').
    below = a + b > 1
    a, b = np.where(below, 1 - b, a), np.where(below, 1 - a, b)
    r = a + b
    phi = b / np.where(r > 0, r, 1) * ab.dtype.type(np.pi / 2)
    across = r * np.sqrt(2 - r * r)
    z = 1 - r * r
    return np.stack(
        [
            np.copysign(across * np.cos(phi), signed[..., 0]),
            np.copysign(across * np.sin(phi), signed[..., 1]),
            np.where(below, -z, z),
        ],
        axis=-1,
    )


def pixel_directions(size: int, rows: slice = slice(None), dtype: Any = np.float64) -> Floats:
    """Directions [R, size, 3] through the pixel centres of a raster's rows (all of them by default)."""
    centres = ((np.arange(size) + 0.5) / size).astype(dtype)
    b, a = np.meshgrid(centres[rows], centres, indexing="ij")
    return direction_from_square(np.stack([a, b], axis=-1))


def _floating(values: Float) -> Floats:
    values = np.asarray(values)
    return values if np.issubdtype(values.dtype, np.floating) else values.astype(np.float64)

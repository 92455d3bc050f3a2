# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The equal-area octahedral map (Clarberg 2008): unit sphere to unit square, z up in the middle.

Pixel (row j, column i) of a raster of size S covers a in [i/S, (i+1)/S] and b in [j/S, (j+1)/S], and
subtends 4 pi / S^2 wherever it lies, so that a mean of pixels is a mean over solid angle. The Rust core
has the same map.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from swatchwork.arrays import Float

Floats = npt.NDArray[Any]


def square_from_direction(d: Float) -> Floats:
    """Points (a, b) [..., 2] in [0, 1] of unit directions [..., 3]; float32 stays float32."""
    d = np.asarray(d)
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    # sqrt(1 - |z|), written so that it keeps its digits near the poles.
    r = np.sqrt((x * x + y * y) / (1 + np.abs(z)))
    b = np.arctan2(np.abs(y), np.abs(x)) * d.dtype.type(2 / np.pi) * r
    a = r - b
    a, b = np.where(z < 0, 1 - b, a), np.where(z < 0, 1 - a, b)
    return np.stack([(np.where(x < 0, -a, a) + 1) / 2, (np.where(y < 0, -b, b) + 1) / 2], axis=-1)


def direction_from_square(ab: Float) -> Floats:
    """Unit directions [..., 3] of points (a, b) [..., 2] in [0, 1]; float32 stays float32."""
    ab = np.asarray(ab)
    signed = 2 * ab - 1
    a, b = np.abs(signed[..., 0]), np.abs(signed[..., 1])
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
    """Directions [R, size, 3] through the pixel centres of a raster's rows."""
    centres = ((np.arange(size) + 0.5) / size).astype(dtype)
    b, a = np.meshgrid(centres[rows], centres, indexing="ij")
    return direction_from_square(np.stack([a, b], axis=-1))

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Array types, and the letters used everywhere.

M texels, P visible (texel, view) pairs, k views, K = 3k measurements, J generic kernels a colour
channel, N representatives, n of them blended at a texel. A transform is named ``a_from_b``, a point
or direction ``x_in_a`` (in the world where nothing is said); units are suffixes (``_px``, ``_rad``).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]
U64 = npt.NDArray[np.uint64]
Bool = npt.NDArray[np.bool_]
Float = npt.NDArray[np.floating[Any]]


def unit(v: Float) -> F64:
    """Vectors [..., 3] scaled to length 1; a zero vector stays zero."""
    v = np.asarray(v, dtype=np.float64)
    length = norm(v)
    return v / np.where(length > 0, length, 1.0)[..., None]


def dot(a: Float, b: Float) -> F64:
    """Scalar products [...] of vectors [..., 3]; sums along so short an axis take NumPy ten times as long."""
    return np.asarray(np.einsum("...x,...x->...", a, b))


def norm(v: Float) -> F64:
    """Lengths [...] of vectors [..., 3]."""
    return np.sqrt(dot(v, v))


def fibonacci_sphere(count: int) -> F64:
    """Points [count, 3] spread evenly over the unit sphere."""
    i = np.arange(count) + 0.5
    z, phi = 1 - 2 * i / count, i * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


DARK = 0.02
"""A texel darker than this share of the typical one (root mean square) counts as that dark in a relative
error: near-black texels carry noise, not reflectance, and would outvote the rest."""

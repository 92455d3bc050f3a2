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
U32 = npt.NDArray[np.uint32]
U64 = npt.NDArray[np.uint64]
Bool = npt.NDArray[np.bool_]
Float = npt.NDArray[np.floating[Any]]


def unit(v: Float) -> F64:
    """Vectors [..., 3] scaled to length 1; a zero vector stays zero."""
    v = np.asarray(v, dtype=np.float64)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return v / np.where(length > 0, length, 1.0)

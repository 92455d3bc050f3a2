# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Known blends: which n of N materials lie at a surface point, and with what weights."""

from __future__ import annotations

import numpy as np

from ..arrays import F64, U32
from ..material import dense
from .environments import waves


def blend_pattern(
    position: F64,
    *,
    materials: int = 4,
    blended: int = 2,
    seed: int = 0,
    sharp: bool = False,
    patches: float = 2.5,
) -> tuple[U32, F64]:
    """Indices [M, n] and convex weights [M, n] at points [M, 3] of an object about one unit in size.

    Every material has a smooth random field (patches with some finer texture). A point blends the n
    materials whose fields are largest; a weight is the field's excess over the first one left out, so
    weights vary continuously even where the support changes. With ``sharp`` the patches have hard
    edges: the support comes from coarse fields and the weights from finer ones of their own. ``patches`` is
    the coarse fields' frequency (radians a unit): with few, a material may be missing from the object.
    """
    if not 1 <= blended <= materials:
        raise ValueError(f"cannot blend {blended} of {materials} materials")
    rng = np.random.default_rng([seed, 1])
    fields = np.stack(
        [waves(position, rng, patches) + 0.35 * waves(position, rng, 14.0) for _ in range(materials)], axis=-1
    )
    order = np.argsort(-fields, axis=-1, kind="stable")[:, :blended]
    chosen = np.take_along_axis(fields, order, axis=-1)
    if sharp or blended == materials:
        texture = np.stack([waves(position, rng, 5.0) for _ in range(materials)], axis=-1)
        excess = np.exp(2 * np.take_along_axis(texture, order, axis=-1))
    else:
        rest = np.sort(fields, axis=-1)[:, -blended - 1]
        excess = chosen - rest[:, None] + 1e-12
    return order.astype(np.uint32), excess / excess.sum(axis=-1, keepdims=True)


def dense_weights(index: U32, weight: F64, materials: int) -> F64:
    """Blend weights as a full matrix [M, N]; repeated indices add up."""
    return dense(index, weight, materials)

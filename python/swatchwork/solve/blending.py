# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Blend optimisation (Eq. 12): the weights of each texel, given the representatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .._native import blend as native_blend
from .._native import blend_slots
from ..arrays import F32, F64, I64, U32

Search = Literal["exact", "pruned", "brute"]
"""``exact``: branch and bound, the global optimum; ``brute``: every support; ``pruned``: section 6."""

PRUNING_SAMPLE = 0.05
PRUNING_COVER = 0.99


@dataclass(frozen=True)
class Blend:
    """Blend weights of M texels over N representatives."""

    weights: F64
    """[M, N], rows sum to 1, at most n of them above zero."""
    squared_error: F64
    """[M] ||s_hat_x - s_x||^2."""
    visited: int
    """Supports (relaxations) looked at, over all texels."""


@dataclass(frozen=True)
class SparseBlend:
    """Blend weights of M texels in n slots each: what large tiles keep."""

    index: U32
    """[M, n] representatives, the largest weight first; an unused slot repeats the first."""
    weight: F32
    """[M, n] rows sum to 1; unused slots have weight 0."""
    squared_error: F64
    """[M] ||s_hat_x - s_x||^2."""
    visited: int
    """Supports (relaxations) looked at, over all texels."""

    def dense(self, count: int) -> F64:
        """Weights [M, count] over all representatives."""
        weights = np.zeros((len(self.index), count))
        for slot in range(self.index.shape[1]):
            weights[np.arange(len(weights)), self.index[:, slot]] += self.weight[:, slot]
        return weights


def blend(
    responses: F32,
    radiance: F32,
    offsets: I64,
    n: int,
    *,
    search: Search = "exact",
    previous: F64 | None = None,
    seed: int = 0,
) -> Blend:
    """The best blends of at most n representatives.

    Args:
        responses: [P, N, 3] of the representatives (Eq. 14).
        radiance: [P, 3] measured.
        offsets: [M + 1] pairs of each texel.
        n: most representatives a texel may blend.
        search: how supports are searched.
        previous: [M, N] last weights, tried first.
        seed: of the pruned search's sample of texels.
    """
    weights, squared_error, visited = native_blend(
        np.ascontiguousarray(responses, dtype=np.float32),
        np.ascontiguousarray(radiance, dtype=np.float32),
        np.ascontiguousarray(offsets, dtype=np.int64),
        n,
        search,
        previous,
        PRUNING_SAMPLE,
        PRUNING_COVER,
        seed,
    )
    return Blend(weights, squared_error, visited)


def sparse_blend(
    responses: F32, radiance: F32, offsets: I64, n: int, *, search: Search = "exact", seed: int = 0
) -> SparseBlend:
    """The same blends as ``blend``, in n slots a texel and 32 bits."""
    return SparseBlend(
        *blend_slots(
            np.ascontiguousarray(responses, dtype=np.float32),
            np.ascontiguousarray(radiance, dtype=np.float32),
            np.ascontiguousarray(offsets, dtype=np.int64),
            n,
            search,
            PRUNING_SAMPLE,
            PRUNING_COVER,
            seed,
        )
    )

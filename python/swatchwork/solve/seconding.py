# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Which of several blends a texel's own measurements agree with: where they are too few to vote on one."""

from __future__ import annotations

import numpy as np

from ..arrays import F32, F64, I64, U8
from .trimming import BOUND, blended, deviations, expected


def seconded(
    responses: F32,
    radiance: F32,
    offsets: I64,
    index: U8 | I64,
    weight: F32,
    scale: float,
    usual: float | None = None,
) -> tuple[I64, I64]:
    """The best candidate [M] of each texel, and how many of the texel's views [M] agree with it.

    Views agree within BOUND times ``scale``. The best has the least sum of squares cut off at that; of
    equals, the first.

    Args:
        responses: [P, N, 3] of the representatives; ``radiance`` [P, 3]; ``offsets`` [M + 1].
        index: [M, K, n] representatives that each candidate blends, by ``weight`` [M, K, n].
        scale: as `spread` gives it.
        usual: as `expected` takes it.
    """
    size = expected(radiance, offsets, usual)
    texel = np.repeat(np.arange(len(index)), np.diff(offsets))
    best, agreeing = np.zeros(len(index), np.int64), np.zeros(len(index), np.int64)
    least: F64 = np.full(len(index), np.inf)
    # Candidate by candidate: all at once would take K times the responses' memory.
    for k in range(index.shape[1]):
        fitted = blended(responses, index[texel, k], weight[texel, k])
        off = deviations(fitted, radiance, size) / (BOUND * scale)
        cost = np.add.reduceat(np.minimum(off, 1) ** 2, offsets[:-1])
        better = cost < least
        best[better], least[better] = k, cost[better]
        agreeing[better] = np.add.reduceat(off <= 1, offsets[:-1], dtype=np.int64)[better]
    return best, agreeing

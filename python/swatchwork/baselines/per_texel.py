# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Every texel by itself: non-negative weights of generic kernels, from that texel's own measurements.

What is left of Eq. 5 without the penalty on N: the whole generic basis serves as representatives, and
nothing is shared between texels. With few kernels a texel the sparse blend is kept, without it nothing is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from ..arrays import F64
from .method import Measurements, Recovered, single_kernels

RIDGE = 1e-2
"""Of the strongest kernel's response: without it a kernel that hardly answers takes any weight."""


@dataclass(frozen=True)
class PerTexel:
    """Non-negative least squares (Lawson and Hanson 1974) a texel and channel."""

    most: int | None = None
    """Kernels of a channel that a texel may have, chosen greedily by what they explain; None: all."""
    name: str = "every texel by itself"

    def recover(self, measurements: Measurements) -> Recovered:
        """Weights of all 3 J kernels at each texel."""
        m, J = measurements, measurements.basis.kernels
        weights = np.zeros((m.texels, J, 3))
        responses, radiance = m.responses.astype(np.float64), m.radiance.astype(np.float64)
        for x in range(m.texels):
            pairs = slice(m.offsets[x], m.offsets[x + 1])
            for c in range(3):
                weights[x, :, c] = _fitted(responses[pairs, :, c], radiance[pairs, c], self.most)
        return Recovered(m.basis, single_kernels(J), weights.reshape(m.texels, -1), 3 * J, "converged")


def _fitted(a: F64, y: F64, most: int | None) -> F64:
    """Weights [J] of columns [k, J] for measurements [k]."""
    J = a.shape[1]
    ridge = RIDGE * np.linalg.norm(a, axis=0).max()
    rows, right = np.concatenate([a, ridge * np.eye(J)]), np.concatenate([y, np.zeros(J)])
    if most is None:
        return np.asarray(nnls(rows, right, maxiter=30 * J)[0])
    # Orthogonal matching pursuit: the column most along the residual joins, then all are fitted anew.
    length = np.linalg.norm(rows, axis=0)
    chosen: list[int] = []
    found, residual = np.zeros(J), right
    for _ in range(most):
        along = rows.T @ residual / length
        best = int(along.argmax())
        if along[best] <= 0 or best in chosen:
            break
        chosen.append(best)
        found = np.zeros(J)
        found[chosen] = nnls(rows[:, chosen], right)[0]
        residual = right - rows @ found
    return found

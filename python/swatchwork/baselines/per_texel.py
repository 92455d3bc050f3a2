# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Every texel by itself: non-negative weights of all generic kernels, from that texel's own measurements.

What is left of Eq. 5 without the penalty on N: the whole generic basis serves as representatives, and
nothing is shared between texels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from .method import Measurements, Recovered, single_kernels

RIDGE = 1e-2
"""Of the strongest kernel's response: without it a kernel that hardly answers takes any weight."""


@dataclass(frozen=True)
class PerTexel:
    """Non-negative least squares (Lawson and Hanson 1974) a texel and channel."""

    name: str = "no sparse basis"

    def recover(self, measurements: Measurements) -> Recovered:
        m = measurements
        J = m.basis.kernels
        weights = np.zeros((m.texels, J, 3))
        responses, radiance = m.responses.astype(np.float64), m.radiance.astype(np.float64)
        for x in range(m.texels):
            pairs = slice(m.offsets[x], m.offsets[x + 1])
            for c in range(3):
                a = responses[pairs, :, c]
                ridge = RIDGE * np.linalg.norm(a, axis=0).max() * np.eye(J)
                rows, right = np.concatenate([a, ridge]), np.concatenate([radiance[pairs, c], np.zeros(J)])
                weights[x, :, c] = nnls(rows, right, maxiter=30 * J)[0]
        return Recovered(m.basis, single_kernels(J), weights.reshape(m.texels, -1), 3 * J, "converged")

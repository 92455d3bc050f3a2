# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""N single-lobe materials, two blended at each texel (Goldman et al. 2010); light and normals are known.

Weights and materials are fitted in turn, as there: the two materials of a texel by trying all pairs, a
material's roughness by trying all of the basis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F64
from ..solve import blend
from .clustering import Clustering
from .lobes import single_lobe
from .method import Measurements, Recovered

COUNTS = (5, 10, 15, 20, 25)
"""N that are tried (Zhou et al. 2016, section 7.1)."""


@dataclass(frozen=True)
class Goldman:
    """The N of ``counts`` with the least error is kept."""

    counts: tuple[int, ...] = COUNTS
    rounds: int = 40
    """Alternations at most."""
    tolerance: float = 2e-3
    """Relative decrease of the error at which they end."""
    name: str = "Goldman et al."

    def recover(self, measurements: Measurements) -> Recovered:
        fits = [self._with(measurements, N) for N in self.counts]
        return min(fits, key=lambda found: found.found["data"])

    def _with(self, m: Measurements, N: int) -> Recovered:
        materials = Clustering(N).recover(m).representatives
        n, status, data = min(2, N), "iteration limit", np.inf
        for _ in range(self.rounds):
            found = blend(m.problem.fold(materials), m.radiance, m.offsets, n)
            before, data = data, m.problem.mean(found.squared_error)
            if before - data < self.tolerance * data:
                status = "converged"
                break
            materials = _refitted(m, materials, found.weights)
        found = blend(m.problem.fold(materials), m.radiance, m.offsets, n)
        data = m.problem.mean(found.squared_error)
        return Recovered(m.basis, materials, found.weights, N, status, {"n": n, "N": N, "data": data})


def _refitted(m: Measurements, materials: F64, weights: F64) -> F64:
    """Each material fitted in turn to what the others leave of the texels that it has a part in."""
    materials = materials.copy()
    full = weights[m.texel]
    folded = m.problem.fold(materials).astype(np.float64)
    radiance = np.einsum("pn,pnc->pc", full, folded)
    for k in np.flatnonzero(weights.sum(axis=0) > 0):
        pairs = full[:, k] > 0
        share = full[pairs, k]
        rest = m.radiance[pairs] - (radiance[pairs] - share[:, None] * folded[pairs, k])
        # share * s = rest, by the texel's gamma: divided by the share, its square is in the weight.
        weight = m.problem.gamma[m.texel[pairs]] * share**2
        materials[k] = single_lobe(m.basis, m.responses[pairs], rest / share[:, None], weight)
        fresh = np.einsum("pjc,jc->pc", m.responses[pairs], materials[k])
        radiance[pairs] += share[:, None] * (fresh - folded[pairs, k])
    return materials

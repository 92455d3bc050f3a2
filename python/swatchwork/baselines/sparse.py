# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The paper's method, whole or without one of its two sparseness terms, behind the common interface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ..solve import SolveOptions, solve
from .method import Measurements, Recovered

PATIENCE = 2
"""Representatives added in vain before growth stops, as in the whole method."""


@dataclass(frozen=True)
class SparseAsPossible:
    """Eq. 5 with both terms (Zhou et al. 2016)."""

    options: SolveOptions = field(default_factory=SolveOptions)
    name: str = "sparse as possible"

    def recover(self, measurements: Measurements) -> Recovered:
        solution = solve(measurements.problem, self.options)
        return Recovered(
            measurements.basis,
            solution.representatives,
            solution.weights,
            solution.N,
            solution.status,
            {"n": solution.n, "N": solution.N, "data": solution.data, "noise": solution.noise},
        )


@dataclass(frozen=True)
class NoSparseBlend:
    """Eq. 5 without the penalty on n: every texel may blend all representatives (n = N)."""

    options: SolveOptions = field(default_factory=SolveOptions)
    name: str = "no sparse blend"

    def recover(self, measurements: Measurements) -> Recovered:
        """N grows for as long as the penalty on N is paid for; the paper's ablation with lambda0 = 0."""
        best: tuple[float, Recovered] | None = None
        penalty = self.options.lambda1
        if penalty is None:
            # The noise that the whole method finds sets the penalty; without it N would be a matter of taste.
            penalty = SparseAsPossible(self.options).recover(measurements).found["noise"] ** 2
        in_vain = 0
        for N in range(1, self.options.max_N + 1):
            options = replace(self.options, n=N, N=N, lambda0=0.0, lambda1=penalty)
            found = SparseAsPossible(options).recover(measurements)
            objective = found.found["data"] + penalty * N
            in_vain = 0 if best is None or objective < best[0] else in_vain + 1
            if best is None or objective < best[0]:
                best = (objective, found)
            if in_vain == PATIENCE:
                break
        assert best is not None
        return best[1]

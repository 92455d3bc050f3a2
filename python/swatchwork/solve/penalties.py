# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Penalties on n and N (Eq. 4): fixed, or automatic from what the model leaves (design section 3).

A further weight at a texel with K measurements fits noise of relative variance v by about v / K of the
data term, so the sparser model is to be preferred until a weight gains a small multiple of that, and a
representative a share of v. What counts as noise is all that the model cannot say: sensor noise, and the
basis' own misfit.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, log

import numpy as np

from ..arrays import F64

LEAST_LEFT = 0.1
"""Share of the measurements that a model's freedoms must leave for its residual to be an estimate."""

GAIN = 5.0
"""A further weight at every texel has to gain this many times what it would from noise alone. By
measurement: below 4.5 a sphere of measured materials, k = 12, gets three, and novel-light NRMS rises from
6.2 to 8.0 %."""

MISFIT = 0.5
"""And this share of the noise variance on top: misfit, unlike noise, is alike from view to view, so that a
blend of more representatives soaks it up however many the views. By measurement, twelve views of two
captures of measured materials: a third weight gains 0.1 to 0.5 of the variance, the second 7 to 20."""

SHARE = 1.0
"""A further representative has to take this many times the noise variance off the data term. On the same
captures, a blend of four, the fifth takes 0.25 to 0.96, the fourth 3.0 to 5.0; novel-light NRMS of the
sphere with five is 5.3 to 5.7 %, with four 5.2 %. With interreflections, which are misfit too, the fourth
takes about 1. Two-of-four blends with 3 % noise gain over 2 for a true one, 0.04 for a false."""

LAMBDA0_FLOOR = 0.005**2
LAMBDA1_FLOOR = 0.002**2
"""The penalties that serve noise-free captures (design section 3; inside the paper's ranges)."""


def freedoms(n: int, N: int) -> float:
    """Freedoms of a texel's blend: n - 1 weights, and the choice of n out of N in nats.

    Dividing the residual by the share they leave gives back the noise that was put in: at 3 % noise and
    K = 8, the models from (2, 4) to (4, 6) leave between 36 and 65 % of it and all estimate 3.0 to 3.3 %.
    """
    return n - 1 + log(comb(N, n)) if n <= N else N - 1.0


@dataclass
class Penalties:
    """lambda_0 and lambda_1, kept in step with the least noise estimate of the search so far."""

    measurements: F64
    """[M] K of each texel."""
    fixed0: float | None = None
    fixed1: float | None = None
    variance: float = np.inf
    """Relative variance of the noise, the least over the models seen."""

    def observe(self, data: float, n: int, N: int) -> None:
        """Take in a fitted model's data term, unless it has too many freedoms to tell noise from fit."""
        left = float(np.mean(np.maximum(1.0 - freedoms(n, N) / self.measurements, 0.0)))
        if left >= LEAST_LEFT:
            self.variance = min(self.variance, data / left)

    @property
    def freedom(self) -> float:
        """Mean over texels of 1 / K."""
        return float(np.mean(1.0 / self.measurements))

    @property
    def lambda0(self) -> float:
        if self.fixed0 is not None:
            return self.fixed0
        return max(LAMBDA0_FLOOR, (GAIN * self.freedom + MISFIT) * self._known)

    @property
    def lambda1(self) -> float:
        if self.fixed1 is not None:
            return self.fixed1
        return max(LAMBDA1_FLOOR, SHARE * self._known)

    @property
    def _known(self) -> float:
        return self.variance if np.isfinite(self.variance) else 0.0

    def objective(self, data: float, n: int, N: int) -> float:
        """Eq. 5."""
        return data + self.lambda0 * n + self.lambda1 * N

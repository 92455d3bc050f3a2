# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Penalties on n and N (Eq. 4): fixed, or automatic from what the model leaves (design section 3).

A further freedom at a texel with K measurements fits noise of relative variance v by about v / K of the
data term, so a sparser model is to be preferred until a freedom gains a small multiple of that. What
counts as noise is all that the model cannot say: sensor noise, and the basis' own misfit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F64

GAIN = 3.0
"""A freedom has to gain this many times what it would from noise alone. By measurement on two-of-four
blends: below 2, misfit of GGX lobes buys a fifth representative; the true fourth gains over 50 times."""

LAMBDA0_FLOOR = 0.005**2
LAMBDA1_FLOOR = 0.002**2
"""The penalties that serve noise-free captures (design section 3; inside the paper's ranges)."""


@dataclass
class Penalties:
    """lambda_0 and lambda_1, kept in step with the least noise estimate of the search so far."""

    measurements: F64
    """[M] K of each texel."""
    fixed0: float | None = None
    fixed1: float | None = None
    variance: float = np.inf
    """Relative variance of the noise, the least over the models seen."""

    def observe(self, data: float, n: int) -> None:
        """Take in a fitted model: its data term, its blend's n - 1 freedoms a texel counted off."""
        share = float(np.mean(np.minimum((n - 1) / self.measurements, 0.5)))
        self.variance = min(self.variance, data / (1.0 - share))

    @property
    def freedom(self) -> float:
        """Mean over texels of 1 / K."""
        return float(np.mean(1.0 / self.measurements))

    @property
    def lambda0(self) -> float:
        if self.fixed0 is not None:
            return self.fixed0
        return max(LAMBDA0_FLOOR, self._automatic())

    @property
    def lambda1(self) -> float:
        if self.fixed1 is not None:
            return self.fixed1
        return max(LAMBDA1_FLOOR, self._automatic())

    def _automatic(self) -> float:
        return GAIN * self.variance * self.freedom if np.isfinite(self.variance) else 0.0

    def objective(self, data: float, n: int, N: int) -> float:
        """Eq. 5."""
        return data + self.lambda0 * n + self.lambda1 * N

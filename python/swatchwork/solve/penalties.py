# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Penalties on n and N (Eq. 4): fixed, or automatic from what the model leaves (design section 3).

A further weight at a texel with K measurements fits noise of relative variance v by about v / K of the
data term, and misfit by a share of v. The sparser model is to be preferred until a weight, or a
representative, gains a small multiple of that. What counts as noise is all that the model cannot say: sensor
noise, and the basis' own misfit.

Texels whose light is not known well (contacts, creases, the rim of a coarse photograph, interreflections)
leave a hundred times what the rest do, in every model. So v is the median texel's, and models are compared by
a data term in which larger errors count by their root (Huber 1964). Fixed penalties are compared by Eq. 5 as
it stands.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, log

import numpy as np

from ..arrays import F64

LEAST_LEFT = 0.1
"""Share of the measurements that a model's freedoms must leave for its residual to be an estimate."""

OUTLIER = 3.0
"""Times the typical error beyond which a texel's error counts by its root."""

GAIN = 5.0
"""A further weight at every texel has to gain this many times what it would from noise alone."""

MISFIT = 1.5
"""And this share of v on top: misfit, unlike noise, is alike from view to view, so that a blend of more
representatives soaks it up however many the views. By measurement, twelve views of two captures of measured
materials, a third weight gains 0.6 to 1.1 v (and costs 1.5 to 2.5 points of novel-light NRMS), the second 28
to 31 v."""

SHARE = 0.9
"""A further representative has to take this many times v off. On the same captures the fifth of four takes
0.6 to 1.0 (and changes the NRMS by less than 0.1 points), the fourth 9; interreflections make it 1.4, where
the third takes 33. Two-of-four blends with 3 % noise gain over 2 for a true one, 0.04 for a false. Of nine
materials that blend by threes the eighth takes 2, the last 0.5. One too few costs far more than one too many:
39 % of NRMS with (4, 6) in place of (3, 9), 10 % with (3, 8)."""

LAMBDA0_FLOOR = 0.005**2
LAMBDA1_FLOOR = 0.005**2
"""The penalties that serve noise-free captures (inside the paper's ranges). With GGX materials in the paper's
basis, noise-free, a false representative takes up to 2.2e-5, a true one over 1e-3."""


def freedoms(n: int, N: int) -> float:
    """Freedoms of a texel's blend: n - 1 weights, and the choice of n out of N in nats.

    Dividing the residual by the share they leave gives back the noise that was put in: at 3 % noise and
    K = 8, the models from (2, 4) to (4, 6) leave between 36 and 65 % of it and all estimate 3.0 to 3.3 %.
    """
    return n - 1 + log(comb(N, n)) if n <= N else N - 1.0


def typical(relative: F64, measurements: F64, n: int, N: int) -> float:
    """The relative variance v of the noise, from the median of squared relative errors [M] of a fitted model.

    Only texels that the model leaves enough to tell noise from fit count; inf where there are too few.
    """
    left = 1.0 - freedoms(n, N) / measurements
    told = left >= LEAST_LEFT
    if np.mean(np.maximum(left, 0)) < LEAST_LEFT:
        return np.inf
    # Median of chi-square with K left degrees, over its mean (Wilson and Hilferty 1931).
    degrees = measurements[told] * left[told]
    return float(np.median(relative[told] / left[told] / (1 - 2 / (9 * np.maximum(degrees, 1))) ** 3))


def huber(relative: F64, variance: float) -> F64:
    """Squared relative errors [M]; what is beyond OUTLIER times the typical error grows by its root."""
    edge = OUTLIER**2 * max(variance, LAMBDA0_FLOOR)
    if np.isinf(edge):
        return relative
    return np.where(relative <= edge, relative, 2 * np.sqrt(edge * relative) - edge)


@dataclass
class Penalties:
    """lambda_0 and lambda_1, kept in step with the least noise estimate of the search so far."""

    freedom: float
    """Mean over texels of 1 / K."""
    fixed0: float | None = None
    fixed1: float | None = None
    variance: float = np.inf
    """v, the least over the models seen."""

    def observe(self, relative: F64, measurements: F64, n: int, N: int) -> None:
        """Take in a fitted model's squared relative errors [M]."""
        self.variance = min(self.variance, typical(relative, measurements, n, N))

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

    def counted(self, relative: F64) -> F64:
        """What squared relative errors [M] count when models are compared."""
        fixed = self.fixed0 is not None and self.fixed1 is not None
        return relative if fixed else huber(relative, self.variance)

    def data(self, relative: F64, share: F64) -> float:
        """The data term that models are compared by, from squared relative errors [M] and shares [M]."""
        return float(np.sum(share * self.counted(relative)) / np.sum(share))

    def objective(self, data: float, n: int, N: int) -> float:
        """Eq. 5, with the data term that models are compared by."""
        return data + self.lambda0 * n + self.lambda1 * N

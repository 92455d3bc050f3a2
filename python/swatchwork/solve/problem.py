# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The data of Eq. 5 at the texels that take part."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._native import SolverProblem
from ..arrays import DARK, F32, F64, I64, Bool
from ..errors import InputError

BRIGHTEST = 2.0
"""A directional albedo can be 1 at most; a fit overshoots where no view looked."""
BRIGHTER = 10.0
"""Times the typical representative's albedo that another may have: white marble on black slate has."""


class Fitted(NamedTuple):
    """What the representative step found."""

    representatives: F64
    """[N, J, 3]"""
    data: float
    """Data term of Eq. 5."""
    converged: bool
    """Whether the active-set iterations ended at the optimum."""


class Problem:
    """Measurements and generic responses of M texels, P pairs (texel, view), J kernels a channel.

    Args:
        responses: [P, J, 3] s*, generic responses (Eq. 13), linear radiance.
        radiance: [P, 3] s_hat, measured radiance in the same unit.
        offsets: [M + 1]; pairs of texel x are offsets[x] to offsets[x + 1]. Every texel needs a view.
        share: [M] weight of each texel in the mean of Eq. 5, above 0, the largest 1; all alike by default.
        albedo: [A, J] of the kernels at A directions of view, to hold representatives to the possible; no
            such bound by default.

    Raises:
        InputError: a texel without views, or nothing but black measurements.
        ValueError: shapes that do not agree, or values that are not finite.
    """

    def __init__(
        self, responses: F32, radiance: F32, offsets: I64, share: F64 | None = None, albedo: F64 | None = None
    ) -> None:
        self.offsets = np.ascontiguousarray(offsets, dtype=np.int64)
        self.radiance = np.ascontiguousarray(radiance, dtype=np.float32)
        self.responses = np.ascontiguousarray(responses, dtype=np.float32)
        views = np.diff(self.offsets)
        if len(views) == 0 or views.min() < 1:
            raise InputError(
                f"{int((views < 1).sum())} of {len(views)} texels are seen by no view",
                expected="only texels with measurements",
                hint="Leave unseen texels out of the problem; they are filled afterwards.",
            )
        energy = np.add.reduceat((self.radiance.astype(np.float64) ** 2).sum(axis=1), self.offsets[:-1])
        typical = float(np.median(energy / views))
        if typical <= 0:
            raise InputError(
                "more than half of the measured texels are black",
                expected="photographs of a lit object",
                hint="Check exposure, masks and poses.",
            )
        self.texels = len(views)
        self.kernels = self.responses.shape[1]
        self.measurements: F64 = 3.0 * views
        """[M] K of each texel."""
        self.share: F64 = np.ones(self.texels) if share is None else np.asarray(share, dtype=np.float64)
        """[M]"""
        self.albedo = albedo
        # The core takes gamma as 1 over energy or floor, whichever is larger: a share raises the floor.
        floor = np.maximum(energy, DARK**2 * typical * views) / self.share
        self._native = SolverProblem(self.responses, self.radiance, self.offsets, floor)
        self.gamma: F64 = self._native.gamma
        """[M] share / ||s_hat_x||^2, with a floor for near-black texels."""

    def thinned(self, texels: int) -> Problem:
        """The same problem at about the given number of its texels, evenly strided."""
        stride = -(-self.texels // texels)
        if stride == 1:
            return self
        kept = np.arange(0, self.texels, stride)
        pairs = np.concatenate([np.arange(*self.offsets[x : x + 2]) for x in kept])
        offsets = np.concatenate([[0], np.cumsum(np.diff(self.offsets)[kept])])
        return Problem(self.responses[pairs], self.radiance[pairs], offsets, self.share[kept], self.albedo)

    def part(self, kept: Bool, texels: Bool) -> Problem:
        """The same problem on some of its measurements, ``kept`` [P], and texels, ``texels`` [M].

        Raises:
            InputError: a texel would be left without measurements.
        """
        texel = np.repeat(np.arange(self.texels), np.diff(self.offsets))
        pairs = np.flatnonzero(kept & texels[texel])
        views = np.bincount(texel[pairs], minlength=self.texels)[texels]
        offsets = np.concatenate([[0], np.cumsum(views)])
        share = self.share[texels]
        return Problem(
            self.responses[pairs], self.radiance[pairs], offsets, share / share.max(initial=0.0), self.albedo
        )

    def weighted(self, weight: F64, share: F64) -> Problem:
        """The same problem, measurements weighted by ``weight`` [P], texels by ``share`` [M] too."""
        root = np.sqrt(weight).astype(np.float32)
        share = self.share * share
        return Problem(
            self.responses * root[:, None, None],
            self.radiance * root[:, None],
            self.offsets,
            share / share.max(),
            self.albedo,
        )

    def representatives(self, weights: F64, start: F64 | None = None) -> Fitted:
        """Optimal representatives for blend weights [M, N] (Eqs. 6, 7), from ``start`` [N, J, 3]."""
        if start is None:
            start = np.zeros((weights.shape[1], self.kernels, 3))
        return Fitted(
            *self._native.representatives(np.ascontiguousarray(weights), np.ascontiguousarray(start))
        )

    def possible(self, representatives: F64, weights: F64) -> F64:
        """Representatives [N, J, 3], those scaled down that reflect far more light than they receive.

        A few texels that hardly any direct light reaches, but interreflections do, are fitted best by an
        albedo of a thousand, which then shows wherever light does reach. Exposures and the light's unit may
        be off by any factor, so that an albedo is held to ``BRIGHTEST``, or to ``BRIGHTER`` times that of
        the typical representative (the median over the surface by blend weights [M, N]) where that is more.
        """
        if self.albedo is None:
            return representatives
        highest = np.einsum("aj,njc->nac", self.albedo, representatives).max(axis=(1, 2))
        carried = self.share @ weights
        order = np.argsort(highest)
        half = np.searchsorted(np.cumsum(carried[order]), 0.5 * carried.sum())
        ceiling = max(BRIGHTEST, BRIGHTER * highest[order[min(half, len(order) - 1)]])
        scale = np.minimum(1.0, ceiling / np.maximum(highest, 1e-30))
        return np.asarray(representatives * scale[:, None, None])

    def joint_step(self, weights: F64, representatives: F64, damping: float) -> F64:
        """Representatives [N, J, 3] after a damped Gauss-Newton step that lets the weights [M, N] follow.

        Variable projection (Golub and Pereyra 1973; Kaufman 1975): a change of the representatives counts
        for what no change of a texel's weights on its support could undo. Kernels not in use stay so.
        """
        return self._native.joint_step(
            np.ascontiguousarray(weights), np.ascontiguousarray(representatives), damping
        )

    def fold(self, representatives: F64) -> F32:
        """Responses [P, N, 3] of representatives [N, J, 3] (Eq. 14)."""
        return self._native.fold(np.ascontiguousarray(representatives))

    def mean(self, squared_error: F64) -> float:
        """The data term of Eq. 5 from squared errors [M], as a mean over texels by their shares."""
        return float(np.sum(self.gamma * squared_error) / np.sum(self.share))

    def relative(self, squared_error: F64) -> F64:
        """Squared relative errors [M] of the texels."""
        return np.asarray(self.gamma / self.share * squared_error)

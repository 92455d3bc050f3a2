# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The global linear model of Chen et al. 2014: non-negative weights of the generic kernels, of low rank.

    minimise  sum_x gamma_x ||s_hat_x - s*_x w_x||^2 + penalty ||W||_*,   W = (w_x) >= 0,

with W [M, 3 J] and the nuclear norm in place of the number of materials. Solved by the alternating direction
method of multipliers (Boyd et al. 2011) on two copies of W: one shrinks its singular values, one its negative
entries.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F64
from .method import Measurements, Recovered, single_kernels

RANK_TOLERANCE = 1e-3
"""Of the largest singular value: what is below counts as zero, for the iteration leaves that much."""


@dataclass(frozen=True)
class GlobalLinear:
    """Low rank by the nuclear norm."""

    strength: float = 1e-2
    """Penalty, as a share of the least one at which W = 0."""
    iterations: int = 400
    tolerance: float = 1e-4
    """Relative change of W, and distance of its copies, at which the iteration has converged."""
    name: str = "global linear"

    def recover(self, measurements: Measurements) -> Recovered:
        """A rank N found by the penalty; texels share whatever N columns span W, and no blend is sparse."""
        m, J = measurements, measurements.basis.kernels
        a, y = _padded(m)  # [M, 3, k, J], [M, 3, k]
        # Kernels of unit mean response, so that the norm treats sharp and wide ones alike.
        scale = np.sqrt(np.maximum((a**2).sum(axis=(0, 1, 2)), 1e-30) / (3 * m.texels))
        a /= scale
        right = 2 * np.einsum("xckj,xck->xcj", a, y, optimize=True)
        penalty = self.strength * float(np.linalg.norm(right.reshape(m.texels, -1), 2))
        rho = 2.0 * float((a**2).sum(axis=(2, 3)).mean()) / J
        gram = np.einsum("xckj,xclj->xckl", a, a, optimize=True)
        inverse = np.linalg.inv(gram + rho * np.eye(a.shape[2]))
        low, positive = np.zeros_like(right), np.zeros_like(right)
        dual_low, dual_positive = np.zeros_like(right), np.zeros_like(right)
        status = "iteration limit"
        for _ in range(self.iterations):
            # (2 a^T a + 2 rho) w = 2 a^T y + rho (...), by the k x k inverse (Woodbury).
            target = right + rho * (low - dual_low + positive - dual_positive)
            inner = np.einsum("xckj,xcj->xck", a, target, optimize=True)
            inner = np.einsum("xckl,xcl->xck", inverse, inner, optimize=True)
            w = (target - np.einsum("xckj,xck->xcj", a, inner, optimize=True)) / (2 * rho)
            before = positive
            low = _shrunk((w + dual_low).reshape(m.texels, -1), penalty / rho).reshape(w.shape)
            positive = np.maximum(w + dual_positive, 0.0)
            dual_low, dual_positive = dual_low + w - low, dual_positive + w - positive
            size = max(float(np.linalg.norm(positive)), 1e-30)
            apart = max(float(np.linalg.norm(copy - w)) for copy in (low, positive))
            if max(apart, float(np.linalg.norm(positive - before))) < self.tolerance * size:
                status = "converged"
                break
        rank = _rank(low.reshape(m.texels, -1))
        weights = np.moveaxis(positive / scale, 1, 2).reshape(m.texels, -1)
        return Recovered(m.basis, single_kernels(J), weights, rank, status, {"penalty": penalty})


def _padded(m: Measurements) -> tuple[F64, F64]:
    """Responses [M, 3, k, J] and measurements [M, 3, k] by their relative weight; missing views are zero."""
    most = int(np.diff(m.offsets).max())
    place = np.arange(len(m.texel)) - m.offsets[m.texel]
    root = np.sqrt(m.problem.gamma)[m.texel]
    a = np.zeros((m.texels, 3, most, m.basis.kernels))
    y = np.zeros((m.texels, 3, most))
    for c in range(3):
        a[m.texel, c, place] = root[:, None] * m.responses[:, :, c]
        y[m.texel, c, place] = root * m.radiance[:, c]
    return a, y


def _shrunk(w: F64, by: float) -> F64:
    """W with its singular values lowered (Cai et al. 2010), by the eigenvectors of W^T W."""
    square, v = np.linalg.eigh(w.T @ w)
    singular = np.sqrt(np.maximum(square, 0))
    factor = np.where(singular > by, 1 - by / np.maximum(singular, 1e-30), 0.0)
    kept = factor > 0
    return np.asarray((w @ (v[:, kept] * factor[kept])) @ v[:, kept].T)


def _rank(w: F64) -> int:
    singular = np.linalg.svd(w, compute_uv=False)
    return int(np.count_nonzero(singular > RANK_TOLERANCE * max(singular[0], 1e-30)))

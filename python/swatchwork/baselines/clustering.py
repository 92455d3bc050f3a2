# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Clusters of one single-lobe material each, then a blend of all of them a texel (Lensch et al. 2003)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from ..arrays import F64, I64
from .lobes import single_lobe
from .method import Measurements, Recovered

MOST_ROUNDS = 30
"""Of assignment and fit between two splits."""


@dataclass(frozen=True)
class Clustering:
    """Texels clustered by the material that explains them best; the worst cluster is split until N are there.

    As Lensch et al. do, materials are single lobes, fitted to a cluster's measurements, and every texel ends
    as a non-negative combination of all materials. They fit Lafortune lobes and split along the covariance of
    the parameters; here the lobe is Cook-Torrance's and a cluster's worse half becomes
    another.
    """

    N: int = 4
    name: str = "clusters"

    def recover(self, measurements: Measurements) -> Recovered:
        m = measurements
        of_texel = np.zeros(m.texels, dtype=np.int64)
        materials = _fitted(m, of_texel, 1, None)
        while len(materials) < self.N:
            error = _errors(m, materials)[np.arange(m.texels), of_texel]
            total = np.bincount(of_texel, error, minlength=len(materials))
            # A cluster of one texel cannot be split.
            total[np.bincount(of_texel, minlength=len(materials)) < 2] = -1
            if total.max() < 0:
                break
            worst = np.flatnonzero(of_texel == int(total.argmax()))
            of_texel[worst[np.argsort(-error[worst], kind="stable")[: len(worst) // 2]]] = len(materials)
            materials = _settled(m, of_texel, len(materials) + 1, materials)
        folded = m.problem.fold(materials).astype(np.float64)
        weights = np.stack(
            [
                nnls(_rows(folded[pairs]), m.radiance[pairs].astype(np.float64).ravel())[0]
                for pairs in map(slice, m.offsets[:-1], m.offsets[1:])
            ]
        )
        return Recovered(m.basis, materials, weights, len(materials), "converged")


def _settled(m: Measurements, of_texel: I64, count: int, materials: F64) -> F64:
    """Assign and fit in turn until no texel changes its cluster; ``of_texel`` is updated in place."""
    for _ in range(MOST_ROUNDS):
        materials = _fitted(m, of_texel, count, materials)
        nearest = _errors(m, materials).argmin(axis=1)
        if (nearest == of_texel).all():
            break
        of_texel[:] = nearest
    return materials


def _fitted(m: Measurements, of_texel: I64, count: int, before: F64 | None) -> F64:
    """A single lobe [count, J, 3] for each cluster; an empty one keeps what it had."""
    found = np.zeros((count, m.basis.kernels, 3))
    for k in range(count):
        pairs = of_texel[m.texel] == k
        if pairs.any():
            weight = m.problem.gamma[m.texel[pairs]]
            found[k] = single_lobe(m.basis, m.responses[pairs], m.radiance[pairs], weight)
        elif before is not None and k < len(before):
            found[k] = before[k]
    return found


def _errors(m: Measurements, materials: F64) -> F64:
    """Relative squared error [M, N] of each texel by each material alone."""
    difference = m.problem.fold(materials).astype(np.float64) - m.radiance[:, None]
    return np.asarray(
        m.problem.gamma[:, None] * np.add.reduceat((difference**2).sum(axis=-1), m.offsets[:-1], axis=0)
    )


def _rows(folded: F64) -> F64:
    """[k, N, 3] as the rows of a system [3 k, N]."""
    return np.moveaxis(folded, 1, 2).reshape(-1, folded.shape[1])

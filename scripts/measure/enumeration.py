# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Eq. 12 by plain enumeration in NumPy: every support of up to n columns, many problems at once.

    minimise ||S w - s||^2   subject to   sum w = 1, w >= 0, at most n weights above zero.

On a support the sum is eliminated (w_last = 1 - the rest), which leaves ordinary least squares. A
solution with a negative weight is discarded: the optimum of that support lies on a smaller one, which is
looked at too. That holds for rank-deficient supports as well, whichever solution the pseudo-inverse takes:
from a feasible one, walking along the null space loses a column at no cost. No code is the package's.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

SINGULAR = 1e-9
"""Determinant of the Gram matrix of unit columns below which the pseudo-inverse takes over."""


def best_blends(S: np.ndarray, s: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Squared errors [B] and weights [B, N] of the best blends of S [B, K, N] for measurements s [B, K]."""
    B, _, N = S.shape
    error, weights = np.full(B, np.inf), np.zeros((B, N))
    for size in range(1, min(n, N) + 1):
        for support in combinations(range(N), size):
            chosen = S[:, :, support]
            w = on_support(chosen, s)
            left = ((np.einsum("bki,bi->bk", chosen, w) - s) ** 2).sum(axis=1)
            # A tie goes to the smaller support, which came first.
            better = np.flatnonzero((w >= 0).all(axis=1) & (left < error))
            error[better] = left[better]
            weights[better] = 0
            weights[better[:, None], support] = w[better]
    return error, weights


def on_support(chosen: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Weights [B, m] of sum 1, of any sign, that fit s [B, K] best by columns [B, K, m]."""
    if chosen.shape[2] == 1:
        return np.ones((len(chosen), 1))
    A, b = chosen[:, :, :-1] - chosen[:, :, -1:], s - chosen[:, :, -1]
    length = np.linalg.norm(A, axis=1, keepdims=True)
    A = A / np.where(length > 0, length, 1)
    G = np.einsum("bki,bkj->bij", A, A)
    singular = np.linalg.det(G) < SINGULAR
    G[singular] = np.eye(G.shape[1])
    inverse = np.linalg.inv(G)
    x = np.einsum("bij,bkj,bk->bi", inverse, A, b)
    # A step of refinement on the rows: as exact as an orthogonal factorisation.
    x += np.einsum("bij,bkj,bk->bi", inverse, A, b - np.einsum("bki,bi->bk", A, x), optimize=True)
    if singular.any():
        x[singular] = np.einsum("bik,bk->bi", np.linalg.pinv(A[singular], rcond=1e-12), b[singular])
    x = x / np.where(length > 0, length, 1)[:, 0]
    return np.concatenate([x, 1 - x.sum(axis=1, keepdims=True)], axis=1)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Alternate the two steps of section 4 until the objective stands still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F64
from .blending import Search, blend
from .problem import Problem

WINDOW = 4
"""Alternations over which the decrease is judged: single steps stall before a change of supports."""
PERFECT = 1e-13
"""A data term at which 32-bit responses leave nothing to gain."""


@dataclass(frozen=True)
class Alternation:
    """A pair (representatives, weights) and its data term."""

    representatives: F64
    weights: F64
    squared_error: F64
    data: float
    count: int
    """Alternations it took."""
    converged: bool

    @property
    def N(self) -> int:
        return len(self.representatives)


def alternate(
    problem: Problem,
    n: int,
    *,
    weights: F64,
    representatives: F64 | None = None,
    search: Search = "exact",
    tolerance: float = 2e-3,
    most: int = 200,
    seed: int = 0,
) -> Alternation:
    """Minimise Eq. 5 for fixed n and N from the given weights [M, N].

    Each step solves its half exactly, so the data term never rises. Representatives that fall out of
    use keep the place they had: a later blend may pick them up again.

    Args:
        tolerance: mean relative decrease of the data term an alternation that counts as standing still.
        most: alternations at most.
    """
    data = np.inf
    trail: list[float] = []
    squared_error = np.zeros(problem.texels)
    for count in range(1, most + 1):
        fitted, _, solved = problem.representatives(weights, representatives)
        if representatives is not None:
            idle = weights.sum(axis=0) <= 0
            fitted[idle] = representatives[idle]
        representatives = fitted
        step = blend(
            problem.fold(representatives),
            problem.radiance,
            problem.offsets,
            n,
            search=search,
            previous=weights,
            seed=seed,
        )
        weights, squared_error = step.weights, step.squared_error
        data = problem.mean(squared_error)
        trail.append(data)
        if data < PERFECT:
            return Alternation(representatives, weights, squared_error, data, count, solved)
        if count > WINDOW and trail[-1 - WINDOW] - data < WINDOW * tolerance * data:
            return Alternation(representatives, weights, squared_error, data, count, solved)
    assert representatives is not None
    return Alternation(representatives, weights, squared_error, data, most, False)

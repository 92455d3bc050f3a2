# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Alternate the two steps of section 4 until the objective stands still."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import F64
from .blending import Blend, Search, blend
from .problem import Problem

WINDOW = 4
"""Alternations over which the decrease is judged: single steps stall before a change of supports."""
PERFECT = 1e-13
"""A data term at which 32-bit responses leave nothing to gain."""
DAMPING = 1e-2
"""Of the first joint step, as a share of H's diagonal (Levenberg and Marquardt)."""
LEAST_DAMPING, MOST_DAMPING = 1e-7, 100.0
STEPS = (1.0, 0.5, 0.25)
"""Parts of a joint step that are tried: supports change on the way, which its model does not know."""


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
    joint: bool = True,
) -> Alternation:
    """Minimise Eq. 5 for fixed n and N from the given weights [M, N].

    Each step solves its half exactly, so the data term never rises, but for representatives that are held to
    the possible. Representatives that fall out of use keep the place they had: a later blend may pick them up
    again.

    Args:
        tolerance: mean relative decrease of the data term an alternation that counts as standing still.
        most: alternations at most.
        joint: whether a step of representatives and weights together follows each alternation, where it
            lowers the data term further. With n = 1 there is nothing for it to add.
    """

    def blended(representatives: F64, previous: F64) -> tuple[Blend, float]:
        folded = problem.fold(representatives)
        step = blend(
            folded, problem.radiance, problem.offsets, n, search=search, previous=previous, seed=seed
        )
        return step, problem.mean(step.squared_error)

    trail: list[float] = []
    damping = DAMPING
    for count in range(1, most + 1):
        fitted, _, solved = problem.representatives(weights, representatives)
        if representatives is not None:
            idle = weights.sum(axis=0) <= 0
            fitted[idle] = representatives[idle]
        representatives = problem.possible(fitted, weights)
        step, data = blended(representatives, weights)
        if joint and n > 1 and data >= PERFECT:
            change = problem.joint_step(step.weights, representatives, damping) - representatives
            whole = False
            for part in STEPS:
                moved = problem.possible(representatives + part * change, step.weights)
                rival, less = blended(moved, step.weights)
                if less < data:
                    representatives, step, data, whole = moved, rival, less, part == STEPS[0]
                    break
            damping = max(damping / 3, LEAST_DAMPING) if whole else min(4 * damping, MOST_DAMPING)
        weights = step.weights
        trail.append(data)
        stands = count > WINDOW and trail[-1 - WINDOW] - data < WINDOW * tolerance * data
        if data < PERFECT or stands:
            return Alternation(representatives, weights, step.squared_error, data, count, solved)
    assert representatives is not None
    return Alternation(representatives, weights, step.squared_error, data, most, False)

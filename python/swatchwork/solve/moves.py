# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Moves of the search between models: one representative more, one fewer, another n.

A new representative is proposed from texels that the model fits badly, several ways; the one that a few
alternations take furthest is kept. One to leave out is whichever is missed least.
"""

from __future__ import annotations

import numpy as np

from ..arrays import F64, Bool
from .alternation import Alternation, alternate
from .blending import Blend, blend
from .options import SolveOptions
from .problem import Problem

WORST_SHARES = (0.5, 0.2, 0.05)
"""Shares of the texels, worst fitted first, that a new representative is proposed from: a material of a
large region, of a small one, of a detail."""
ROUNDS = ((1, 3), (2, 1))
"""Alternations that each proposal gets in a round, and how many of the best are left after it."""
CONTENDERS = 2
"""Representatives whose removal is tried."""


def start(problem: Problem, n: int, options: SolveOptions) -> Alternation:
    """N = 1: one representative for all texels (section 4, Initialization)."""
    return _trial(problem, n, np.ones((problem.texels, 1)), None, options, 1)


def with_new(
    problem: Problem, model: Alternation, chosen: Bool, *, shared: bool, n: int, options: SolveOptions
) -> tuple[F64, F64]:
    """Weights and representatives with one more, fitted to the chosen texels alone.

    Args:
        shared: whether every texel may blend the new one at once, rather than the chosen give it all
            their weight (section 4).
    """
    alone = chosen.astype(np.float64)[:, None]
    newcomer = problem.representatives(alone).representatives
    representatives = np.concatenate([model.representatives, newcomer])
    if shared:
        return _blended(problem, representatives, n, options).weights, representatives
    kept = np.where(chosen[:, None], 0.0, model.weights)
    return np.concatenate([kept, alone], axis=1), representatives


def grow(problem: Problem, model: Alternation, n: int, options: SolveOptions) -> Alternation:
    """The best of several ways to add a representative, after a few alternations."""
    error = problem.relative(model.squared_error)
    proposals = []
    for share in WORST_SHARES:
        chosen = error >= np.quantile(error, 1.0 - share)
        for shared in (False, True):
            weights, representatives = with_new(problem, model, chosen, shared=shared, n=n, options=options)
            proposals.append((weights, representatives))
    return _best(problem, n, proposals, options)


def shrink(problem: Problem, model: Alternation, n: int, options: SolveOptions) -> Alternation:
    """The best of several ways to do with one representative fewer, after a few alternations."""
    missed = []
    for i in range(model.N):
        rest = np.delete(model.representatives, i, axis=0)
        step = _blended(problem, rest, n, options)
        missed.append((problem.mean(step.squared_error), i, step.weights))
    missed.sort(key=lambda entry: entry[:2])
    proposals = [
        (weights, np.delete(model.representatives, i, axis=0)) for _, i, weights in missed[:CONTENDERS]
    ]
    return _best(problem, n, proposals, options)


def _best(problem: Problem, n: int, proposals: list[tuple[F64, F64]], options: SolveOptions) -> Alternation:
    """The proposal of weights and representatives that a few alternations take furthest."""
    trials: list[Alternation] = []
    for alternations, left in ROUNDS:
        trials = [_trial(problem, n, *proposal, options, alternations) for proposal in proposals]
        trials = sorted(trials, key=lambda trial: trial.data)[:left]
        proposals = [(trial.weights, trial.representatives) for trial in trials]
    return trials[0]


def _blended(problem: Problem, representatives: F64, n: int, options: SolveOptions) -> Blend:
    folded = problem.fold(representatives)
    return blend(folded, problem.radiance, problem.offsets, n, search=options.search, seed=options.seed)


def _trial(
    problem: Problem,
    n: int,
    weights: F64,
    representatives: F64 | None,
    options: SolveOptions,
    most: int,
) -> Alternation:
    return alternate(
        problem,
        n,
        weights=weights,
        representatives=representatives,
        search=options.search,
        most=most,
        seed=options.seed,
        joint=options.joint,
    )

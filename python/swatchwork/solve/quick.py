# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A rough model of given n and N, for questions about the measurements that many models answer alike."""

from __future__ import annotations

from . import moves
from .alternation import Alternation, alternate
from .options import SolveOptions
from .problem import Problem

TOLERANCE = 0.02
"""Relative decrease an alternation at which a rough model is good enough."""
MOST = 12
"""Alternations of it."""


def quick(
    problem: Problem, n: int, N: int, previous: Alternation | None = None, seed: int = 0
) -> Alternation:
    """Grow a model to N representatives, n at a texel, without a search and without the joint steps.

    Args:
        previous: a model of the same N and texels to go on from, of other measurements.
    """
    options = SolveOptions(search_order="paper", seed=seed)
    model = previous
    if model is None:
        model = moves.start(problem, n, options)
        while N > model.N:
            model = moves.grow(problem, model, n, options)
    return alternate(
        problem,
        n,
        weights=model.weights,
        representatives=model.representatives,
        tolerance=TOLERANCE,
        most=MOST,
        joint=options.joint,
    )

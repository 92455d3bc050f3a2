# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The solver on a subset of the texels: representatives are vastly over-determined (design section 3).

The subset begins evenly spread. The solution is then tried on a larger survey; where that has texels fitted
so badly that the subset cannot have known of them, those join it, and the solver goes on from where it was.
Each texel of a subset stands for its share of the surface, so that Eq. 5 stays a mean over the surface
whatever the subset favours.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from ..arrays import F64, I64
from ..errors import CaptureWarning, InputError
from ..keeping import IN_MEMORY, Keeper
from ..observe import Rendering, noise_shares, stratified
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..solve import (
    Penalties,
    Problem,
    Solution,
    SolveOptions,
    resume,
    resume_robustly,
    solve_robustly,
    sparse_blend,
)
from .budget import Budget

SURVEYED = 5
"""Times as many texels as the subset has that a survey looks at: it finds what covers a fifth as much."""
ROUNDS = 3
"""Surveys at most."""
POOR = 3.0
"""A texel with this many times the root-mean-square relative error is fitted badly."""
VIEWED = (1.0, 0.7, 0.25)
"""Cosines of view at which no representative may reflect far more light than it receives."""
JOINING = 0.25
"""Badly fitted texels that join, at most, as a share of the subset."""


@dataclass(frozen=True)
class Subset:
    """Texels I64[T], rising, and the share of the surface each stands for, F64[T], the largest 1."""

    texels: I64
    share: F64


def solve_on_subset(
    rendering: Rendering,
    basis: GenericBasis,
    texels: int,
    options: SolveOptions,
    budget: Budget | None = None,
    progress: Progress = SILENT,
    keeper: Keeper = IN_MEMORY,
    start: Solution | None = None,
) -> Solution:
    """Find n, N and the representatives from about ``texels`` texels, more where those miss something.

    From ``start``, if there is one: n stays, representatives are refined, and more are found if that pays.

    Raises:
        InputError: their responses do not fit into the budget.
    """
    budget = budget or Budget()
    chosen = stratified(rendering.observations, texels, options.seed)
    subset = Subset(chosen, np.ones(len(chosen)))
    most = budget.subset(basis.kernels)
    pairs = _pairs(rendering, chosen)
    if pairs > most:
        raise InputError(
            f"{len(chosen)} texels, {pairs} measured (texel, view) pairs, for the search",
            expected=f"at most {most} pairs within the memory allowed",
            hint="Lower --texels or raise --memory.",
        )

    def first() -> Solution:
        with progress.stage("respond"):
            problem = _problem(rendering, basis, subset, options.robustly)
        with progress.stage("solve"):
            if start is not None:
                return resume_robustly(problem, start, options, progress)
            return solve_robustly(problem, options, progress)

    solution = Solution.of(keeper.kept("solve", lambda: first().arrays()))
    # Section 4's order is that of all its texels together: nothing is grown on afterwards.
    for turn in range(1, ROUNDS + 1 if options.search_order == "default" else 1):
        # Nor where there are outliers: what no representative explains is what they look like.
        if len(subset.texels) == len(rendering.observations.seen) or solution.outliers is not None:
            break
        with progress.stage("survey"):
            larger = _surveyed(rendering, basis, subset, solution, texels, options, budget, turn)
        if larger is None:
            break
        if (pairs := _pairs(rendering, larger.texels)) > most:
            message = (
                "some texels look like a material that the search has not seen, and there is no room for "
                f"them: {pairs} pairs, expected at most {most}. Raise --memory or lower --texels."
            )
            warnings.warn(CaptureWarning(message), stacklevel=2)
            break
        subset = larger

        def more(subset: Subset = subset, solution: Solution = solution) -> Solution:
            with progress.stage("solve on"):
                return resume(
                    _problem(rendering, basis, subset, options.robustly), solution, options, progress
                )

        solution = Solution.of(keeper.kept(f"solve-{turn}", lambda more=more: more().arrays()))  # type: ignore[misc]
    return solution


def _pairs(rendering: Rendering, texels: I64) -> int:
    return int(rendering.observations.coverage[texels].sum(dtype=np.int64))


def _problem(rendering: Rendering, basis: GenericBasis, subset: Subset, robust: bool) -> Problem:
    pairs = rendering.pairs(subset.texels)
    albedo = np.stack([basis.albedo(n_o) for n_o in VIEWED])
    share, noise = subset.share, rendering.observations.noise
    if noise is not None and robust:
        share = share * noise_shares(noise, pairs.seen.radiance, pairs.offsets)
        share = share / share.max()
    return Problem(rendering.generic(basis, pairs), pairs.radiance, pairs.offsets, share, albedo)


def _surveyed(
    rendering: Rendering,
    basis: GenericBasis,
    subset: Subset,
    solution: Solution,
    texels: int,
    options: SolveOptions,
    budget: Budget,
    turn: int,
) -> Subset | None:
    """The subset with badly fitted texels of a survey added; None if no representative would pay.

    What they would pay is the excess of their error, as models are compared by it, over the mean, as a mean
    over the survey, less what the subset has of the same kind, which the solver knew of: a representative
    costs lambda_1.
    """
    survey = stratified(rendering.observations, SURVEYED * texels, options.seed + turn)
    error = np.empty(len(survey))
    done = 0
    for tile in rendering.tiles(survey, budget.tile(solution.N)):
        pairs = rendering.pairs(tile)
        responses = rendering.representatives(basis, solution.representatives, pairs)
        found = sparse_blend(
            responses, pairs.radiance, pairs.offsets, solution.n, search=options.search, seed=options.seed
        )
        error[done : done + len(tile)] = rendering.relative_error(pairs, found.squared_error) ** 2
        done += len(tile)
    bar, was = POOR**2 * solution.data, solution.relative_error
    penalties = Penalties(0.0, options.lambda0, options.lambda1, solution.noise**2)

    def excess(error: F64, share: F64) -> float:
        counted = penalties.counted(error)
        mean = float((share * counted).sum() / share.sum())
        return float((share * np.maximum(counted - mean, 0))[error > bar].sum() / share.sum())

    missed = excess(error, np.ones(len(survey))) - excess(was, subset.share)
    if missed < solution.lambda1:
        return None
    poor = np.setdiff1d(survey[error > bar], subset.texels)
    joining = poor[:: max(1, -(-len(poor) // max(1, int(JOINING * texels))))]
    if not len(joining):
        return None
    everyone = np.concatenate([subset.texels, joining])
    bad = np.concatenate([was > bar, np.ones(len(joining), dtype=bool)])
    # Not quite all: every texel of the subset stands for something.
    part = min(float((error > bar).mean()), 0.99)
    share = np.where(bad, part / bad.sum(), (1 - part) / max((~bad).sum(), 1))
    order = np.argsort(everyone)
    return Subset(everyone[order], (share / share.max())[order])

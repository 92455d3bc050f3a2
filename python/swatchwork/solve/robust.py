# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The sparse solver where some measurements are outliers: hands, flies, sparkle, reflections of the room.

The plain solver goes first. Outliers are there where its representatives, blended from those of a texel's
views that agree, leave more measurements far behind than clean captures do; else its answer stands as it is.
A solution spoilt by outliers is no start for a better one: another is grown from one representative on, and
at each step every texel's views vote anew (``robust_start.py``). The plain solver then searches for n, N and
the representatives once more, on what is left, and its answer decides anew what that is.

That is a least trimmed squares fit (Rousseeuw 1984) whose bound follows the residuals' median.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import F64, I64
from ..progress import SILENT, Progress
from .options import SolveOptions
from .problem import Problem
from .robust_start import robust_start
from .search import resume, solve
from .solution import Outliers, Solution
from .trimming import VOTES, Trimmed, settled_blend

FAR = 24.0
"""Times the scale that counts as far off."""
SOME_FAR = 0.05
"""Share of the measurements far off, and"""
MOST_OF_THEM = 0.37
"""share of those beyond the bound, from which outliers are there. What clean captures leave tails off: a
fifth to a third of what is beyond the bound (8 to 15 % of the measurements) is four times as far.
Outliers of a twentieth of the pixels are found so, of a fiftieth not."""
UNEXPLAINED = 0.06
"""Relative misfit at the typical texel that asks for a look: a solution spoilt by outliers leaves nothing to
tell them by."""
LOOKED_AT = 1000
"""Texels of which that is asked."""
DECISIONS = 2
"""Times that the solver goes on after its own answer has decided what is left out."""


def solve_robustly(
    problem: Problem, options: SolveOptions | None = None, progress: Progress = SILENT
) -> Solution:
    """As ``solve``, and where there are outliers, without them.

    Without, the answer is that of ``solve``, bit for bit. With, ``Solution.outliers`` says how many there are
    and by what bound; texels of whose views no majority, three at least, agrees have no part in the
    representatives, and their ``relative_error`` is NaN.
    """
    options = options or SolveOptions()
    plain = solve(problem, options, progress)
    if not options.robustly or not suspicious(problem, plain, options):
        return plain
    with progress.stage("outliers"):
        start = robust_start(problem, options)
        trimmed = _trimmed(problem, *start, options)
    if not far_off(trimmed, problem.offsets):
        return plain
    solution = solve(problem.part(trimmed.kept, trimmed.agreed), options, progress)
    for _ in range(DECISIONS):
        trimmed = _trimmed(problem, solution.representatives, solution.n, trimmed.settled, options)
        # Nobody speaks for an answer that no texel agrees with.
        if not trimmed.agreed.any():
            return plain
        solution = resume(problem.part(trimmed.kept, trimmed.agreed), solution, options, progress)
    return _whole(problem, solution, trimmed, options)


def resume_robustly(
    problem: Problem, solution: Solution, options: SolveOptions | None = None, progress: Progress = SILENT
) -> Solution:
    """As ``resume``, and where the solution has left out outliers, without those of ``problem``.

    Where no texel of it agrees with the solution, the representatives stay as they are.
    """
    options = options or SolveOptions()
    if solution.outliers is None:
        return resume(problem, solution, options, progress)
    trimmed = _trimmed(problem, solution.representatives, solution.n, solution.outliers.scale, options)
    found = solution
    if trimmed.agreed.any():
        found = resume(problem.part(trimmed.kept, trimmed.agreed), solution, options, progress)
    return _whole(problem, found, trimmed, options)


def suspicious(problem: Problem, solution: Solution, options: SolveOptions) -> bool:
    """Whether a solution leaves more measurements far behind than it does in clean captures.

    Where texels have fewer views than have to agree, on average, there is nothing to tell outliers by.
    """
    if np.diff(problem.offsets).mean() < VOTES:
        return False
    if solution.noise > UNEXPLAINED:
        return True
    few = np.zeros(problem.texels, dtype=bool)
    few[:: -(-problem.texels // LOOKED_AT)] = True
    rows = np.repeat(few, np.diff(problem.offsets))
    offsets = offsets_of(problem, few)
    found = settled_blend(
        problem.fold(solution.representatives)[rows],
        problem.radiance[rows],
        offsets,
        solution.n,
        search=options.search,
        seed=options.seed,
    )
    return far_off(found, offsets)


def offsets_of(problem: Problem, texels: np.ndarray) -> I64:
    """Offsets of some of a problem's texels, Bool[M]."""
    return np.concatenate([[0], np.cumsum(np.diff(problem.offsets)[texels])]).astype(np.int64)


def far_off(trimmed: Trimmed, offsets: I64) -> bool:
    """Whether what is beyond the bound is far beyond it: outliers, and not the tail of a clean capture.

    Only where a texel's other views agree: a material that no representative explains is off in all views.
    """
    told = np.repeat(trimmed.agreed, np.diff(offsets))
    if not told.any():
        return False
    far = (trimmed.deviation[told] > FAR * trimmed.settled).mean()
    return bool(far > max(SOME_FAR, MOST_OF_THEM * (~trimmed.kept[told]).mean()))


def _trimmed(problem: Problem, representatives: F64, n: int, scale: float, options: SolveOptions) -> Trimmed:
    return settled_blend(
        problem.fold(representatives),
        problem.radiance,
        problem.offsets,
        n,
        scale,
        search=options.search,
        seed=options.seed,
    )


def _whole(problem: Problem, solution: Solution, trimmed: Trimmed, options: SolveOptions) -> Solution:
    """The solution of a part as one of all texels, each blended from what is kept of it."""
    trimmed = _trimmed(problem, solution.representatives, solution.n, trimmed.settled, options)
    weights = trimmed.blend.dense(solution.N)
    kept = problem.part(trimmed.kept, np.ones(problem.texels, dtype=bool))
    error = np.where(trimmed.agreed, kept.relative(trimmed.blend.squared_error), np.nan)
    outliers = Outliers(trimmed.scale, float((~trimmed.kept).mean()), float((~trimmed.agreed).mean()))
    return replace(solution, weights=weights, relative_error=error, outliers=outliers)

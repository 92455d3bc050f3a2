# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The outer search over n and N.

For each n the model grows a representative at a time until growing has stopped paying, then shrinks
again: a larger model that has found its way loses its weakest part and arrives at a better small one
than growing did. Local minima of the alternation are what spoils a greedy search (see
``paper_order.py`` for section 4's own); going up and down passes most of them.
"""

from __future__ import annotations

import numpy as np

from ..progress import SILENT, Progress
from . import moves
from .alternation import Alternation
from .options import SolveOptions
from .paper_order import paper_order
from .penalties import Penalties
from .problem import Problem
from .run import Run
from .solution import Solution

PATIENCE = 2
"""Representatives added in vain before growth stops."""


def solve(problem: Problem, options: SolveOptions | None = None, progress: Progress = SILENT) -> Solution:
    """Minimise Eq. 5 over representatives, blend weights, n and N.

    Returns:
        The best model found, the penalties it was judged by, and every (n, N) looked at.
    """
    options = options or SolveOptions()
    penalties = Penalties(problem.measurements, options.lambda0, options.lambda1)
    with progress.stage("solve") as task:
        run = Run(problem, options, penalties, task)
        if options.search_order == "paper":
            n, model = paper_order(run)
        else:
            n, model = _up_and_down(run)
    return Solution(
        representatives=model.representatives,
        weights=model.weights,
        relative_error=problem.gamma * model.squared_error,
        n=n,
        N=model.N,
        data=model.data,
        objective=penalties.objective(model.data, n, model.N),
        lambda0=penalties.lambda0,
        lambda1=penalties.lambda1,
        noise=float(np.sqrt(penalties.variance)),
        status="converged" if model.converged else "alternation limit",
        history=run.history,
    )


def _up_and_down(run: Run) -> tuple[int, Alternation]:
    options = run.options
    best: tuple[int, Alternation] | None = None
    for n in [options.n] if options.n else range(1, options.max_n + 1):
        ladder = _ladder(run, n)
        model = (
            ladder[options.N]
            if options.N
            else min(ladder.values(), key=lambda model: run.objective(model, n))
        )
        # Judge n by converged models: a coarse one may hide a gain of the sparser.
        model = run.settle(model, n, "refine", coarse=1.0)
        if best is None or run.objective(model, n) < run.objective(best[1], best[0]):
            best = (n, model)
        else:
            break
        if model.data < 1e-12:
            break
    assert best is not None
    return best


def _ladder(run: Run, n: int) -> dict[int, Alternation]:
    """The best model of each N for one n, up and down again."""
    problem, search = run.problem, run.options.search
    first = moves.start(problem, n, search)
    run.note(first, n, "start")
    ladder = {1: first}
    top = run.options.N + PATIENCE if run.options.N else run.options.max_N
    in_vain = 0
    while len(ladder) < top and (in_vain < PATIENCE or len(ladder) < max(n, run.options.N or 1)):
        model = ladder[len(ladder)]
        ladder[model.N + 1] = run.settle(moves.grow(problem, model, n, search), n, "grow")
        best = min(run.objective(m, n) for N, m in ladder.items() if N <= model.N)
        gained = run.objective(ladder[model.N + 1], n) < best
        in_vain = 0 if gained else in_vain + 1
    for N in range(len(ladder) - 1, 0, -1):
        smaller = run.settle(moves.shrink(problem, ladder[N + 1], n, search), n, "shrink")
        worse = run.objective(smaller, n) > min(run.objective(m, n) for m in ladder.values())
        if smaller.data < ladder[N].data:
            ladder[N] = smaller
        elif worse and N != run.options.N:
            # Below the best N a worse model that growing also had beaten: no further down.
            break
    return ladder

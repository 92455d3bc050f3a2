# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The outer search over n and N.

For each n the model grows a representative at a time until growing stops paying, then shrinks again: a
larger model that has found its way loses its weakest part and arrives at a better small one than
growing did. A model of n + 1 is in turn held down to n. Local minima of the alternation are what spoils
a greedy search (``paper_order.py`` is section 4's own); going up, down and across passes most of them.

The models are judged at the end, all by the same penalties: the noise that sets them is only known
once a good model is.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil

import numpy as np

from ..progress import SILENT, Progress
from . import moves
from .alternation import PERFECT, Alternation
from .options import SolveOptions
from .paper_order import paper_order
from .penalties import Penalties
from .problem import Problem
from .run import Run
from .solution import Move, Solution

PATIENCE = 2
"""Representatives added in vain before growth stops."""
WORTHWHILE = 0.88
"""Growth is in vain when it leaves more than this share of the data term."""
FINE = 0.1
"""Tolerance of alternations at the end, over the option's."""
HOPELESS = 1.3
"""An objective this many times the best is not improved upon by shrinking further."""
NEAR_PERFECT = 100 * PERFECT

EXPECTED_MODELS = 48
"""Models that a search with n up to 3 settles, about: the scale of its progress bar."""
EXPECTED_GROWTH = 4
"""As for a solution that is gone on from."""

Table = dict[tuple[int, int], Alternation]
"""The best model found for each (n, N)."""


def solve(problem: Problem, options: SolveOptions | None = None, progress: Progress = SILENT) -> Solution:
    """Minimise Eq. 5 over representatives, blend weights, n and N.

    Returns:
        The best model found, the penalties it was judged by, and every (n, N) looked at.
    """
    options = options or SolveOptions()
    penalties = penalties_of(problem, options)
    with progress.stage("solve", EXPECTED_MODELS) as task:
        run = Run(problem, options, penalties, task, EXPECTED_MODELS)
        n, model = paper_order(run) if options.search_order == "paper" else _explore_and_refine(run)
        run.finish()
    return _solution(run, n, model)


def resume(
    problem: Problem, solution: Solution, options: SolveOptions | None = None, progress: Progress = SILENT
) -> Solution:
    """Go on from a solution of other texels, and grow where those of ``problem`` show another material.

    n stays; N grows while that pays by the penalties. They follow the noise that was found there: what the
    solution cannot say here is no noise.
    """
    options = options or SolveOptions()
    penalties = penalties_of(problem, options, solution)
    with progress.stage("solve", EXPECTED_GROWTH) as task:
        run = Run(problem, options, penalties, task, EXPECTED_GROWTH, list(solution.history))
        nowhere = np.zeros((0, solution.N))
        start = Alternation(solution.representatives, nowhere, np.zeros(0), np.inf, 0, False)
        model = _grown(run, solution.n, start)
        run.finish()
    return _solution(run, solution.n, model)


def penalties_of(problem: Problem, options: SolveOptions, solution: Solution | None = None) -> Penalties:
    """Penalties for a problem, with the noise that a solution has found, if there is one."""
    freedom = float(np.mean(1 / problem.measurements))
    variance = np.inf if solution is None else solution.noise**2
    return Penalties(freedom, options.lambda0, options.lambda1, variance)


def _solution(run: Run, n: int, model: Alternation) -> Solution:
    problem, penalties = run.problem, run.penalties
    return Solution(
        representatives=model.representatives,
        weights=model.weights,
        relative_error=problem.relative(model.squared_error),
        n=n,
        N=model.N,
        data=model.data,
        objective=run.objective(model, n),
        lambda0=penalties.lambda0,
        lambda1=penalties.lambda1,
        noise=float(penalties.variance) ** 0.5,
        status="converged" if model.converged else "iteration limit",
        history=run.judged(),
    )


def _explore_and_refine(run: Run) -> tuple[int, Alternation]:
    """Explore on few texels, refine on all, and grow where those show a material the few had missed."""
    whole = run.problem
    run.problem = whole.thinned(run.options.explore_texels)
    n, model = up_down_and_across(run)
    if run.problem is whole:
        return n, model
    run.problem = whole
    return n, _grown(run, n, model)


def _grown(run: Run, n: int, model: Alternation) -> Alternation:
    """A model of other texels refined on the run's, and grown for as long as that pays."""
    model = run.settle(model, n, "refine", FINE)
    if run.options.N is None:
        for larger in _growing(run, n, model):
            model = larger
    return model


def _growing(run: Run, n: int, model: Alternation) -> Iterator[Alternation]:
    """Models of ever more representatives, each converged, for as long as that pays."""
    while run.most_representatives > model.N and model.data > NEAR_PERFECT:
        larger = run.settle(moves.grow(run.problem, model, n, run.options), n, "grow", FINE)
        if run.objective(larger, n) >= run.objective(model, n):
            return
        yield larger
        model = larger


def up_down_and_across(run: Run) -> tuple[int, Alternation]:
    """The default order of the search."""
    table: Table = {}
    options = run.options
    # One weight for each view beyond the first: a texel seen once has none to spare for a blend.
    views = float(run.problem.measurements.mean()) / 3
    last = options.n or max(1, min(options.max_n, options.N or options.max_N, ceil(views)))
    for n in range(options.n or 1, last + 1):
        _ladder(run, table, n)
        # A fixed n is helped by the models of n + 1 held down to it.
        if options.n and n < run.most_representatives:
            _ladder(run, table, n + 1)
            _hold_down(run, table, n + 1)
        elif n > 1:
            _hold_down(run, table, n)
        best = _best(run, table)
        if best[0] < n or table[best].data < NEAR_PERFECT:
            break
    _refine(run, table)
    best = _best(run, table)
    return best[0], table[best]


def _refine(run: Run, table: Table) -> None:
    """Converge the best model, and those beside it that came from it, until none of them is better.

    On the way models were left as soon as they slowed down. A model held down to fewer weights is also grown:
    it lacks materials that the further weight feigned.
    """
    problem, options = run.problem, run.options
    refined: set[tuple[int, int]] = set()
    beside: list[tuple[Alternation, int, Move]]
    while (best := _best(run, table)) not in refined:
        n, N = best
        refined.add(best)
        model = run.settle(table[best], n, "refine", FINE)
        _keep(run, table, n, model)
        beside = [(model, n - 1, "hold")] if options.n is None and n > 1 else []
        if options.N is None and n < N:
            beside.append((moves.shrink(problem, model, n, options), n, "shrink"))
        if options.N is None and run.most_representatives > N and model.data > NEAR_PERFECT:
            beside.append((moves.grow(problem, model, n, options), n, "grow"))
        for start, of, move in beside:
            settled = run.settle(start, of, move, FINE)
            _keep(run, table, of, settled)
            if move == "hold" and options.N is None:
                for larger in _growing(run, of, table[of, settled.N]):
                    _keep(run, table, of, larger)


def _best(run: Run, table: Table) -> tuple[int, int]:
    """(n, N) of the least objective, among those the options leave open; no n above N."""
    n, N = run.options.n, run.options.N
    eligible = [key for key in table if key[0] <= key[1] and n in (None, key[0]) and N in (None, key[1])]
    return min(eligible, key=lambda key: run.objective(table[key], key[0]))


def _keep(run: Run, table: Table, n: int, model: Alternation) -> bool:
    """Enter a model into the table if it is better than the one there."""
    rival = table.get((n, model.N))
    if rival is not None and run.data(rival) <= run.data(model):
        return False
    table[n, model.N] = model
    return True


def _ladder(run: Run, table: Table, n: int) -> None:
    """Grow from one representative until that stops paying, and shrink from there."""
    problem, options = run.problem, run.options
    model = moves.start(problem, n, options)
    run.note(model, n, "start")
    _keep(run, table, n, model)
    in_vain = 0
    while run.most_representatives > model.N and (in_vain < PATIENCE or run.least(n) > model.N):
        larger = run.settle(moves.grow(problem, model, n, options), n, "grow")
        in_vain = 0 if run.data(larger) < WORTHWHILE * run.data(model) else in_vain + 1
        model = larger
        _keep(run, table, n, model)
        if model.data < NEAR_PERFECT and run.least(n) <= model.N:
            break
    while max(1, run.least(n) - 1) < model.N:
        smaller = run.settle(moves.shrink(problem, table[n, model.N], n, options), n, "shrink")
        gained = _keep(run, table, n, smaller)
        best = _best_of(run, table, n)
        # Down to the best model whatever the ones on the way look like, and past it while that may gain.
        behind = run.objective(smaller, n) / run.objective(table[best], n)
        hopeless = behind > (HOPELESS if gained else 1.0) and best[1] > smaller.N
        if hopeless and model.N - 1 != run.options.N:
            break
        model = smaller


def _best_of(run: Run, table: Table, n: int) -> tuple[int, int]:
    return min((key for key in table if key[0] == n), key=lambda key: run.objective(table[key], n))


def _hold_down(run: Run, table: Table, n: int) -> None:
    """Restrict the best models of n to n - 1 and see where they settle."""
    N = _best_of(run, table, n)[1]
    for key in ((n, N), (n, N - 1)):
        if key in table and key[1] >= n - 1:
            _keep(run, table, n - 1, run.settle(table[key], n - 1, "hold"))

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Section 4's outer loops to the letter: ``--search-order paper``.

n from 1 up, and for each n again N from 1 up; either loop ends when the objective first increases, and
the value before is kept. A new representative is fitted to the texels whose relative error exceeds a
threshold, 0.1 at first and 0.8 times that for each further N, and takes over all of their weight.
The penalties are the caller's; where they are automatic they follow the residuals as in the other order.
"""

from __future__ import annotations

import numpy as np

from . import moves
from .alternation import Alternation
from .run import Run

FIRST_THRESHOLD = 0.1
"""On the norm of the relative error, not its square."""
DECAY = 0.8


def paper_order(run: Run) -> tuple[int, Alternation]:
    """The greedy search of section 4 (n and N fixed where the options say so)."""
    options = run.options
    best: tuple[int, Alternation] | None = None
    for n in [options.n] if options.n else range(1, options.max_n + 1):
        model = _representatives_for(run, n)
        if best is not None and run.objective(model, n) > run.objective(best[1], best[0]):
            break
        best = (n, model)
    assert best is not None
    return best


def _representatives_for(run: Run, n: int) -> Alternation:
    model = run.settle(moves.start(run.problem, n, run.options.search), n, "start", coarse=1.0)
    threshold = FIRST_THRESHOLD
    while (run.options.N or run.options.max_N) > model.N:
        error = np.sqrt(run.problem.gamma * model.squared_error)
        chosen = error > threshold
        threshold *= DECAY
        if not chosen.any():
            if threshold < 1e-6:
                break
            continue
        weights, representatives = moves.with_new(
            run.problem, model, chosen, shared=False, n=n, search=run.options.search
        )
        seeded = Alternation(representatives, weights, model.squared_error, model.data, 0, False)
        grown = run.settle(seeded, n, "grow", coarse=1.0)
        if run.options.N is None and run.objective(grown, n) > run.objective(model, n):
            break
        model = grown
    return model

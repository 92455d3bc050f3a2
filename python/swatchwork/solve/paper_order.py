# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Section 4's outer loops to the letter: ``--search-order paper``.

n from 1 up, and for each n again N from 1 up; either loop ends when the objective first increases, and
the value before is kept. A new representative is fitted to the texels whose relative error exceeds a
threshold, 0.1 at first and 0.8 times that for each further N, and takes over all of their weight. Where no
texel exceeds it, of which section 4 says nothing, the threshold falls until one does.
Representatives and weights alternate, without joint steps. The penalties are the caller's; where they are
automatic they follow the residuals, and outliers count by their root, as in the other order (penalties.py).
Representatives are held to the possible here too (problem.py).
"""

from __future__ import annotations

import numpy as np

from . import moves
from .alternation import Alternation
from .run import Run

FIRST_THRESHOLD = 0.1
"""On the norm of the relative error, not its square."""
DECAY = 0.8
PERFECT = 1e-6
"""A relative error below which no texel asks for a new representative."""


def paper_order(run: Run) -> tuple[int, Alternation]:
    """The greedy search of section 4 (n and N fixed where the options say so)."""
    options = run.options
    best: tuple[int, Alternation] | None = None
    last = min(options.max_n, options.N or options.max_N)
    for n in [options.n] if options.n else range(1, last + 1):
        model = _representatives_for(run, n)
        if best is not None and run.objective(model, n) > run.objective(best[1], best[0]):
            break
        best = (n, model)
    assert best is not None
    n, model = best
    return min(n, model.N), model


def _representatives_for(run: Run, n: int) -> Alternation:
    model = run.settle(moves.start(run.problem, n, run.options), n, "start", coarse=1.0)
    threshold = FIRST_THRESHOLD
    while (run.options.N or run.options.max_N) > model.N:
        error = np.sqrt(run.problem.relative(model.squared_error))
        while error.max() <= threshold and threshold > PERFECT:
            threshold *= DECAY
        chosen = error > threshold
        threshold *= DECAY
        if not chosen.any():
            break
        weights, representatives = moves.with_new(
            run.problem, model, chosen, shared=False, n=n, options=run.options
        )
        seeded = Alternation(representatives, weights, model.squared_error, model.data, 0, False)
        grown = run.settle(seeded, n, "grow", coarse=1.0)
        if run.options.N is None and run.objective(grown, n) > run.objective(model, n):
            break
        model = grown
    return model

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a search over n and N carries along, whatever its order."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import F64
from ..progress import Task
from .alternation import Alternation, alternate
from .blending import blend
from .options import MOST_REPRESENTATIVES, SolveOptions
from .penalties import Penalties
from .problem import Problem
from .solution import Move, Step

COARSE = 5.0
"""The tolerance of alternations on the way, over that of the last refinement."""


@dataclass
class Run:
    """The problem, the options, the penalties as they stand, and the history."""

    problem: Problem
    options: SolveOptions
    penalties: Penalties
    task: Task
    ahead: float = 0.0
    """Steps of the task's total that are left."""
    history: list[Step] = field(default_factory=list)
    errors: dict[int, tuple[F64, F64]] = field(default_factory=dict)
    """Squared relative errors [M] and shares [M] of the models in the history, by their place there."""

    def settle(self, model: Alternation, n: int, move: Move, coarse: float = COARSE) -> Alternation:
        """Alternate to convergence from a model, and write down where it ended.

        A model of another problem (thinned, or with more texels) starts from its representatives.
        """
        options, problem = self.options, self.problem
        weights = model.weights
        if len(weights) != problem.texels:
            folded = problem.fold(model.representatives)
            weights = blend(
                folded, problem.radiance, problem.offsets, n, search=options.search, seed=options.seed
            ).weights
        settled = alternate(
            problem,
            n,
            weights=weights,
            representatives=model.representatives,
            search=options.search,
            tolerance=coarse * options.tolerance,
            most=options.max_alternations,
            seed=options.seed,
            joint=options.joint,
        )
        self.note(settled, n, move)
        return settled

    def note(self, model: Alternation, n: int, move: Move) -> None:
        relative = self._relative(model)
        self.penalties.observe(relative, self.problem.measurements, n, model.N)
        self.errors[len(self.history)] = relative, self.problem.share
        self.history.append(Step(n, model.N, move, model.count, model.data, self.objective(model, n)))
        error = 100 * np.sqrt(model.data)
        self.task.describe(f"n = {n}, N = {model.N}: relative error {error:.2g} %")
        # The number of models is not known beforehand: the bar slows down towards its end.
        step = min(1.0, self.ahead / 8)
        self.ahead -= step
        self.task.advance(step)

    def judged(self) -> list[Step]:
        """The history with every objective by the penalties as they stand now."""
        penalties = self.penalties
        return [
            replace(step, objective=penalties.objective(penalties.data(*self.errors[i]), step.n, step.N))
            if i in self.errors
            else step
            for i, step in enumerate(self.history)
        ]

    def finish(self) -> None:
        """Fill the progress bar."""
        self.task.advance(self.ahead)
        self.ahead = 0.0

    def objective(self, model: Alternation, n: int) -> float:
        return self.penalties.objective(self.data(model), n, model.N)

    def data(self, model: Alternation) -> float:
        """The data term that models are compared by."""
        return self.penalties.data(self._relative(model), self.problem.share)

    def _relative(self, model: Alternation) -> F64:
        return self.problem.relative(model.squared_error)

    @property
    def most_representatives(self) -> int:
        """Where growth ends: two above a fixed N, so that shrinking arrives there too."""
        return min(self.options.N + 2, MOST_REPRESENTATIVES) if self.options.N else self.options.max_N

    def least(self, n: int) -> int:
        """The fewest representatives that growth has to reach."""
        return max(n, self.options.N or 1)

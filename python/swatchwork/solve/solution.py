# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What the solver returns: never a bare array."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from ..arrays import F64
from ..keeping import Array, Kept

Status = Literal["converged", "iteration limit"]
Move = Literal["start", "grow", "shrink", "hold", "refine"]


@dataclass(frozen=True)
class Step:
    """One (n, N) that the search looked at."""

    n: int
    N: int
    move: Move
    """What led there; `hold` is a model of n + 1 held down to n."""
    alternations: int
    data: float
    """Data term of Eq. 5, a mean over texels of squared relative errors."""
    objective: float
    """By the penalties at the end; where they follow the noise, outliers count by their root."""


@dataclass(frozen=True)
class Outliers:
    """What was left out of a solution as outliers."""

    scale: float
    """Of what is kept; a measurement further off than ``BOUND`` times that is out (``trimming.py``)."""
    left_out: float
    """Share of the measurements of the problem's texels."""
    undecided: float
    """Share of the texels of whose views no majority agrees."""


@dataclass(frozen=True)
class Solution:
    """Representatives, the texels' blends, and how they were found."""

    representatives: F64
    """[N, J, 3] weights w* of the generic kernels, per colour channel."""
    weights: F64
    """[M, N] blend weights of the problem's texels."""
    relative_error: F64
    """[M] ||s_hat - s||^2 / ||s_hat||^2 at each texel; NaN where outliers leave no majority of views."""
    n: int
    N: int
    data: float
    objective: float
    lambda0: float
    lambda1: float
    noise: float
    """Relative root-mean-square of what a model leaves at the typical texel, freedoms counted off."""
    status: Status
    history: list[Step] = field(default_factory=list)
    outliers: Outliers | None = None
    """None where none were found, or looked for: every measurement counts."""

    def arrays(self) -> dict[str, Array]:
        """Everything, as arrays that ``of`` reads."""
        summary = np.frombuffer(json.dumps(self.summary()).encode(), dtype=np.uint8)
        return {
            "representatives": self.representatives,
            "weights": self.weights,
            "relative_error": self.relative_error,
            "summary": summary,
        }

    @classmethod
    def of(cls, kept: Kept) -> Solution:
        """The solution whose ``arrays`` were kept, bit for bit."""
        summary = json.loads(kept.rows("summary").tobytes())
        history = [Step(**step) for step in summary.pop("history")]
        outliers = summary.pop("outliers")
        return cls(
            representatives=kept.rows("representatives"),
            weights=kept.rows("weights"),
            relative_error=kept.rows("relative_error"),
            history=history,
            outliers=outliers and Outliers(**outliers),
            **summary,
        )

    def summary(self) -> dict[str, Any]:
        """Everything but the arrays, for JSON."""
        return {
            "n": self.n,
            "N": self.N,
            "data": self.data,
            "objective": self.objective,
            "lambda0": self.lambda0,
            "lambda1": self.lambda1,
            "noise": self.noise,
            "status": self.status,
            "outliers": self.outliers and asdict(self.outliers),
            "history": [asdict(step) for step in self.history],
        }

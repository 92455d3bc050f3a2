# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Representatives from measurements many of which are outliers, with nothing known to begin with.

The model grows by one representative at a time, as the plain search's does. After each step every texel's
blend is that of the views that agree, by a bound that falls with the residuals; the representatives are
fitted to those. Texels whose views do not agree yet may show a material that is still to come: theirs stay
in, each the less the further off it is (Geman and McClure 1987), and a new representative is
proposed from them.
"""

from __future__ import annotations

import numpy as np

from ..arrays import F64
from . import moves
from .alternation import Alternation, alternate
from .options import SolveOptions
from .problem import Problem
from .trimming import BOUND, Trimmed, medians, settled_blend, trimmed_blend

TEXELS = 700
BLENDED = 2
"""Representatives blended on the way, where the option leaves it open."""
MOST = 8
"""Representatives on the way, where the option leaves it open: enough to tell materials from outliers."""
BRIGHT = 25.0
"""Energy over the texel's median beyond which a measurement waits outside until there is a model."""
ALTERNATIONS = 4
ROUNDS = 3
"""Votes, and fits to them, for each number of representatives."""
OUT = 1e-6
"""Weight of what is left out."""
UNDECIDED = 0.3
"""Share of a texel whose views do not agree."""
WORTHWHILE = 0.9
"""Growth ends when the scale falls to more than this share of it,"""
PATIENCE = 2
"""so many times."""


def robust_start(problem: Problem, options: SolveOptions) -> tuple[F64, int, float]:
    """Representatives [N, J, 3], how many to blend, and the scale of what they leave."""
    whole = problem.thinned(TEXELS)
    energy = (whole.radiance.astype(np.float64) ** 2).sum(axis=1)
    texel = np.repeat(np.arange(whole.texels), np.diff(whole.offsets))
    weight = np.where(energy > BRIGHT * medians(energy, whole.offsets)[texel], OUT, 1.0)
    part = whole.weighted(weight, np.ones(whole.texels))
    model = moves.start(part, 1, options)
    scale = settled_blend(whole.fold(model.representatives), whole.radiance, whole.offsets, 1).settled
    found = model.representatives, 1, scale
    best, in_vain, most = np.inf, 0, options.N or min(MOST, options.max_N)
    for N in range(1, most + 1):
        n = min(options.n or min(BLENDED, options.max_n), N)
        if N > 1:
            model = moves.grow(part, model, n, options)
        for _ in range(ROUNDS):
            trimmed = trimmed_blend(
                whole.fold(model.representatives),
                whole.radiance,
                whole.offsets,
                n,
                scale,
                search=options.search,
                seed=options.seed,
            )
            scale = trimmed.settled
            weight, share = _weights(trimmed, scale, texel)
            part = whole.weighted(weight, share)
            model = _fitted(part, model, n, trimmed, options)
        in_vain += 1
        # What is added in vain is made of outliers, and would have them agree.
        if scale < WORTHWHILE * best or options.N is not None:
            found, best, in_vain = (model.representatives, n, scale), min(best, scale), 0
        if in_vain == PATIENCE:
            break
    return found


def _weights(trimmed: Trimmed, scale: float, texel: np.ndarray) -> tuple[F64, F64]:
    """Weights [P] of measurements and shares [M] of texels."""
    soft = 1 / (1 + (trimmed.deviation / (BOUND * scale)) ** 2)
    weight = np.where(trimmed.agreed[texel], trimmed.kept, soft)
    return np.maximum(weight, OUT), np.where(trimmed.agreed, 1.0, UNDECIDED)


def _fitted(
    part: Problem, model: Alternation, n: int, trimmed: Trimmed, options: SolveOptions
) -> Alternation:
    return alternate(
        part,
        n,
        weights=trimmed.blend.dense(model.N),
        representatives=model.representatives,
        search=options.search,
        most=ALTERNATIONS,
        seed=options.seed,
        joint=options.joint,
    )

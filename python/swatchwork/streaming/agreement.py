# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Which measurements of some texels a solution that has met outliers keeps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import F32, I64, Bool
from ..observe import Pairs, Rendering
from ..reflectance import GenericBasis
from ..solve import Search, Solution, Trimmed, trimmed_blend

LEAST = 2
"""Views that have to agree with one blend for a texel to be decided: one alone fits some blend or other.
With a fifth of the pixels outliers (12 views of two synthetic objects), and the nearest decided blend for
the others, novel-light NRMS is 8.2 and 10.2 % so, 9.8 and 15 % where one is enough, 7.8 and 10.4 % where
it has to be the majority, and 17 and 35 % where the others keep what they have; on clean photographs it
is 6.3 and 8.0 %."""


@dataclass(frozen=True)
class Agreement:
    """The pairs of T texels, and those of them that agree with one blend a texel."""

    pairs: Pairs
    """All of them."""
    responses: F32
    """[P, N, 3] of the representatives, for all pairs."""
    trimmed: Trimmed
    agreeing: I64
    """[T] views that agree with the texel's blend."""

    @property
    def decided(self) -> Bool:
        """[T] whether enough views agree; what one view alone shows is never decided."""
        return self.agreeing >= LEAST

    @property
    def kept(self) -> Pairs:
        """The pairs that are kept; every texel has some."""
        return only(self.pairs, self.trimmed.kept)


def agreement(
    rendering: Rendering, basis: GenericBasis, solution: Solution, texels: I64, search: Search, seed: int
) -> Agreement:
    """Vote on the measurements of ``texels`` [T], which must rise, by the solution's own scale."""
    assert solution.outliers is not None, "without outliers there is nothing to vote on"
    pairs = rendering.pairs(texels)
    responses = rendering.representatives(basis, solution.representatives, pairs)
    trimmed = trimmed_blend(
        responses,
        pairs.radiance,
        pairs.offsets,
        solution.n,
        solution.outliers.scale,
        search=search,
        seed=seed,
        usual=rendering.observations.typical,
    )
    within = trimmed.deviation <= trimmed.bound
    agreeing = np.add.reduceat(within, pairs.offsets[:-1], dtype=np.int64)
    return Agreement(pairs, responses, trimmed, agreeing)


def only(pairs: Pairs, kept: Bool) -> Pairs:
    """Some of the pairs, Bool[P]; a texel of which none are left is left out."""
    seen = pairs.seen
    texel = np.repeat(np.arange(len(seen.texels)), np.diff(seen.offsets))[kept]
    views = np.bincount(texel, minlength=len(seen.texels))
    fewer = replace(
        seen,
        texels=seen.texels[views > 0],
        offsets=np.concatenate([[0], np.cumsum(views[views > 0])]).astype(np.int64),
        **{
            name: getattr(seen, name)[kept]
            for name in ("texel", "frame", "radiance", "normal", "to_viewer", "cosine")
        },
    )
    return Pairs(fewer, pairs.radiance[kept], pairs.weight[kept])

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The blend of every texel (Eq. 12), tile by tile: responses are computed, folded, used and dropped."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import F32, I32, I64, U8
from ..keeping import IN_MEMORY, Array, Keeper
from ..observe import Rendering
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..solve import Search, Solution, sparse_blend
from ..surface import Atlas, each_of
from .budget import Budget

MANY = 1 << 18
"""Seen texels that an unseen one's nearest is looked for among: a larger atlas is thinned, to save memory."""


@dataclass(frozen=True)
class TexelBlend:
    """The blend of M texels; one that no view sees takes that of the nearest seen."""

    index: U8
    """[M, n] representatives blended at each texel."""
    weight: F32
    """[M, n] their weights; they sum to 1."""
    residual: F32
    """[M] relative error of each texel's measurements, NaN where no view sees it."""


def blend_every_texel(
    rendering: Rendering,
    basis: GenericBasis,
    solution: Solution,
    search: Search = "exact",
    seed: int = 0,
    budget: Budget | None = None,
    progress: Progress = SILENT,
    keeper: Keeper = IN_MEMORY,
) -> TexelBlend:
    """Blend all texels with a solution's representatives.

    The exact search gives the same blends whatever the budget; the pruned one samples each tile by itself.
    """
    observations, n = rendering.observations, solution.n
    M = len(observations.coverage)
    index, weight = np.zeros((M, n), dtype=np.uint8), np.zeros((M, n), dtype=np.float32)
    residual = np.full(M, np.nan, dtype=np.float32)
    seen = observations.seen
    pairs_at_once = (budget or Budget()).tile(solution.N)
    with progress.stage("Blending texels", len(seen)) as task:
        for number, tile in enumerate(rendering.tiles(seen, pairs_at_once)):
            make = partial(blend_tile, rendering, basis, solution, tile, search, seed)
            found = keeper.kept(f"blend-{number:05d}", make)
            index[tile], weight[tile] = found.rows("index"), found.rows("weight")
            residual[tile] = found.rows("residual")
            task.advance(len(tile))
    unseen = np.flatnonzero(observations.coverage == 0)
    if len(unseen):
        nearest = _nearest(observations.atlas, seen, unseen)
        index[unseen], weight[unseen] = index[nearest], weight[nearest]
    return TexelBlend(index, weight, residual)


def _nearest(atlas: Atlas, seen: I32, unseen: I64) -> I32:
    """The seen texel nearest to each unseen one, among MANY of them."""
    among = seen[:: -(-len(seen) // MANY)].astype(np.int64)
    tree = cKDTree(atlas.position(among))
    found = np.empty(len(unseen), dtype=np.int32)

    def fill(part: slice) -> None:
        found[part] = among[tree.query(atlas.position(unseen[part]))[1]]

    each_of(fill, len(unseen))
    return found


def blend_tile(
    rendering: Rendering, basis: GenericBasis, solution: Solution, tile: I64, search: Search, seed: int
) -> dict[str, Array]:
    """``index`` U8[T, n], ``weight`` F32[T, n] and ``residual`` F32[T] of some texels."""
    pairs = rendering.pairs(tile)
    responses = rendering.representatives(basis, solution.representatives, pairs)
    best = sparse_blend(responses, pairs.radiance, pairs.offsets, solution.n, search=search, seed=seed)
    residual = rendering.relative_error(pairs, best.squared_error).astype(np.float32)
    return {"index": best.index.astype(np.uint8), "weight": best.weight, "residual": residual}

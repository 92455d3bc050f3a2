# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The blend of every texel (Eq. 12), tile by tile: responses are computed, folded, used and dropped."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ..arrays import F32, F64, I32, I64, U8
from ..keeping import IN_MEMORY, Array, Keeper
from ..observe import Rendering
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..solve import Search, Solution, sparse_blend
from ..surface import fill_gutter, padded
from .agreement import LEAST, agreement
from .budget import Budget
from .neighbours import nearest, take_neighbours_blends


@dataclass(frozen=True)
class TexelBlend:
    """The blend of every texel, as images over the atlas.

    A texel that no view sees takes the blend of the nearest other, a pixel of the gutter that of its nearest
    texel. One of which no two views agree, or that one view sees, takes a neighbour's that a view agrees with
    where there are outliers, else one of its own that a view agrees with, else the nearest other's too. They
    are images from the start, for a second copy of them would be most of a large atlas's memory.
    """

    index: U8
    """[H, W, n] representatives blended at each texel."""
    weight: F32
    """[H, W, n] their weights; they sum to 1."""
    residual: F32
    """[H, W] relative error of each texel's kept measurements, 0 where it is undecided or unseen and in the
    gutter."""
    texel_of_pixel: I32
    """[H, W] the texel at each pixel, in the gutter the nearest one."""
    undecided: I64 = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Texels that views see, but no two that agree, or only one, where there are outliers."""
    counts: I64 | None = None
    """[2, k] each frame's measurements, and how many of them were left out; None without outliers."""

    @property
    def left_out(self) -> float:
        """Share of the measurements that were left out as outliers."""
        return 0.0 if self.counts is None else float(self.counts[1].sum() / self.counts[0].sum())

    @property
    def left_out_by_frame(self) -> F64 | None:
        """[k] the same of each frame; None where no outliers were found."""
        return None if self.counts is None else self.counts[1] / np.maximum(self.counts[0], 1)


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
    atlas, seen = observations.atlas, observations.seen
    pixel, size = atlas.pixel, atlas.resolution
    index, weight = (np.zeros((size * size, n), dtype=kind) for kind in (np.uint8, np.float32))
    residual = np.zeros(size * size, dtype=np.float32)
    pairs_at_once = (budget or Budget()).tile(solution.N)
    agreeing = (observations.coverage > 0) * np.uint8(LEAST)
    counts = np.zeros((2, len(observations.viewer)), dtype=np.int64)
    with progress.stage("Blending texels", len(seen)) as task:
        for number, tile in enumerate(rendering.tiles(seen, pairs_at_once)):
            make = partial(blend_tile, rendering, basis, solution, tile, search, seed)
            found = keeper.kept(f"blend-{number:05d}", make)
            at = pixel[tile]
            index[at], weight[at] = found.rows("index"), found.rows("weight")
            residual[at] = found.rows("residual")
            if solution.outliers is not None:
                agreeing[tile] = found.rows("agreeing")
                counts += found.rows("counts")
            task.advance(len(tile))
    decided = agreeing >= LEAST
    undecided = seen[~decided[seen]].astype(np.int64)
    given = agreeing > 0
    if len(undecided) and decided.any():
        given[undecided] |= take_neighbours_blends(
            rendering,
            basis,
            solution,
            undecided,
            np.flatnonzero(decided).astype(np.int32),
            (index, weight),
            pairs_at_once,
            progress,
        )
    # Where nothing agrees anywhere, all keep what fits them best: there is nothing better to take.
    if not given.any():
        given = observations.coverage > 0
    unseen = np.flatnonzero(~given)
    if len(unseen):
        at, source = pixel[unseen], pixel[nearest(atlas, np.flatnonzero(given).astype(np.int32), unseen)]
        index[at], weight[at] = index[source], weight[source]
    residual[pixel[~decided]] = 0
    blend = TexelBlend(
        index.reshape(size, size, n),
        weight.reshape(size, size, n),
        residual.reshape(size, size),
        padded(atlas),
        undecided,
        None if solution.outliers is None else counts,
    )
    for image in (blend.index, blend.weight):
        fill_gutter(image, atlas, blend.texel_of_pixel)
    return blend


def blend_tile(
    rendering: Rendering, basis: GenericBasis, solution: Solution, tile: I64, search: Search, seed: int
) -> dict[str, Array]:
    """``index`` U8[T, n], ``weight`` F32[T, n] and ``residual`` F32[T] of some texels.

    Where the solution has outliers also ``agreeing`` U8[T], how many views agree with the blend, and
    ``counts`` I64[2, k], each frame's measurements and how many of them were left out.
    """
    if solution.outliers is None:
        pairs = rendering.pairs(tile)
        responses = rendering.representatives(basis, solution.representatives, pairs)
        best = sparse_blend(responses, pairs.radiance, pairs.offsets, solution.n, search=search, seed=seed)
        residual = rendering.relative_error(pairs, best.squared_error).astype(np.float32)
        return {"index": best.index.astype(np.uint8), "weight": best.weight, "residual": residual}
    vote = agreement(rendering, basis, solution, tile, search, seed)
    best, frames = vote.trimmed.blend, len(rendering.observations.viewer)
    error = rendering.relative_error(vote.kept, best.squared_error)
    every = vote.pairs.seen.frame
    counts = [np.bincount(of, minlength=frames) for of in (every, every[~vote.trimmed.kept])]
    return {
        "index": best.index.astype(np.uint8),
        "weight": best.weight,
        "residual": error.astype(np.float32),
        "agreeing": np.minimum(vote.agreeing, 255).astype(np.uint8),
        "counts": np.stack(counts),
    }

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The blend of every texel (Eq. 12), tile by tile: responses are computed, folded, used and dropped."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import F32, F64, I32, I64, U8, Bool, norm
from ..keeping import IN_MEMORY, Array, Keeper
from ..observe import Rendering
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..solve import Search, Solution, sparse_blend
from ..surface import Atlas, each_of, fill_gutter, padded
from .agreement import agreement
from .budget import Budget

MANY = 1 << 18
"""Seen texels that an unseen one's nearest is looked for among: a larger atlas is thinned, to save memory."""

SOME = 1 << 13
"""Unseen texels whose nearest is looked for wherever they lie."""
NEIGHBOURS = 4


@dataclass(frozen=True)
class TexelBlend:
    """The blend of every texel, as images over the atlas.

    A texel that no view sees, or of which outliers leave too few views to tell, takes the blend of the
    nearest other, a pixel of the gutter that of its nearest texel. They are images from the start, for a
    second copy of them would be most of a large atlas's memory.
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
    """Texels that views see, but no two that agree, or only one, where there are outliers: filled as if
    unseen."""
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
    decided: Bool = observations.coverage > 0
    counts = np.zeros((2, len(observations.viewer)), dtype=np.int64)
    with progress.stage("Blending texels", len(seen)) as task:
        for number, tile in enumerate(rendering.tiles(seen, pairs_at_once)):
            make = partial(blend_tile, rendering, basis, solution, tile, search, seed)
            found = keeper.kept(f"blend-{number:05d}", make)
            at = pixel[tile]
            index[at], weight[at] = found.rows("index"), found.rows("weight")
            residual[at] = found.rows("residual")
            if solution.outliers is not None:
                decided[tile] = found.rows("decided")
                counts += found.rows("counts")
            task.advance(len(tile))
    # Where no texel at all is decided, all keep what fits them best: there is nothing better to take.
    given = decided if decided.any() else observations.coverage > 0
    unseen = np.flatnonzero(~given)
    if len(unseen):
        at, nearest = pixel[unseen], pixel[_nearest(atlas, np.flatnonzero(given).astype(np.int32), unseen)]
        index[at], weight[at], residual[at] = index[nearest], weight[nearest], 0
    blend = TexelBlend(
        index.reshape(size, size, n),
        weight.reshape(size, size, n),
        residual.reshape(size, size),
        padded(atlas),
        seen[~decided[seen]].astype(np.int64),
        None if solution.outliers is None else counts,
    )
    for image in (blend.index, blend.weight):
        fill_gutter(image, atlas, blend.texel_of_pixel)
    return blend


def _nearest(atlas: Atlas, seen: I32, unseen: I64) -> I32:
    """The seen texel nearest to each unseen one, among MANY of them.

    Far from all seen ones a tree visits half of them, a millisecond each: there SOME are looked for, and the
    others take the best of what their neighbours found. Those nearby, whose blend shows beside the
    photographed surface, are all looked for.
    """
    among = seen[:: -(-len(seen) // MANY)].astype(np.int64)
    tree = cKDTree(atlas.position(among))
    stride = -(-len(unseen) // SOME)
    some = unseen[::stride]
    of_some = np.empty(len(some), dtype=np.int64)

    def look_for(part: slice) -> None:
        of_some[part] = among[tree.query(atlas.position(some[part]))[1]]

    each_of(look_for, len(some))
    if stride == 1:
        return of_some.astype(np.int32)
    neighbours = cKDTree(atlas.position(some))
    # Twice the distance of those looked for, as if all lay in one plane.
    near = 2 * np.sqrt(stride * float(np.median(atlas.footprint(some))))
    found = np.empty(len(unseen), dtype=np.int32)

    def fill(part: slice) -> None:
        position = atlas.position(unseen[part])
        candidates = of_some[np.asarray(neighbours.query(position, k=NEIGHBOURS)[1])]
        there = atlas.position(candidates.ravel()).reshape(*candidates.shape, 3)
        best = norm(there - position[:, None]).argmin(axis=1)
        chosen = candidates[np.arange(len(position)), best]
        distance, place = map(np.asarray, tree.query(position, distance_upper_bound=near))
        close = np.isfinite(distance)
        chosen[close] = among[place[close]]
        found[part] = chosen

    each_of(fill, len(unseen))
    return found


def blend_tile(
    rendering: Rendering, basis: GenericBasis, solution: Solution, tile: I64, search: Search, seed: int
) -> dict[str, Array]:
    """``index`` U8[T, n], ``weight`` F32[T, n] and ``residual`` F32[T] of some texels.

    Where the solution has outliers also ``decided`` Bool[T], and ``counts`` I64[2, k], each frame's
    measurements and how many of them were left out.
    """
    if solution.outliers is None:
        pairs = rendering.pairs(tile)
        responses = rendering.representatives(basis, solution.representatives, pairs)
        best = sparse_blend(responses, pairs.radiance, pairs.offsets, solution.n, search=search, seed=seed)
        residual = rendering.relative_error(pairs, best.squared_error).astype(np.float32)
        return {"index": best.index.astype(np.uint8), "weight": best.weight, "residual": residual}
    agreeing = agreement(rendering, basis, solution, tile, search, seed)
    best, frames = agreeing.trimmed.blend, len(rendering.observations.viewer)
    error = rendering.relative_error(agreeing.kept, best.squared_error)
    every = agreeing.pairs.seen.frame
    counts = [np.bincount(of, minlength=frames) for of in (every, every[~agreeing.trimmed.kept])]
    return {
        "index": best.index.astype(np.uint8),
        "weight": best.weight,
        "residual": error.astype(np.float32),
        "decided": agreeing.decided,
        "counts": np.stack(counts),
    }

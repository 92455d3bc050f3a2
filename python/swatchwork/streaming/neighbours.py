# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What texels take from others nearby: those that no view sees, or too few to tell outliers by."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import F32, I32, I64, U8, Bool, norm
from ..observe import Rendering
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..solve import Solution, seconded
from ..surface import Atlas, each_of

MANY = 1 << 18
"""Texels that another's nearest is looked for among: a larger atlas is thinned, to save memory."""

SOME = 1 << 13
"""Unseen texels whose nearest is looked for wherever they lie."""

NEIGHBOURS = 4

CANDIDATES = 32
"""Decided texels nearby whose blends an undecided one tries. With a fifth of the pixels outliers, and many
texels that one or two views see (sphere and peanut of scripts/measure/robust.py, seed 1), novel-light NRMS
is 17 and 10.2 % with the nearest one's blend, 14 and 9.3 % with the best of 32, the nearest where no view
agrees with any, and 7.4 and 9.5 % where those then keep a blend of their own that a view agrees with."""

QUERIES = 1 << 10
"""Texels that a thread looks up at once: far from all others a query takes most of a millisecond."""

MEMORY = 6
"""Times the memory of a texel's pairs, where there is one, that its candidates and their places take."""


def tree_of(atlas: Atlas, texels: I32 | I64) -> tuple[cKDTree, I64]:
    """A tree of the positions of ``texels``, thinned to MANY, and which those are."""
    among = texels[:: -(-len(texels) // MANY)].astype(np.int64)
    return cKDTree(atlas.position(among)), among


def nearest(atlas: Atlas, seen: I32, unseen: I64) -> I32:
    """The seen texel nearest to each unseen one, among MANY of them.

    Far from all seen ones a tree visits half of them, a millisecond each: there SOME are looked for, and the
    others take the best of what their neighbours found. Those nearby, whose blend shows beside the
    photographed surface, are all looked for.
    """
    tree, among = tree_of(atlas, seen)
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


def take_neighbours_blends(
    rendering: Rendering,
    basis: GenericBasis,
    solution: Solution,
    undecided: I64,
    decided: I32,
    images: tuple[U8, F32],
    pairs_at_once: int,
    progress: Progress = SILENT,
) -> Bool:
    """Give undecided texels the blend of a decided one nearby that a view of theirs agrees with, if one does.

    The answer does not depend on the tiles.

    Args:
        undecided: [U], rising; ``decided`` [D], one at least.
        images: index and weight [H * W, n] of all texels' blends, changed in place.

    Returns:
        [U] which of them have one.
    """
    assert solution.outliers is not None, "without outliers all texels that views see are decided"
    atlas, observations = rendering.observations.atlas, rendering.observations
    tree, among = tree_of(atlas, decided)
    candidates = min(CANDIDATES, len(among))
    index, weight = images
    taken: list[Bool] = []
    with progress.stage("Asking neighbours", len(undecided)) as task:
        for tile in rendering.tiles(undecided, -(-pairs_at_once // MEMORY)):
            at = np.empty((len(tile), candidates), dtype=np.int64)

            def look_for(part: slice, tile: I64 = tile, at: I64 = at) -> None:
                close = np.asarray(tree.query(atlas.position(tile[part]), k=candidates)[1])
                at[part] = atlas.pixel[among[close.reshape(-1, candidates)]]

            each_of(look_for, len(tile), QUERIES)
            pairs = rendering.pairs(tile)
            best, agreeing = seconded(
                rendering.representatives(basis, solution.representatives, pairs),
                pairs.radiance,
                pairs.offsets,
                index[at],
                weight[at],
                solution.outliers.scale,
                observations.typical,
            )
            found = agreeing > 0
            to, source = atlas.pixel[tile[found]], at[found, best[found]]
            index[to], weight[to] = index[source], weight[source]
            taken.append(found)
            task.advance(len(tile))
    return np.concatenate(taken)

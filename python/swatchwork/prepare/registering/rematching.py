# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Matches that the mesh vouches for, where pictures alone leave too few: shiny objects, views far apart.

With both poses known, a feature lifted onto the mesh says where in the other photograph it must be, and only
its neighbours there need be told apart (`rematched`). With one pose known, even matches that share no
essential matrix may share a pose (`loose_points`): a wrong one has two numbers to get right, not one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from swatchwork.arrays import F64, I64, dot, unit
from swatchwork.capture import Camera
from swatchwork.prepare.registering.lifting import Lift, lifted, visible
from swatchwork.prepare.registering.tracks import Tracks, coarseness, joined, matches
from swatchwork.surface import RayScene

REACH_PX = 5.0
"""How far from where the mesh has it a feature is looked for."""
CANDIDATES = 6
ALIKE = 0.8
"""Least scalar product of descriptors that are of the same spot."""
BETTER = 0.9
"""Largest distance of the nearest descriptor in reach over that of the second."""
ASIDE = 0.4
"""Least cosine between the two directions that a spot is seen from: SIFT's descriptors change beyond."""
CROWD = 4
"""Placed photographs whose loose matches are pooled: those with most."""


def rematched(scene: RayScene, cameras: Mapping[str, Camera], tracks: Tracks) -> Tracks:
    """Tracks of the features of placed photographs, matched anew by where the mesh has them.

    Photographs without a pose have no part in them. Tracks without features come back as they are.
    """
    if not tracks.features:
        return tracks
    placed = [i for i, name in enumerate(tracks.names) if name in cameras]
    lifts = {i: lifted(scene, cameras[tracks.names[i]], tracks.features[i].uv_px) for i in placed}
    links = []
    for i in placed:
        for j in placed:
            if j < i:
                pairs, ratio = _guided(scene, i, j, lifts, cameras, tracks)
                links.append((i, j, pairs, ratio))
    return joined(tracks.names, tracks.features, links)


def _guided(
    scene: RayScene, i: int, j: int, lifts: Mapping[int, Lift], cameras: Mapping[str, Camera], tracks: Tracks
) -> tuple[I64, F64]:
    """Places of photographs i and j that the mesh and the descriptors say are the same, and their ratios."""
    a, b = tracks.features[i], tracks.features[j]
    here, there = cameras[tracks.names[i]], cameras[tracks.names[j]]
    none = np.zeros((0, 2), np.int64), np.zeros(0)
    x = lifts[i].x
    sure = np.flatnonzero(lifts[i].sure)
    aside = dot(unit(here.position - x[sure]), unit(there.position - x[sure]))
    sure = sure[aside > ASIDE]
    sure = sure[visible(scene, there, x[sure])]
    if not len(sure) or len(b) < 2:
        return none
    # Descriptors of the places that may be seen in both.
    rows = np.flatnonzero(np.isin(a.place, sure))
    uv_px = there.project(x[a.place[rows]])[0]
    reach = REACH_PX * coarseness(there)
    away, near = cKDTree(b.uv_px[b.place]).query(uv_px, k=CANDIDATES, distance_upper_bound=reach)
    found = np.isfinite(away)
    near = np.where(found, near, 0)
    alike = np.einsum("rd,rcd->rc", a.descriptor[rows], b.descriptor[near])
    alike = np.where(found, alike, -1.0)
    best = alike.argmax(axis=1)
    index = np.arange(len(rows))
    top, place = alike[index, best], b.place[near[index, best]]
    # The second is of another place: one place has several directions.
    others = np.where(b.place[near] == place[:, None], -1.0, alike)
    ratio = np.sqrt(np.maximum(1 - top, 0) / np.maximum(1 - others.max(axis=1), 1e-9))
    good = np.flatnonzero((top > ALIKE) & (ratio < BETTER))
    good = good[np.argsort(-top[good], kind="stable")]
    # Each place once, on both sides: the most alike.
    for side in (a.place[rows], place):
        _, first = np.unique(side[good], return_index=True)
        good = good[np.sort(first)]
    return np.column_stack([a.place[rows[good]], place[good]]).astype(np.int64), ratio[good].astype(
        np.float64
    )


def loose_points(
    scene: RayScene, cameras: Mapping[str, Camera], tracks: Tracks, name: str
) -> tuple[F64, F64]:
    """What a photograph without a pose may show of the object: all that looks alike in placed ones.

    Returns:
        image points F64[P, 2] and points on the mesh F64[P, 3], many of them wrong.
    """
    if not tracks.features or name not in tracks.names:
        return np.zeros((0, 2)), np.zeros((0, 3))
    mine = tracks.features[tracks.names.index(name)]
    pools = []
    for other, camera in cameras.items():
        if other in tracks.names:
            theirs = tracks.features[tracks.names.index(other)]
            pairs, _ = matches(mine, theirs)
            lift = lifted(scene, camera, theirs.uv_px[pairs[:, 1]])
            pools.append((mine.uv_px[pairs[lift.sure, 0]], lift.x[lift.sure]))
    pools = sorted(pools, key=lambda pool: -len(pool[0]))[:CROWD]
    return np.concatenate([np.zeros((0, 2)), *(uv for uv, _ in pools)]), np.concatenate(
        [np.zeros((0, 3)), *(x for _, x in pools)]
    )

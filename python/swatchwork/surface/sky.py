# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Self-shadowing of the environment: one bit for each of 64 x 64 directions, shared by nearby texels."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import log

import numpy as np
from scipy.spatial import cKDTree

from swatchwork.arrays import F32, F64, I32, I64, U64, Bool, dot
from swatchwork.octahedral import pixel_directions, square_from_direction
from swatchwork.progress import SILENT, Progress
from swatchwork.surface.atlas import Atlas
from swatchwork.surface.rays import RayScene, each_of

SIZE = 64
# Sharing's error in irradiance under the capture's own light, NRMS of the 95 % of texels nearest the truth,
# and CPU seconds (scripts/measure/shadows.py): igea-merl 0.59 % (2.2 s) with 8,000 samples, 0.22 % (11 s)
# with 64,000; spot 0.51 % (1.7 s) and 0.15 % (7 s). No masks at all: 3.0 and 10.5 %. The other 5 % of texels
# lie at contacts and creases.
SAMPLES = 64_000
# Of an atlas with twice as many texels a sample, so many are left to choose it from, or up to twice that.
CANDIDATES = 8
# Samples of the first level are traced in every cell; each further level has this many times as many, and is
# traced only where its neighbours of the levels before disagree.
FIRST_LEVEL = 2000
FINER = 4
NEIGHBOURS = 6
# A radian between normals counts, when clustering, like this many radii of the object between positions
# (0.05 and 0.1 measure alike, 0.25 and 0.5 worse by a quarter and a half).
NORMAL_WEIGHT = 0.1
# Texels whose normal is further than this from their sample's are given samples of their own.
COMPATIBLE = np.cos(np.radians(30))
# Cells this far (as a sine) below a sample's horizon are cast too, for members that are tilted against it.
BELOW = 0.2
# Rays are bent up to at least this sine above the triangle, or they would graze its neighbours.
LIFT = 0.01


@dataclass(frozen=True)
class SkyMasks:
    """``words`` U64[Q, 64]: bit i of word j is 1 where the sky is visible in cell (row j, column i) of the
    64 x 64 equal-area octahedral square in the world frame. ``of_texel`` I32[M]: each texel's row of
    ``words``, or -1 where it sees the whole sky above its horizon."""

    words: U64
    of_texel: I32


def sky_masks(scene: RayScene, atlas: Atlas, samples: int = SAMPLES, progress: Progress = SILENT) -> SkyMasks:
    """Trace the environment's visibility from about ``samples`` texels and share it among their neighbours.

    Samples lie evenly over the surface; a texel takes the mask of the one nearest in position and normal.
    Below a sample's horizon, where a member tilted against it may still look, the mask continues what is seen
    at the horizon. Samples are traced in levels, coarse to fine: a cell in which all of a sample's neighbours
    of the levels before agree is taken from them. Masks that hide nothing are not kept, so a convex
    object without occluders has none.
    """
    chosen, owner = shared_samples(scene, atlas, samples)
    words = _traced(scene, atlas, chosen, progress)
    hides = ~(words == np.uint64(0xFFFFFFFFFFFFFFFF)).all(axis=1)
    row = np.where(hides, np.cumsum(hides) - 1, -1)
    return SkyMasks(words[hides], row.astype(np.int32)[owner])


def shared_samples(scene: RayScene, atlas: Atlas, samples: int) -> tuple[I64, I32]:
    """About ``samples`` texels [Q] evenly over the surface, and which of them [M] is nearest to each texel.

    Nearest in position and normal; where normals turn too fast for that, there are further samples.
    """
    chosen = _spread_samples(atlas, samples)
    owner = _nearest(scene, atlas, chosen)
    astray = _astray(atlas, chosen, owner)
    if len(astray):
        further = astray[:: max(1, 4 * len(astray) // max(samples, 1))]
        chosen = np.concatenate([chosen, np.setdiff1d(further, chosen)])
        owner = _nearest(scene, atlas, chosen)
    return chosen, owner


def _spread_samples(atlas: Atlas, samples: int) -> I64:
    """Texels at equal steps of area along a space-filling (Morton) curve over the surface, in its order."""
    # Of a large atlas, every so many-th texel may be chosen.
    texel = np.arange(0, len(atlas), max(1, len(atlas) // (CANDIDATES * max(samples, 1))))
    position, normal = atlas.points(texel)
    low, high = position.min(axis=0), position.max(axis=0)
    cell = np.minimum((position - low) / max((high - low).max(), 1e-300) * 1024, 1023).astype(np.int32)
    # Opposite sides of a thin wall fall into one cell: keep them apart by the octant of the normal.
    key = ((normal > 0) @ np.array([1, 2, 4], dtype=np.int64)) << 30
    for bit in range(10):
        for axis in range(3):
            key |= ((cell[:, axis] >> bit) & 1).astype(np.int64) << (3 * bit + axis)
    order = np.argsort(key, kind="stable")
    if samples >= len(atlas):
        return np.asarray(order, dtype=np.int64)
    area = np.cumsum(atlas.footprint(texel[order]))
    steps = (np.arange(samples) + 0.5) / samples * area[-1]
    return np.asarray(texel[order[np.unique(np.minimum(np.searchsorted(area, steps), len(order) - 1))]])


def _nearest(scene: RayScene, atlas: Atlas, chosen: I64) -> I32:
    """[M]: which of the chosen texels is nearest to each texel, in position and normal."""
    found = np.empty(len(atlas), dtype=np.int32)
    if len(chosen) == len(atlas):
        found[chosen] = np.arange(len(chosen))
        return found
    tree = cKDTree(places_of(scene, atlas, chosen))

    def fill(part: slice) -> None:
        # Approximate to 20 % in distance: twice as fast, and as good a neighbour.
        found[part] = tree.query(places_of(scene, atlas, part), eps=0.2)[1]

    each_of(fill, len(atlas))
    return found


def _astray(atlas: Atlas, chosen: I64, owner: I32) -> I64:
    """Texels whose normal is far from their sample's."""
    normal = atlas.normal(chosen)
    parts = each_of(lambda part: dot(atlas.normal(part), normal[owner[part]]) < COMPATIBLE, len(atlas))
    return np.flatnonzero(np.concatenate(parts))


def places_of(scene: RayScene, atlas: Atlas, texel: I64 | slice) -> F64:
    """[T, 6]: position in radii of the object and normal, such that near points see much the same."""
    position, normal = atlas.points(texel)
    return np.hstack([position / scene.radius, NORMAL_WEIGHT * normal])


def _traced(scene: RayScene, atlas: Atlas, chosen: I64, progress: Progress) -> U64:
    """U64[Q, 64]: the masks of the chosen texels, level by level, coarse to fine."""
    words = np.empty((len(chosen), SIZE), dtype=np.uint64)
    looked = np.empty_like(words)
    cells = pixel_directions(SIZE).reshape(-1, 3).astype(np.float32)
    done = np.zeros(len(chosen), dtype=bool)
    with (
        progress.stage("Casting sky visibility", len(chosen)) as task,
        ThreadPoolExecutor(os.cpu_count()) as threads,
    ):
        # Every so many-th sample along the curve is a level.
        stride = FINER ** max(0, round(log(len(chosen) / FIRST_LEVEL, FINER)))
        while stride:
            level = np.flatnonzero(~done[::stride]) * stride
            known = np.flatnonzero(done)
            near = np.zeros((len(level), 0), dtype=np.int64)
            if len(known):
                tree = cKDTree(places_of(scene, atlas, chosen[known]))
                k = np.arange(1, min(NEIGHBOURS, len(known)) + 1)
                near = known[tree.query(places_of(scene, atlas, chosen[level]), k, workers=-1)[1]]

            def trace(part: slice, level: I64 = level, near: I64 = near) -> int:
                at, beside = level[part], near[part]
                position, normal = atlas.points(chosen[at])
                looked[at] = asked = packed(normal @ cells.T > -BELOW)
                # Without neighbours, nothing is settled.
                free = np.bitwise_and.reduce(words[beside] & looked[beside], axis=1)
                shut = np.bitwise_and.reduce(~words[beside] & looked[beside], axis=1)
                settled = free | shut if beside.shape[1] else np.zeros_like(asked)
                hidden = hidden_cells(
                    scene, position, atlas.geometric_normal(chosen[at]), cells, asked & ~settled
                )
                words[at] = ~(hidden | (asked & settled & shut))
                return len(at)

            # Batches small enough that their rays stay in the cache.
            for traced in threads.map(trace, [slice(i, i + 32) for i in range(0, len(level), 32)]):
                task.advance(traced)
            done[level] = True
            stride //= FINER
    return words


def hidden_cells(scene: RayScene, position: F64, upright: F64, cells: F32, asked: U64) -> U64:
    """U64[T, 64]: which of the cells that are asked for are hidden from points on triangles."""
    flat = upright.astype(np.float32)
    owner, cell = np.nonzero(unpacked(asked))
    direction = cells[cell]
    # Bend what points below the triangle's plane up to it, keeping the azimuth.
    sine = (flat @ cells.T)[owner, cell]
    low = np.flatnonzero(sine < LIFT)
    direction[low] += (LIFT - sine[low])[:, None] * flat[owner[low]]
    origin = position + scene.epsilon * upright
    hidden: Bool = np.zeros((len(position), len(cells)), dtype=bool)
    hidden[owner, cell] = scene.occluded_in_unit_ball(scene.in_unit_ball(origin)[owner], direction)
    return packed(hidden)


def unpacked(words: U64) -> Bool:
    """U64[T, 64] to Bool[T, 4096]."""
    octets = np.ascontiguousarray(words).astype("<u8").view(np.uint8).reshape(len(words), SIZE * SIZE // 8)
    return np.unpackbits(octets, axis=1, bitorder="little").astype(bool)


def packed(bits: Bool) -> U64:
    """Bool[T, 4096] to U64[T, 64]; bit i of word j is cell (row j, column i)."""
    octets = np.packbits(bits.reshape(len(bits), SIZE, 8, 8), axis=-1, bitorder="little")
    return octets.reshape(len(bits), SIZE, 8).view("<u8")[..., 0].astype(np.uint64)


def turned(words: U64, rotation: F64) -> U64:
    """Masks [Q, 64] as seen in a frame that ``rotation`` F64[3, 3] takes to the world (nearest cells)."""
    square = square_from_direction(pixel_directions(SIZE).reshape(-1, 3) @ np.asarray(rotation).T)
    column, row = np.minimum((square * SIZE).astype(np.int64), SIZE - 1).T
    found = np.empty_like(words)
    # A bit takes a byte on the way.
    for first in range(0, len(words), 1024):
        part = slice(first, first + 1024)
        found[part] = packed(unpacked(words[part])[:, row * SIZE + column])
    return found

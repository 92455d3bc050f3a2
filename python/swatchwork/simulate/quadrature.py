# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Responses of measured reflectances by dense quadrature: a truth that no generic kernel has a part in.

Half-vectors lie on log-polar rings, far denser than the operator's own, and serve every material:

    radiance[pair] = sum over h of f(i, o) cos_i L(i) 4 (o.h) dh,   i = 2 (o.h) h - o.

An isotropic reflectance depends on the viewer only through n.o, so that f cos_i n.o is tabulated over the
half-vectors for a few n.o and is linear between them: a hundred materials cost little more than one. Far
from the normal, where half-vectors are wide apart, windows and lamps are taken out of the light and summed as
point lights, by and by between tan(alpha) = 0.05 and 0.2. Against the ring operator at 150 random pairs the
NRMS of a kernel is 0.3 to 2 % under St. Peter's, 0.4 to 1.3 % under Grace, 0.2 to 0.7 % under Uffizi.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np

from ..arrays import F32, F64, I64, Float, unit
from ..light import Environment
from ..octahedral import pixel_directions, square_from_direction
from .measured import MeasuredBrdf

RINGS = 128
NODES = np.concatenate([[0.02, 0.03, 0.04, 0.055, 0.075], np.linspace(0.1, 1.0, 37)])
"""n.o at which f is tabulated: dense at the rim, where it changes fastest."""
PAIRS_AT_ONCE = 64
LIGHT_SIZE = 1024
POINTS, POINT_SIZE = 256, 128
"""Point lights at most, each the lamps in one pixel of an octahedral raster of that size."""
NEAR, FAR = 0.05, 0.2
"""tan(alpha) up to which lamps are in the picture, and from which on they are points."""
COLUMNS = 1 << 14
"""Of a list of lookups folded into rows: cv2.remap takes at most 32767."""


def measured_responses(
    brdfs: Sequence[MeasuredBrdf],
    light: Environment,
    normal: Float,
    to_viewer: Float,
    tables: dict[int, F32] | None = None,
) -> F64:
    """Radiance [P, B, 3] of measured materials under an environment, without self-shadowing.

    Args:
        brdfs: B isotropic reflectances.
        light: the environment, in the world frame.
        normal: unit normals [P, 3].
        to_viewer: unit directions to the viewer [P, 3]; where n.o is below 0.02 it counts as 0.02.
        tables: what was tabulated of the same materials before, and is now; 60 KB a material and node.
    """
    h, measure = half_vectors()
    n: F64 = np.asarray(normal, np.float64)
    o: F64 = np.asarray(to_viewer, np.float64)
    cosine = np.clip(np.einsum("px,px->p", n, o), NODES[0], 1.0)
    interval = np.clip(np.searchsorted(NODES, cosine, side="right") - 1, 0, len(NODES) - 2)
    lamps, points = _prepared(light)
    found = np.zeros((len(n), len(brdfs), 3))
    kept: dict[int, F32] = {} if tables is None else tables
    for node in map(int, np.unique(interval)):
        for k in (node, node + 1):
            if k not in kept:
                kept[k] = _tabulated(brdfs, NODES[k], h)
        at = np.flatnonzero(interval == node)

        beside = kept[node], kept[node + 1]

        def light_up(part: slice, at: I64 = at, node: int = node, beside: tuple[F32, F32] = beside) -> None:
            pairs = at[part]
            frame, local = _frames(n[pairs], o[pairs], cosine[pairs])
            arriving = _arriving(lamps, frame, local, h, measure)
            share = (cosine[pairs] - NODES[node]) / (NODES[node + 1] - NODES[node])
            for weight, table in zip((1 - share, share), beside, strict=True):
                part_of = np.einsum("psc,bsc->pbc", arriving, table, optimize=True)
                found[pairs] += (weight / cosine[pairs])[:, None, None] * part_of
            found[pairs] += _of_points(brdfs, points, frame, local)

        parts = [slice(start, start + PAIRS_AT_ONCE) for start in range(0, len(at), PAIRS_AT_ONCE)]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(light_up, parts))
        if tables is None:
            kept = {node + 1: kept[node + 1]}
    return found


def half_vectors() -> tuple[F64, F64]:
    """Half-vectors [S, 3] in the local frame and the solid angle [S] that each stands for."""
    t = np.concatenate([[0.0], np.geomspace(3e-4, 60, RINGS), [np.inf]])
    directions, measure = [], []
    for a0, a1 in pairwise(np.arctan(t)):
        middle = np.tan((a0 + a1) / 2)
        # Where lamps are in the picture an azimuth is as wide as a window may be.
        count = 16 if middle < 0.01 else 64 if middle < 0.05 else 192 if middle < FAR else 64
        phi = (np.arange(count) + 0.5) * (2 * np.pi / count)
        c = (np.cos(a0) + np.cos(a1)) / 2  # splits the ring's area in two
        s = np.sqrt(1 - c * c)
        directions.append(np.stack([s * np.cos(phi), s * np.sin(phi), np.full(count, c)], axis=-1))
        measure.append(np.full(count, (np.cos(a0) - np.cos(a1)) * 2 * np.pi / count))
    return np.concatenate(directions), np.concatenate(measure)


@lru_cache(maxsize=4)
def _prepared(light: Environment) -> tuple[tuple[list[F32], list[F32]], tuple[F64, F64]]:
    """Levels of the lamps and of the rest, and the lamps as points."""
    whole = light.octahedral(LIGHT_SIZE)
    soft, points = _without_lamps(whole)
    return (_levels(whole - soft), _levels(soft)), points


def _tabulated(brdfs: Sequence[MeasuredBrdf], cosine: float, h: F64) -> F32:
    """f cos_i n.o [B, S, 3] at every half-vector, for a viewer at a cosine to the normal."""
    o = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    o_h = h @ o
    i = 2 * o_h[:, None] * h - o
    weight = np.where(o_h > 0, np.maximum(i[:, 2], 0) * cosine, 0.0)[:, None]
    return np.stack([weight * b.evaluate(i, o) for b in brdfs]).astype(np.float32)


def _frames(normal: F64, to_viewer: F64, cosine: F64) -> tuple[F64, F64]:
    """world_from_local [P, 3, 3], the viewer in the xz plane, and the viewer there [P, 3]."""
    tangent = unit(to_viewer - np.einsum("px,px->p", normal, to_viewer)[:, None] * normal)
    # A viewer along the normal has no azimuth; any tangent does.
    free = np.linalg.norm(tangent, axis=1) < 0.5
    axis = np.eye(3)[np.argmin(np.abs(normal[free]), axis=1)]
    tangent[free] = unit(np.cross(normal[free], axis))
    local = np.stack([np.sqrt(1 - cosine**2), np.zeros_like(cosine), cosine], axis=-1)
    return np.stack([tangent, np.cross(normal, tangent), normal], axis=-1), local


def _arriving(lamps: tuple[list[F32], list[F32]], frame: F64, o: F64, h: F64, measure: F64) -> F32:
    """L(i) 4 (o.h) dh [P, S, 3] of the light that each half-vector reflects to the viewer."""
    o_h = np.maximum(o @ h.T, 0.0)
    i = 2 * o_h[..., None] * h - o[:, None]
    solid_angle = np.where(i[..., 2] > 0, 4 * o_h * measure, 0.0)
    world = np.einsum("pab,psb->psa", frame, i)
    found = _filtered(lamps[1], world, solid_angle)
    # Rings are ordered from the normal outwards.
    near = int(np.searchsorted(-h[:, 2], -1 / np.hypot(1, FAR)))
    share = _in_picture(h[:near]).astype(np.float32)[:, None]
    found[:, :near] += share * _filtered(lamps[0], world[:, :near], solid_angle[:, :near])
    return np.asarray(found * solid_angle[..., None].astype(np.float32))


def _in_picture(h: F64) -> F64:
    """Share [...] of a lamp that counts in the picture where it is reflected by a half-vector [..., 3]."""
    tangent = np.hypot(h[..., 0], h[..., 1]) / np.maximum(h[..., 2], 1e-9)
    x = np.clip(np.log(np.maximum(tangent, 1e-12) / NEAR) / np.log(FAR / NEAR), 0, 1)
    return np.asarray(1 - x * x * (3 - 2 * x))


def _without_lamps(image: F32) -> tuple[F32, tuple[F64, F64]]:
    """The light [S, S, 3] without what is brightest in it, and that as points: directions and energies.

    Of each pixel of a coarse raster, what is above four times the mean radiance of the sphere is its lamp;
    the brightest are taken.
    """
    size = len(image)
    block = size // POINT_SIZE
    lamp = np.maximum(image - 4 * image.mean(axis=(0, 1)), 0).astype(np.float64)
    blocks = lamp.reshape(POINT_SIZE, block, POINT_SIZE, block, 3)
    energy = blocks.sum(axis=(1, 3)) * (4 * np.pi / size**2)
    brightness = energy.sum(axis=-1).ravel()
    chosen = np.argsort(-brightness, kind="stable")[:POINTS]
    chosen = chosen[brightness[chosen] > 0]
    kept = np.zeros(POINT_SIZE**2, dtype=bool)
    kept[chosen] = True
    mask = np.repeat(np.repeat(kept.reshape(POINT_SIZE, POINT_SIZE), block, axis=0), block, axis=1)
    lamp *= mask[..., None]
    weight = lamp.sum(axis=-1)[..., None] * pixel_directions(size, dtype=np.float32)
    centre = weight.reshape(POINT_SIZE, block, POINT_SIZE, block, 3).sum(axis=(1, 3)).reshape(-1, 3)
    return (image - lamp).astype(np.float32), (unit(centre[chosen]), energy.reshape(-1, 3)[chosen])


def _of_points(brdfs: Sequence[MeasuredBrdf], points: tuple[F64, F64], frame: F64, o: F64) -> F64:
    """Radiance [P, B, 3] that lamps add where they are reflected far from the normal."""
    direction, energy = points
    i = np.einsum("pab,la->plb", frame, direction)
    share = np.where(i[..., 2] > 0, 1 - _in_picture(unit(i + o[:, None])), 0.0) * np.maximum(i[..., 2], 0)
    values = [b.evaluate(i, np.broadcast_to(o[:, None], i.shape)) for b in brdfs]
    return np.stack([np.einsum("plc,pl,lc->pc", f, share, energy, optimize=True) for f in values], axis=1)


def _levels(image: F32) -> list[F32]:
    """Area means of light [S, S, 3] on the octahedral square, each half as wide as the last, to 4 x 4."""
    levels = [image]
    while len(levels[-1]) > 4:
        a = levels[-1]
        mean = (a[::2, ::2] + a[1::2, ::2] + a[::2, 1::2] + a[1::2, 1::2]) / 4
        levels.append(mean.astype(np.float32))
    return levels


def _filtered(levels: list[F32], d: F64, solid_angle: F64) -> F32:
    """The light's mean [..., 3] over about a solid angle around unit directions, between two levels."""
    finest = len(levels[0])
    level = 0.5 * np.log2(np.maximum(solid_angle, 1e-12) * finest**2 / (4 * np.pi)) - 0.5
    level = np.clip(level, 0, len(levels) - 1.001)
    square = square_from_direction(d.astype(np.float32))
    out = np.zeros((*d.shape[:-1], 3), np.float32)
    for k, image in enumerate(levels):
        share = np.maximum(1 - np.abs(level - k), 0).astype(np.float32)
        chosen = share > 0
        if chosen.any():
            out[chosen] += share[chosen, None] * _bilinear(image, square[chosen])
    return out


def _bilinear(image: F32, square: F32) -> F32:
    """Lookups [L, 3] at points [L, 2] of the square."""
    count: int = len(square)
    rows: int = -(-count // COLUMNS)
    at = np.zeros((rows * COLUMNS, 2), np.float32)
    at[:count] = square * len(image) - 0.5
    x, y = (np.ascontiguousarray(at[:, k].reshape(rows, COLUMNS)) for k in (0, 1))
    found = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, 3)[:count], dtype=np.float32)

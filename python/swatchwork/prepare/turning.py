# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How two views of a mirror ball are turned to each other, by the agreement of the light they show."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F32, F64, fibonacci_sphere
from swatchwork.errors import InputError
from swatchwork.light import uv_from_direction
from swatchwork.light.sampling import bilinear, with_border
from swatchwork.prepare.panorama import Panorama

CONVENTION = "mitsuba"
"""Of the maps compared; any would do."""
COARSE = 6000
"""Rotations tried first, about 13 degrees apart."""
STARTS = 10
"""Best of them that are refined."""
STEPS_DEGREES = ((6.0, 32), (3.0, 32), (1.5, 64), (0.7, 64), (0.35, 128))
"""Steps of the refinement, and the width of the maps that each is judged by."""
FINAL_DEGREES = (0.35, 0.17, 0.08, 0.04, 0.02)
LEAST_CORRELATION = 0.5
"""Below it the views do not show the same light: wrong rotations of real rooms reach 0.4."""


@dataclass(frozen=True, eq=False)
class Turn:
    """The rotation found, and how well the maps agree under it.

    Attributes:
        first_from_second: F64[3, 3].
        correlation: of the logarithms of radiance where both views see, 1 at best.
    """

    first_from_second: F64
    correlation: float


def estimate_turn(first: Panorama, second: Panorama, name: str) -> Turn:
    """The rotation under which two maps agree best, each in its own camera's axes ("mitsuba" convention).

    Agreement is the correlation of log radiance, weighted by what both views are worth, so that neither a
    lamp nor the exposure outweighs the room. Coarse to fine: a lattice over all rotations on maps of 32
    texels, the best ones refined on ever finer maps.

    Raises:
        InputError: no rotation makes them agree.
    """
    lattice = _lattice(COARSE)
    a, b = _Level(first, 32, 500), _Level(second, 32, 500)
    scores = np.concatenate([_agreement(a, b, r) for r in np.array_split(lattice, COARSE // 500)])
    best = [(lattice[i], float(scores[i])) for i in _far_apart(lattice, scores)]
    for step, width in STEPS_DEGREES:
        a, b = _Level(first, width, 1000), _Level(second, width, 1000)
        best = sorted((_climbed(a, b, r, step) for r, _ in best), key=lambda x: -x[1])[: STARTS // 2 + 1]
    a, b = (_Level(m, first.radiance.shape[1], 6000) for m in (first, second))
    rotation, score = best[0]
    for step in FINAL_DEGREES:
        rotation, score = _climbed(a, b, rotation, step)
    if score < LEAST_CORRELATION:
        raise InputError(
            f"no rotation makes this view agree with the first one (correlation {score:.2f} at best)",
            file=name,
            expected="the same ball in the same light",
            hint="Give both camera poses by --pose",
        )
    return Turn(rotation, score)


class _Level:
    """A map at one width: directions with what they show, and lookups at others."""

    def __init__(self, full: Panorama, width: int, points: int) -> None:
        self.width = width
        height = width // 2
        size = (width, height)
        weight = cv2.resize(full.weight, size, interpolation=cv2.INTER_AREA)
        light = full.radiance.mean(axis=-1) * full.weight
        light = cv2.resize(light, size, interpolation=cv2.INTER_AREA) / np.maximum(weight, 1e-6)
        floor = 0.02 * float(np.average(light, weights=weight + 1e-12))
        channels = [np.log(light + floor), weight, np.zeros_like(weight)]
        self.bordered: F32 = with_border(np.dstack(channels).astype(np.float32), CONVENTION)
        self.d = fibonacci_sphere(points)
        self.value, self.worth = self.at(self.d)

    def at(self, d: F64) -> tuple[F64, F64]:
        """Log radiance and weight [...] at directions [..., 3]."""
        found = bilinear(self.bordered, uv_from_direction(CONVENTION, d.reshape(-1, 3)))
        return found[:, 0].reshape(d.shape[:-1]), found[:, 1].reshape(d.shape[:-1])


def _agreement(a: _Level, b: _Level, rotations: F64) -> F64:
    """Weighted correlations [R] under rotations [R, 3, 3] of the second view to the first."""
    value, worth = b.at(a.d @ rotations)
    w = worth * a.worth
    # Little overlap agrees by chance.
    total = w.sum(axis=1)
    enough = total > 0.1 * (a.worth**2).sum()
    w = w / np.maximum(total, 1e-12)[:, None]
    x = a.value - (w * a.value).sum(axis=1, keepdims=True)
    y = value - (w * value).sum(axis=1, keepdims=True)
    scale = np.sqrt((w * x * x).sum(axis=1) * (w * y * y).sum(axis=1))
    return np.where(enough, (w * x * y).sum(axis=1) / np.maximum(scale, 1e-12), -1.0)


def _climbed(a: _Level, b: _Level, rotation: F64, step_degrees: float) -> tuple[F64, float]:
    """Uphill by steps about the axes and their diagonals until none is better."""
    grid = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    steps = Rotation.from_rotvec(np.deg2rad(step_degrees) * grid).as_matrix()
    score = -1.0
    for _ in range(12):
        tried = steps @ rotation
        scores = _agreement(a, b, tried)
        best = int(scores.argmax())
        rotation, score = tried[best], float(scores[best])
        if not grid[best].any():
            break
    return rotation, score


def _far_apart(rotations: F64, scores: F64) -> list[int]:
    """The best rotations that are more than 20 degrees from better ones."""
    kept: list[int] = []
    for i in np.argsort(-scores):
        traces = [float(np.trace(rotations[k].T @ rotations[i])) for k in kept]
        if all(trace < 1 + 2 * np.cos(np.deg2rad(20)) for trace in traces):
            kept.append(int(i))
        if len(kept) == STARTS:
            break
    return kept


def _lattice(count: int) -> F64:
    """Rotations F64[count, 3, 3] spread evenly (super-Fibonacci spirals; Alexa 2022)."""
    s = np.arange(count) + 0.5
    t = s / count
    alpha, beta = 2 * np.pi * s / np.sqrt(2), 2 * np.pi * s / 1.533751168755204288118041
    r, R = np.sqrt(t), np.sqrt(1 - t)
    q = np.stack([r * np.sin(alpha), r * np.cos(alpha), R * np.sin(beta), R * np.cos(beta)], axis=-1)
    return np.asarray(Rotation.from_quat(q).as_matrix())

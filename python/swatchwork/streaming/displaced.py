# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whether a photograph fits better with its camera, or its light, turned a little."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import F64, Bool
from ..capture import Camera
from ..observe import SmallPicture
from .foretold import Model

SMALLEST_COSINE = 0.3
"""Of pairs that are compared: the basis fails nearer the rim, where pixels mix things besides."""
DIM = 0.05
"""Share of the typical radiance that is added on both sides of a ratio."""
TOLERATED = 0.1
"""Difference of logarithms at which a pair counts half of what an arbitrary one does."""
FAR_OFF = float(np.log(2))
"""Difference of logarithms from where a pair counts nearly 1: one of two radiances is something else's."""
BRIGHT = 0.25
"""Of the typical radiance: exposures are told from what should show more than that, without any addition."""
FEWEST = 30
"""Pairs that a frame is judged by, at least."""
PROBE, LIGHT_PROBE = 2.0, 6.0
"""Degrees of the displacements that every frame is tried with."""
STEPS = (4.0, 2.0, 1.0, 0.5)
"""Degrees, coarse to fine, of the search for a camera's turn."""
LIGHT_STEPS = (6.0, 3.0, 1.5)
LIGHT_STARTS = (-135.0, -90.0, -60.0, -40.0, -25.0, -12.0, 12.0, 25.0, 40.0, 60.0, 90.0, 135.0, 180.0)
"""Degrees that a light's turn is looked for from: its misfit has many valleys."""

About = Literal["object", "camera"]


def misfit(difference: F64, off: Bool | None = None, middle: float | None = None) -> float:
    """Mean loss, from 0 to 1, of differences of logarithms [R] from ``middle``, by default their median.

    Geman and McClure's loss: bounded, so that highlights and creases do not decide. Pairs ``off`` [R] the
    object count 1, those that are NaN nothing.
    """
    off = np.zeros(len(difference), bool) if off is None else off
    told = np.isfinite(difference) & ~off
    if told.sum() + off.sum() < FEWEST:
        return float("nan")
    r = difference[told]
    r = r - ((np.median(r) if len(r) else 0.0) if middle is None else middle)
    return (float((r * r / (r * r + TOLERATED**2)).sum()) + float(off.sum())) / float(told.sum() + off.sum())


@dataclass(frozen=True)
class Displaced:
    """A displacement in degrees, and the misfit with and without it."""

    degrees: float
    misfit: float
    without: float

    @property
    def gain(self) -> float:
        """Share of the misfit that it explains."""
        return 1 - self.misfit / self.without if self.without > 0 else 0.0


class Displacements:
    """One frame against what a model foretells of it, as it is said to stand and displaced.

    ``difference`` [R] are logarithms of shown over foretold radiance, means of the channels; ``exposure`` [B]
    and ``channels`` [B, 3] those of the bright pairs alone.
    """

    def __init__(
        self, model: Model, frame: int, camera: Camera, picture: SmallPicture, centre: F64, typical: float
    ) -> None:
        self.model, self.frame, self.camera, self.picture = model, frame, camera, picture
        self.centre, self.typical = centre, typical
        self.good = model.cosine(frame) > SMALLEST_COSINE
        rows = model.rows[frame][self.good]
        self.position = model.of.position[rows]
        self.foretold = model.radiance(frame)[self.good]
        self.radiance = model.of.radiance[rows].astype(np.float64)
        self.difference = self._sums(self.radiance, self.foretold)
        bright = self.foretold.mean(axis=1) > BRIGHT * typical
        lit = (self.radiance > 0).all(axis=1) & (self.foretold > 0).all(axis=1) & bright
        self.channels: F64 = np.log(self.radiance[lit] / self.foretold[lit])
        self.exposure: F64 = np.log(self.radiance[lit].mean(axis=1) / self.foretold[lit].mean(axis=1))

    @property
    def spoilt(self) -> float:
        """Share of the pairs that are far off, which no displacement mends in a sound photograph."""
        off = np.abs(self.difference - np.median(self.difference)) > FAR_OFF
        return float(off.mean())

    def _sums(self, radiance: F64, foretold: F64) -> F64:
        floor = DIM * self.typical
        return np.asarray(np.log((radiance.mean(axis=1) + floor) / (foretold.mean(axis=1) + floor)))

    def turned(self, degrees: F64, about: About) -> Camera:
        """The camera after a rotation vector [3], in degrees and in its own axes."""
        pose = self.camera.world_from_camera
        axes = pose[:3, :3]
        turn = axes @ Rotation.from_rotvec(np.radians(degrees)).as_matrix() @ axes.T
        pivot = self.centre if about == "object" else self.camera.position
        moved = pose.copy()
        moved[:3, :3] = turn @ axes
        moved[:3, 3] = pivot + turn @ (self.camera.position - pivot)
        return replace(self.camera, world_from_camera=moved)

    def shown(self, camera: Camera, foretold: F64) -> float:
        """Misfit of what the picture shows through a camera."""
        radiance, cover = self.picture.look(camera.project(self.position)[0])
        with np.errstate(invalid="ignore"):
            off = cover < 0.5
        found = misfit(self._sums(radiance, foretold), off)
        return found if np.isfinite(found) else 1.0

    def pose(self, about: About, steps: tuple[float, ...] = STEPS, foretell: bool = True) -> Displaced:
        """The camera's best turn about the object or about itself.

        ``foretell``: anew for each camera tried, rather than for where it is said to stand.
        """

        def tried(degrees: F64) -> float:
            camera, foretold = self.turned(degrees, about), self.foretold
            if foretell and about == "object":
                foretold = self.model.elsewhere(self.frame, viewer=camera.position)[self.good]
            return self.shown(camera, foretold)

        return descend(tried, np.zeros(3), steps)

    def light(self, axis: F64, starts: tuple[float, ...] = LIGHT_STARTS) -> Displaced:
        """The light's best turn about an axis [3] of the world."""

        def tried(degrees: F64) -> float:
            turn = Rotation.from_rotvec(np.radians(degrees[0]) * axis).as_matrix()
            return self.shown(self.camera, self.model.elsewhere(self.frame, turn=turn)[self.good])

        here = tried(np.zeros(1))
        tries = {angle: tried(np.array([angle])) for angle in starts}
        best = min(tries, key=tries.__getitem__)
        start = np.array([best if tries[best] < here else 0.0])
        found = descend(tried, start, LIGHT_STEPS)
        return replace(found, without=here)

    def probed(self, axis: F64) -> float:
        """The share of the misfit that the best of a few small displacements explains."""
        here = self.shown(self.camera, self.foretold)
        best = here
        abouts: tuple[About, ...] = ("object", "camera")
        for about in abouts:
            for way in (*np.eye(3), *-np.eye(3)):
                best = min(best, self.shown(self.turned(PROBE * way, about), self.foretold))
        for sign in (1, -1):
            turn = Rotation.from_rotvec(np.radians(sign * LIGHT_PROBE) * axis).as_matrix()
            turned = self.model.elsewhere(self.frame, turn=turn)[self.good]
            best = min(best, self.shown(self.camera, turned))
        return 1 - best / here if here > 0 else 0.0


def descend(tried: Callable[[F64], float], start: F64, steps: tuple[float, ...]) -> Displaced:
    """Search along coordinates from coarse to fine steps, in units of ``start`` [d]."""
    at, value = start, tried(start)
    without = value
    for step in steps:
        for _ in range(4):
            before = value
            for axis in np.eye(len(at)):
                for sign in (1.0, -1.0):
                    there = at + sign * step * axis
                    rival = tried(there)
                    if rival < value:
                        at, value = there, rival
                        break
            if value >= before:
                break
    return Displaced(float(np.linalg.norm(at)), value, without)

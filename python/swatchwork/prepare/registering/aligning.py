# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Cameras moved until the mesh's contours lie on the photographs' (iterated closest points on contours).

Minimises, over a motion s of one camera or of several that hang together,

    mean over contour points of w r(s)^2  +  weight of a pair * sum over pairs of v |distance(s)|^2

with robust weights w, v, by Gauss and Newton's steps; the contours are found anew before each. Contours say
nothing of some motions, such as the turn of a vase about its axis. A step is therefore split into motions
that are independent in both senses: A m = lambda B m, where m' A m is what m moves across the contours and
m' B m what it moves the surface in the image. Motions with a small lambda are left as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from swatchwork.arrays import F64
from swatchwork.capture import Camera
from swatchwork.prepare.registering.contours import ContourTerms, ImageEdges, contour_terms, object_box
from swatchwork.prepare.registering.motion import projected
from swatchwork.prepare.registering.pairs import Pairs
from swatchwork.surface import RayScene

STAGES = ((0.1, 60, 8, 0.3), (0.04, 120, 8, 0.1), (0.015, 200, 12, 0.01))
"""How far a contour is looked for, over the object's size; steps of the grid along it; rounds at most; and
the motion of the surface in the image, in pixels, below which the stage ends."""
LEAST_REACH_PX = 4.0
KNOWN = 1e-3
"""Least lambda: a surface that moves by 1 pixel moves its contours by 0.03, a tenth of a mask's error."""
DAMPING = 1e-4
PAIR_WEIGHT = 1.25e-3
"""Of one pair against all contour points of a photograph: a click is off by 2 pixels, a mask by half of one,
which is the same for neighbours: a contour is worth some fifty points."""
PAIR_PX = 4.0
"""Distance from which on a pair's robust weight falls."""
SURFACE = 200
"""Points of the mesh whose motion is the measure of a step."""


@dataclass(frozen=True)
class Round:
    """One step: reach and rms of the contours' distances in pixels, share of contours with a counterpart,
    motion of the surface that the step made in pixels, motions left as they were."""

    reach_px: float
    rms_px: float
    share: float
    moved_px: float
    unknown: int


@dataclass(frozen=True, eq=False)
class Rig:
    """Cameras that move together.

    Attributes:
        move: the cameras after a step F64[n].
        spread: for each camera, the derivative F64[6, n] of its own step (of `moved`) by the common one.
    """

    cameras: tuple[Camera, ...]
    move: Callable[[tuple[Camera, ...], F64], tuple[Camera, ...]]
    spread: Callable[[tuple[Camera, ...]], list[F64]]


@dataclass(frozen=True, eq=False)
class Aligned:
    """Cameras after each stage, the rounds, and whether the last stage came to rest."""

    stages: tuple[tuple[Camera, ...], ...]
    history: tuple[Round, ...]
    settled: bool


def align(
    scene: RayScene, images: Sequence[ImageEdges], rig: Rig, pairs: Sequence[Pairs | None], stages: int = 3
) -> Aligned:
    """Move a rig by the last ``stages``: 3 starts with a wide search, 1 is for a pose nearly right.

    ``images`` and ``pairs`` are those of the rig's cameras; pairs are those to be trusted.
    """
    cameras = rig.cameras
    reached, history = [], []
    settled = False
    for share, size, rounds, least_px in STAGES[-stages:]:
        settled = False
        for _ in range(rounds):
            reaches = [_reach(scene, camera, share) for camera in cameras]
            terms = [
                contour_terms(scene, image, camera, reach, size)
                for image, camera, reach in zip(images, cameras, reaches, strict=True)
            ]
            step, moved_px, unknown = _step(scene, terms, cameras, rig.spread(cameras), pairs)
            history.append(Round(max(reaches), _pooled_px(terms), _share(terms), moved_px, unknown))
            if moved_px > max(reaches):
                step *= max(reaches) / moved_px
            cameras = rig.move(cameras, step)
            settled = moved_px < least_px
            if settled:
                break
        reached.append(cameras)
    return Aligned(tuple(reached), tuple(history), settled)


def _reach(scene: RayScene, camera: Camera, share: float) -> float:
    low, high = object_box(scene, camera)
    return max(share * float((high - low).max()), LEAST_REACH_PX)


def _pooled_px(terms: Sequence[ContourTerms]) -> float:
    known = [term.rms_px for term in terms if np.isfinite(term.rms_px)]
    return float(np.sqrt(np.mean(np.square(known)))) if known else np.inf


def _share(terms: Sequence[ContourTerms]) -> float:
    return float(np.mean([term.share for term in terms]))


def _step(
    scene: RayScene,
    terms: Sequence[ContourTerms],
    cameras: Sequence[Camera],
    spreads: Sequence[F64],
    pairs: Sequence[Pairs | None],
) -> tuple[F64, float, int]:
    """The step [n], the root mean square motion of the surface in pixels, and how many motions it leaves."""
    count = spreads[0].shape[1]
    A, B, gradient = np.zeros((count, count)), np.zeros((count, count)), np.zeros(count)
    total = max(sum(float(term.weight.sum()) for term in terms), 1e-12)
    for term, camera, spread, clicked in zip(terms, cameras, spreads, pairs, strict=True):
        J, w = term.by_step @ spread, term.weight / total
        A += (J.T * w) @ J
        gradient += (J.T * w) @ term.residual_px
        moves = _surface_moves(scene, camera) @ spread
        B += np.einsum("pix,piy->xy", moves, moves) / len(moves) / len(terms)
        if clicked is not None:
            r, J = _pair_terms(camera, clicked)
            J = J @ spread
            A += PAIR_WEIGHT / len(terms) * J.T @ J
            gradient += PAIR_WEIGHT / len(terms) * J.T @ r
    # Rotations and translations have different units.
    unit = 1 / np.sqrt(np.maximum(np.diag(B), 1e-300))
    B = B * np.outer(unit, unit) + 1e-12 * np.eye(count)
    known, motions = eigh(A * np.outer(unit, unit), B)
    along = motions.T @ (gradient * unit)
    size = np.where(known > KNOWN, -along / (known + DAMPING), 0.0)
    return unit * (motions @ size), float(np.linalg.norm(size)), int((known <= KNOWN).sum())


def _surface_moves(scene: RayScene, camera: Camera) -> F64:
    """Derivatives [P, 2, 6] by the camera's step of points of the mesh that face it."""
    mesh = scene.meshes[0]
    facing = np.flatnonzero(((camera.position - mesh.vertices) * mesh.normals).sum(axis=1) > 0)
    chosen = facing[:: max(1, len(facing) // SURFACE)]
    _, by_step, _ = projected(camera, mesh.vertices[chosen])
    seen = np.isfinite(by_step).all(axis=(1, 2))
    return by_step[seen] if seen.any() else np.zeros((1, 2, 6))


def _pair_terms(camera: Camera, pairs: Pairs) -> tuple[F64, F64]:
    at, by_step, _ = projected(camera, pairs.x_in_world)
    seen = np.isfinite(at[:, 0])
    off = (at - pairs.uv_px)[seen]
    root = 1 / np.sqrt(1 + (np.linalg.norm(off, axis=1) / PAIR_PX) ** 2)
    return (off * root[:, None]).ravel(), (by_step[seen] * root[:, None, None]).reshape(-1, 6)

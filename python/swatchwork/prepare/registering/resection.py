# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One photograph's pose from points of the object that it shows, some of them wrong; or why there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from swatchwork.arrays import F64, Bool, norm
from swatchwork.capture import Camera
from swatchwork.prepare.registering.lifting import finite, visible
from swatchwork.prepare.registering.motion import moved, projected
from swatchwork.prepare.registering.tracks import coarseness, flat
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene

LEAST = 12
"""Fewer points than this that agree on a pose are no pose."""
CHANCE = 0.15
"""Nor is one that fewer than this share agree on: `ROUNDS` samples of three may not have found the best, and
a few right points in one place can agree with wrong ones elsewhere. Of points at random 6 agreed at most, in
ten trials each of 20 to 800."""
SEARCH_PX = 8.0
"""Of the search, in pixels that features are sought in: points come from frames that are not refined yet."""
INLIER_PX = 4.0
"""Of the refined pose."""
HIDDEN = 0.3
"""A pose from which the mesh hides more of its own points than this is wrong."""
LOOSE_DEG = 2.0
LOOSE_SHARE = 0.05
"""A pose that its points leave looser than this (standard deviation of its angle, of its place along the
distance to the object) is not spread enough to be one."""
ROUNDS = 10000
STEPS = 30


@dataclass(frozen=True, eq=False)
class Resection:
    """A pose, or why there is none.

    Attributes:
        camera: None, where there is none.
        inlier: Bool[P], the points that agree with it.
        rms_px: of these; NaN without.
        why: what is wrong, with numbers; empty for a pose.
    """

    camera: Camera | None
    inlier: Bool
    rms_px: float
    why: str


def resect(scene: RayScene, view: View, uv_px: F64, x: F64) -> Resection:
    """The pose of a photograph that shows the object's points x [P, 3] at uv_px [P, 2]."""
    none = np.zeros(len(x), dtype=bool)

    def refused(why: str, inlier: Bool = none) -> Resection:
        return Resection(None, inlier, float("nan"), why)

    if len(x) < LEAST:
        return refused(f"shares {len(x)} points with placed photographs; {LEAST} are needed")
    camera = _searched(view, uv_px, x)
    if camera is None:
        return refused(f"{len(x)} points shared with placed photographs agree on no pose")
    camera, error_px = _fitted(camera, uv_px, x)
    inlier = error_px < INLIER_PX * coarseness(camera)
    count, needed = int(inlier.sum()), max(LEAST, int(np.ceil(CHANCE * len(x))))
    if count < needed:
        return refused(
            f"{count} of {len(x)} points shared with placed photographs agree on a pose; {needed} are needed",
            inlier,
        )
    seen = visible(scene, camera, x[inlier])
    if seen.mean() < 1 - HIDDEN:
        return refused(
            f"the best pose would see {int(seen.sum())} of the {count} points that agree on it, the rest "
            "behind the object",
            inlier,
        )
    inlier[np.flatnonzero(inlier)[~seen]] = False
    rms = float(np.sqrt((error_px[inlier] ** 2).mean()))
    loose_deg, loose_share = looseness(camera, x[inlier], max(rms, 0.5 * coarseness(camera)), scene.centre)
    if int(inlier.sum()) < LEAST or loose_deg > LOOSE_DEG or loose_share > LOOSE_SHARE:
        return refused(
            f"the {int(inlier.sum())} points that agree on a pose leave it loose by {loose_deg:.1f} degrees "
            f"and {100 * loose_share:.1f} % of the distance; they are too few or too close together",
            inlier,
        )
    return Resection(camera, inlier, rms, "")


def _searched(view: View, uv_px: F64, x: F64) -> Camera | None:
    """RANSAC over poses from three points; deterministic, and in the lens's own flat coordinates."""
    lens = view.lens
    xy = flat(view, uv_px)
    middle = x.mean(axis=0)
    cv2.setRNGSeed(0)
    try:
        ok, turn, place, inlier = cv2.solvePnPRansac(
            np.ascontiguousarray(x - middle),
            xy,
            np.eye(3),
            None,
            iterationsCount=ROUNDS,
            reprojectionError=SEARCH_PX * coarseness(lens) / np.sqrt(lens.fx * lens.fy),
            confidence=0.9999,
            flags=cv2.SOLVEPNP_AP3P,
        )
    except cv2.error:  # of points that determine nothing: all in one place, say
        return None
    if not ok or inlier is None or len(inlier) < 4:
        return None
    rotation, _ = cv2.Rodrigues(turn)
    # OpenCV's camera has y down and z ahead: ours is turned by half about x.
    pose = np.eye(4)
    pose[:3, :3] = rotation.T * [1.0, -1.0, -1.0]
    pose[:3, 3] = middle - rotation.T @ place.ravel()
    return replace(lens, world_from_camera=pose) if np.isfinite(pose).all() else None


def _fitted(camera: Camera, uv_px: F64, x: F64) -> tuple[Camera, F64]:
    """The pose with the least robust error (Cauchy), by Levenberg and Marquardt; and errors F64[P] in px."""

    def errors(at: Camera) -> F64:
        error = at.project(x)[0] - uv_px
        return np.where(np.isfinite(error), error, 1e3)

    for scale in coarseness(camera) * np.array([SEARCH_PX / 2, INLIER_PX / 2]):
        best = errors(camera)
        value, damping = np.log1p((best**2).sum(axis=1) / scale**2).sum(), 1e-4
        for _ in range(STEPS):
            _, slope, _ = projected(camera, x)
            slope = np.where(np.isfinite(slope), slope, 0)
            weight = 1 / (scale**2 + (best**2).sum(axis=1))
            normal = np.einsum("pai,paj,p->ij", slope, slope, weight)
            right = -np.einsum("pai,pa,p->i", slope, best, weight)
            damped = normal + damping * np.diag(np.diag(normal) + 1e-12 * np.trace(normal))
            trial = moved(camera, np.linalg.lstsq(damped, right, rcond=None)[0])
            error = errors(trial)
            new = np.log1p((error**2).sum(axis=1) / scale**2).sum()
            if new < value:
                done = value - new < 1e-9 * value
                camera, best, value, damping = trial, error, new, damping / 10
                if done:
                    break
            elif damping > 1e6:
                break
            else:
                damping *= 10
    return camera, np.hypot(best[:, 0], best[:, 1])


def looseness(camera: Camera, x: F64, error_px: float, centre: F64) -> tuple[float, float]:
    """How far points x [P, 3], known to ``error_px`` in the image, leave a pose open.

    Returns:
        standard deviations of its angle in degrees, and of its place over the distance to ``centre``;
        infinite where the points determine no pose.
    """
    slope = projected(camera, x)[1].reshape(-1, 6)
    away = float(norm(camera.position - centre))
    # Columns of like size, radians and shares of the distance, for a rank that means something.
    slope = slope[finite(slope)] * [1, 1, 1, away, away, away]
    values, vectors = np.linalg.eigh(slope.T @ slope)
    if values[0] <= 1e-12 * values[-1]:
        return float("inf"), float("inf")
    covariance = error_px**2 * (vectors / values) @ vectors.T
    spread = np.sqrt(np.diag(covariance))
    return float(np.degrees(spread[:3].max())), float(spread[3:].max())

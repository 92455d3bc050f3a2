# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Poses that most 2D-3D pairs agree on (RANSAC, Fischler and Bolles 1981, over all triples where few).

Three pairs leave up to four poses (P3P). Each is judged by the sum over all pairs of the squared distance
in pixels, capped at the tolerance's square, and the best are refined on the pairs within it. So few pairs
come from clicking that all triples can be tried: the same pairs always give the same pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import cv2
import numpy as np

from swatchwork.arrays import F64, I64, Bool
from swatchwork.capture import Camera
from swatchwork.prepare.registering.least import least_squares, misses_px, root_mean_square
from swatchwork.prepare.registering.motion import turned_degrees

TRIPLES = 1500
"""Tried at most: all of 21 pairs. Of more pairs a seeded choice, where half outliers leave 1 in 8 sound."""
LOOKED_AT, REFINED, ALIKE = 200, 12, 3
"""Best poses of triples, of these refined, and how many of them may be nearly the same."""
APART_DEGREES = 3.0
"""Poses that differ by less are the same one."""
# x right, y down, z ahead, as OpenCV has it, from ours.
TURNED = np.diag([1.0, -1.0, -1.0])

Pose = tuple[F64, F64]
"""world_from_camera's rotation [3, 3] and the position [3]."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """A pose, the pairs that agree with it, Bool[C], and the distance F64[C] of each pair in pixels."""

    camera: Camera
    inliers: Bool
    residual_px: F64

    @property
    def count(self) -> int:
        return int(self.inliers.sum())

    @property
    def rms_px(self) -> float:
        """Over the inliers."""
        return root_mean_square(self.residual_px[self.inliers])


def agreements(lens: Camera, uv_px: F64, x_in_world: F64, tolerance_px: float) -> list[Agreement]:
    """Distinct poses that pairs agree on, the best first; none where no pose exists for any triple."""
    lens = replace(lens, world_from_camera=np.eye(4))
    rays = lens.rays(uv_px)
    reached = np.isfinite(rays).all(axis=1)
    if reached.sum() < 3:
        return []
    poses = _of_triples(rays, x_in_world, np.flatnonzero(reached))
    poses += _of_all(rays[reached], x_in_world[reached])
    if not poses:
        return []
    found: list[tuple[float, Agreement]] = []
    for start in _starts(lens, poses, uv_px, x_in_world, tolerance_px):
        agreed = _refined(start, uv_px, x_in_world, tolerance_px)
        cost = _capped(agreed.residual_px, tolerance_px)
        same = [turned_degrees(agreed.camera, other.camera) <= APART_DEGREES for _, other in found]
        if not any(same):
            found.append((cost, agreed))
        elif cost < found[same.index(True)][0]:
            found[same.index(True)] = (cost, agreed)
    return [agreed for _, agreed in sorted(found, key=lambda entry: entry[0])]


def _starts(
    lens: Camera, poses: list[Pose], uv_px: F64, x_in_world: F64, tolerance_px: float
) -> list[Camera]:
    """The poses with the lowest sums, those left out that differ little from one before."""
    rotation, position = np.stack([r for r, _ in poses]), np.stack([p for _, p in poses])
    x_in_camera = (x_in_world[None] - position[:, None]) @ rotation
    at = lens.project(x_in_camera.reshape(-1, 3))[0].reshape(len(poses), -1, 2)
    off = np.nan_to_num(np.linalg.norm(at - uv_px, axis=-1), nan=np.inf)
    order = np.argsort((np.minimum(off, tolerance_px) ** 2).sum(axis=1), kind="stable")
    starts: list[Camera] = []
    for i in order[:LOOKED_AT]:
        start = _camera(lens, rotation[i], position[i])
        alike = sum(turned_degrees(start, other) <= APART_DEGREES for other in starts)
        if alike < ALIKE:
            starts.append(start)
        if len(starts) == REFINED:
            break
    return starts


def _refined(camera: Camera, uv_px: F64, x_in_world: F64, tolerance_px: float) -> Agreement:
    """Least squares on those that agree, first with twice the tolerance: a triple's pose is a rough one."""
    residual = misses_px(camera, uv_px, x_in_world)
    for widened, exactness in ((2.0, 1e-2), (1.0, 1e-3), (1.0, 1e-10)):
        near = residual < widened * tolerance_px
        if near.sum() < 3:
            break
        camera, _ = least_squares(camera, uv_px[near], x_in_world[near], exactness=exactness)
        residual = misses_px(camera, uv_px, x_in_world)
    return Agreement(camera, residual < tolerance_px, residual)


def _of_triples(rays: F64, x_in_world: F64, usable: I64) -> list[Pose]:
    count = len(usable)
    if count * (count - 1) * (count - 2) // 6 <= TRIPLES:
        triples = np.array(list(combinations(usable, 3)))
    else:
        rng = np.random.default_rng(0)
        triples = np.stack([rng.choice(usable, 3, replace=False) for _ in range(TRIPLES)])
    xy = _image(rays)
    # OpenCV computes in the points' own coordinates: near the origin and of unit size they keep their digits.
    centre, size = x_in_world.mean(axis=0), max(float(np.ptp(x_in_world, axis=0).max()), 1e-300)
    x = (x_in_world - centre) / size
    poses = []
    for triple in triples:
        found, turns, places = cv2.solveP3P(x[triple], xy[triple], np.eye(3), None, cv2.SOLVEPNP_P3P)
        for turn, place in zip(turns[:found], places[:found], strict=True):
            poses += _in_world(turn, place, centre, size)
    return poses


def _of_all(rays: F64, x_in_world: F64) -> list[Pose]:
    """Poses from all pairs at once, for those that have no outlier; of a plane there are two."""
    if len(rays) < 4:
        return []
    xy = _image(rays)
    centre, size = x_in_world.mean(axis=0), max(float(np.ptp(x_in_world, axis=0).max()), 1e-300)
    poses = []
    for method in (cv2.SOLVEPNP_SQPNP, cv2.SOLVEPNP_IPPE):
        try:
            found, turns, places, _ = cv2.solvePnPGeneric(
                (x_in_world - centre) / size, xy, np.eye(3), None, flags=method
            )
        except cv2.error:  # IPPE takes points of a plane only.
            continue
        for turn, place in zip(turns[:found], places[:found], strict=True):
            poses += _in_world(turn, place, centre, size)
    return poses


def _image(rays: F64) -> F64:
    """The image plane's x right, y down at distance 1, free of distortion."""
    return np.ascontiguousarray(rays[:, :2] * [1.0, -1.0] / -rays[:, 2:])


def _in_world(turn: F64, place: F64, centre: F64, size: float) -> list[Pose]:
    rotation, place = cv2.Rodrigues(turn)[0], np.ravel(place)
    if not (np.isfinite(rotation).all() and np.isfinite(place).all()):
        return []
    return [(rotation.T @ TURNED, centre - size * (rotation.T @ place))]


def _camera(lens: Camera, rotation: F64, position: F64) -> Camera:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return replace(lens, world_from_camera=pose)


def _capped(residual_px: F64, tolerance_px: float) -> float:
    return float((np.minimum(residual_px, tolerance_px) ** 2).sum())

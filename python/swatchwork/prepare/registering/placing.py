# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Cameras that are known to each other, as by a board, placed around the mesh by one rigid transform.

The photograph with most pairs gives the start. The pairs of all photographs then refine the transform, with
Cauchy's loss, and all silhouettes together after that:

    minimise over mesh_from_rig   sum over photographs and their pairs of rho(|project(x) - uv|)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F64, Bool
from swatchwork.capture import Camera
from swatchwork.prepare.registering.aligning import Rig, align
from swatchwork.prepare.registering.contours import ImageEdges
from swatchwork.prepare.registering.least import misses_px, root_mean_square
from swatchwork.prepare.registering.pairs import Pairs
from swatchwork.prepare.registering.posing import FEWEST, default_tolerance_px, pose_from_pairs
from swatchwork.prepare.registering.refining import CHANCE, iou
from swatchwork.prepare.registering.units import check_distance, check_pairs, check_silhouettes
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene

FAR_PX = 1e4
"""Distance of a pair whose point is not seen, such as one behind the camera."""


@dataclass(frozen=True, eq=False)
class PlacedRig:
    """Cameras around the mesh.

    Attributes:
        cameras: in the mesh's world, by name.
        mesh_from_rig: F64[4, 4], rigid.
        inliers: Bool[C] of each photograph's pairs, those that agree.
        pairs_px: rms of these over all photographs; None without pairs.
        iou_before, iou: mean over the photographs with a mask, before and after their contours had a say.
    """

    cameras: dict[str, Camera]
    mesh_from_rig: F64
    inliers: dict[str, Bool]
    pairs_px: float | None
    iou_before: float | None
    iou: float | None


def place_mesh(
    scene: RayScene,
    views: Sequence[View],
    cameras_in_rig: Mapping[str, Camera],
    pairs: Mapping[str, Pairs],
    *,
    stand: F64 | None = None,
) -> PlacedRig:
    """Place all cameras in the mesh's world by one rigid transform.

    Args:
        views: the photographs; those with a region have a say.
        cameras_in_rig: by name, in the rig's coordinates.
        pairs: by name; without any, the mesh's coordinates are the rig's.
        stand: F64[3], in the rig, where the object is roughly, such as the board's middle.

    Raises:
        InputError: the pairs of the photograph with most of them fit no pose; rig and mesh differ in scale.
    """
    by_name = {view.name: view for view in views}
    pairs = {name: of for name, of in pairs.items() if name in cameras_in_rig and len(of)}
    mesh_from_rig = np.eye(4)
    if pairs:
        most = max(pairs, key=lambda name: len(pairs[name]))
        of, view = pairs[most], by_name[most]
        posed = pose_from_pairs(view.lens, of.uv_px, of.x_in_world, name=str(view.file))
        mesh_from_rig = posed.camera.world_from_camera @ np.linalg.inv(cameras_in_rig[most].world_from_camera)
        if stand is not None:
            check_distance(scene, by_name, cameras_in_rig, most, posed.camera, stand)
        rigid = fitted(cameras_in_rig, pairs, mesh_from_rig, scaled=False)
        check_pairs(rigid, fitted(cameras_in_rig, pairs, mesh_from_rig, scaled=True))
        mesh_from_rig = rigid.mesh_from_rig
    elif stand is not None:
        check_distance(scene, by_name, cameras_in_rig, next(iter(cameras_in_rig)), None, stand)
    start = carried(cameras_in_rig, mesh_from_rig)
    inliers = {name: agreeing(start[name], of) for name, of in pairs.items()}
    before = mean_iou(scene, by_name, start)
    if pairs:
        check_silhouettes(scene, by_name, cameras_in_rig, most, start[most], before)
    cameras = _by_contours(scene, by_name, start, pairs, inliers)
    after = mean_iou(scene, by_name, cameras)
    if before is not None and after is not None and after < before - CHANCE:
        cameras, after = start, before
    if cameras is not start:
        first = next(iter(cameras))
        in_rig = cameras_in_rig[first].world_from_camera
        mesh_from_rig = cameras[first].world_from_camera @ np.linalg.inv(in_rig)
    inliers = {name: agreeing(cameras[name], of) for name, of in pairs.items()}
    off = [misses_px(cameras[n], of.uv_px, of.x_in_world)[inliers[n]] for n, of in pairs.items()]
    pairs_px = root_mean_square(np.concatenate(off)) if off else None
    return PlacedRig(cameras, mesh_from_rig, inliers, pairs_px, before, after)


def carried(cameras: Mapping[str, Camera], transform: F64) -> dict[str, Camera]:
    """All cameras after a rigid transform F64[4, 4] of the world."""
    return {
        name: replace(camera, world_from_camera=transform @ camera.world_from_camera)
        for name, camera in cameras.items()
    }


def agreeing(camera: Camera, pairs: Pairs) -> Bool:
    """Which pairs, Bool[C], are within the tolerance of the clicks."""
    return np.asarray(misses_px(camera, pairs.uv_px, pairs.x_in_world) < default_tolerance_px(camera))


def mean_iou(scene: RayScene, views: Mapping[str, View], cameras: Mapping[str, Camera]) -> float | None:
    """Of the photographs with a mask; None without any."""
    found = [iou(scene, views[name], camera) for name, camera in cameras.items()]
    known = [value for value in found if value is not None]
    return float(np.mean(known)) if known else None


@dataclass(frozen=True, eq=False)
class Fitted:
    """A transform by pairs: mesh = mesh_from_rig (scale x); how many of how many pairs agree, and their
    number in each photograph."""

    mesh_from_rig: F64
    scale: float
    agree: int
    count: int
    each: tuple[int, ...]


def fitted(
    cameras_in_rig: Mapping[str, Camera], pairs: Mapping[str, Pairs], start: F64, *, scaled: bool
) -> Fitted:
    """The transform that fits the pairs of all photographs best, near a start; with a scale or without.

    Unknown are a turn and a shift about the pairs' middle, and the logarithm of the scale, which multiplies
    the rig about the camera with most pairs: that one's pairs then say nothing of it.
    """
    x = np.concatenate([of.x_in_world for of in pairs.values()])
    centre, size = x.mean(axis=0), max(float(np.ptp(x, axis=0).max()), 1e-300)
    most = max(pairs, key=lambda name: len(pairs[name]))
    pivot = cameras_in_rig[most].position

    def transformed(step: F64) -> tuple[F64, float]:
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix()
        turn[:3, 3] = centre + size * step[3:6] - turn[:3, :3] @ centre
        scale = float(np.exp(step[6])) if scaled else 1.0
        # start maps the pivot to where its camera is, whatever the scale.
        about = np.eye(4)
        about[:3, 3] = (1 - scale) * pivot
        return turn @ start @ about, scale

    def cameras(step: F64) -> dict[str, Camera]:
        transform, scale = transformed(step)
        return {name: scaled_camera(cameras_in_rig[name], transform, scale) for name in pairs}

    def misses(step: F64) -> F64:
        posed = cameras(step)
        off = [posed[name].project(of.x_in_world)[0] - of.uv_px for name, of in pairs.items()]
        return np.nan_to_num(np.concatenate(off), nan=FAR_PX)

    def residuals(step: F64) -> F64:
        return np.ravel(misses(step))

    def near_residuals(step: F64) -> F64:
        return np.ravel(misses(step)[near])

    tolerance = max(default_tolerance_px(cameras_in_rig[name]) for name in pairs)
    best = np.zeros(7 if scaled else 6)
    # A wide loss first: cameras far from the one with most pairs may be far off.
    for loss_px in (16 * tolerance, tolerance):
        best = scipy.optimize.least_squares(residuals, best, loss="cauchy", f_scale=loss_px).x
    near = np.hypot(*misses(best).T) < tolerance
    if near.sum() >= FEWEST:
        best = scipy.optimize.least_squares(near_residuals, best).x
    transform, scale = transformed(best)
    posed = cameras(best)
    agree = sum(int(agreeing(posed[name], of).sum()) for name, of in pairs.items())
    return Fitted(transform, scale, agree, len(x), tuple(len(of) for of in pairs.values()))


def scaled_camera(camera: Camera, transform: F64, scale: float) -> Camera:
    """A camera of the rig after the rig was scaled about its origin, and then moved rigidly."""
    pose = camera.world_from_camera.copy()
    pose[:3, 3] *= scale
    return replace(camera, world_from_camera=transform @ pose)


def rig_of(scene: RayScene, cameras: Mapping[str, Camera]) -> Rig:
    """Cameras that turn and shift together [6] about the object's centre."""
    centre = scene.centre

    def move(given: tuple[Camera, ...], step: F64) -> tuple[Camera, ...]:
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix()
        turn[:3, 3] = centre + step[3:] - turn[:3, :3] @ centre
        return tuple(replace(c, world_from_camera=turn @ c.world_from_camera) for c in given)

    def spread(given: tuple[Camera, ...]) -> list[F64]:
        return [_own_step(camera, centre) for camera in given]

    return Rig(tuple(cameras.values()), move, spread)


def _own_step(camera: Camera, centre: F64) -> F64:
    """Derivative [6, 6] of a camera's step in its own axes by a motion of the world about a point."""
    back = camera.world_from_camera[:3, :3].T
    x, y, z = camera.position - centre
    # A turn w moves the camera by w x (position - centre).
    by_turn = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
    return np.block([[back, np.zeros((3, 3))], [back @ by_turn, back]])


def _by_contours(
    scene: RayScene,
    views: Mapping[str, View],
    cameras: dict[str, Camera],
    pairs: Mapping[str, Pairs],
    inliers: Mapping[str, Bool],
) -> dict[str, Camera]:
    """The rig after the contours of all photographs with masks, and the pairs as weak terms."""
    masked = [name for name in cameras if views[name].region is not None]
    if not masked:
        return cameras
    chosen = {name: cameras[name] for name in masked}
    kept = {
        name: Pairs(of.photograph, of.uv_px[inliers[name]], of.x_in_world[inliers[name]])
        for name, of in pairs.items()
    }
    images = [ImageEdges.of(views[name]) for name in masked]
    found = align(scene, images, rig_of(scene, chosen), [kept.get(name) for name in masked])
    last = found.stages[-1][0]
    if len(masked) > 1:
        # Silhouettes from several sides need no clicks, which are off by more than they.
        near = dict(zip(masked, found.stages[-1], strict=True))
        alone = align(scene, images, rig_of(scene, near), [None] * len(masked), stages=1)
        last = alone.stages[-1][0] if alone.history[-1].unknown == 0 else last
    return carried(cameras, last.world_from_camera @ np.linalg.inv(cameras[masked[0]].world_from_camera))

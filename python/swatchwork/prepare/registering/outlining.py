# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The pose of a photograph from its silhouette alone, without a guess.

The mesh's silhouettes from all around are compared with the photograph's, each about its centre, at its own
size, and at every turn in the image at once (a circular correlation of polar pictures). The most alike are
refined by contours. A silhouette cannot tell some poses apart, those of symmetric objects above all: a pose
is believed only where it fits well and the next best does not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F64, Bool, fibonacci_sphere, unit
from swatchwork.capture import Camera
from swatchwork.prepare.registering.contours import BORDER_PX, without_specks
from swatchwork.prepare.registering.motion import apart
from swatchwork.prepare.registering.refining import iou, refine_by_contours
from swatchwork.prepare.registering.view import View
from swatchwork.progress import Progress
from swatchwork.surface import RayScene

STEP = 0.2
"""Logarithm of the ratio of distances at which the mesh's silhouettes are cast."""
TYPICAL = 0.8
"""Root of a silhouette's area over pi, over the object's radius: for a first guess of its distance."""
DIRECTIONS = 2000
"""From which the mesh is seen: 4 degrees apart, and contours refine what is off by half of that."""
GRID = 64
C128 = npt.NDArray[np.complex128]
ANGLES, RADII = 90, 24
OUTERMOST = 2.5
"""Of the polar pictures, in roots of the silhouette's area over pi."""
TRIED, REFINED, COARSE = 40, 4, 80
"""Of the most alike: those whose silhouette is cast in perspective, and those refined; and points along the
object's longer side by which the former are compared."""
LEAST_PX = 40
"""Root of the area of a silhouette with a shape: of a disc of 20 px any round mesh has 97 %."""
FITS = 0.97
"""Least intersection over union of a pose that is believed."""
CLEAR = 0.6
"""What the silhouettes disagree on, 1 - IoU, over that of the next best pose, at most."""
DISTINCT = 10.0
"""Degrees between poses that are not the same."""


@dataclass(frozen=True, eq=False)
class Silhouettes:
    """Of the mesh from all around, at one distance.

    Attributes:
        distance: of the cameras from the object's centre, world units.
        turn: F64[D, 3, 3], world_from_camera of each; z points from the centre to the camera.
        spectrum: complex [D, RADII, ANGLES // 2 + 1], of polar pictures along the angle.
        toward: F64[D, 3], from the camera to the silhouette's centre, in its axes, 1 along -z.
        size: F64[D], root of its area over pi, on the plane at a depth of 1.
        own: F64[D], each picture's weighted area.
    """

    distance: float
    turn: F64
    spectrum: C128
    toward: F64
    size: F64
    own: F64


@dataclass(frozen=True, eq=False)
class Outlined:
    """A pose by the silhouette; ``camera`` is None where it is not sure, and ``why`` says why."""

    camera: Camera | None
    iou: float
    rival: float
    why: str = ""


def silhouettes_around(scene: RayScene, distance: float, directions: int = DIRECTIONS) -> Silhouettes:
    """Cast the mesh's silhouettes from all around, from cameras at ``distance`` (world units)."""
    reach = scene.radius / np.sqrt(max(distance**2 - scene.radius**2, (0.1 * scene.radius) ** 2))
    line = ((np.arange(GRID) + 0.5) / GRID * 2 - 1) * reach
    plane = np.stack(np.meshgrid(line, -line), axis=-1).reshape(-1, 2)
    ahead = np.column_stack([plane, -np.ones(len(plane))])
    turns, spectra, towards, sizes, owns = [], [], [], [], []
    for out in fibonacci_sphere(directions):
        turn = _facing(out)
        origin = np.broadcast_to(scene.centre + distance * out, ahead.shape)
        hit = scene.first_hit(origin, ahead @ turn.T).mesh == 0
        if not hit.any():
            continue
        middle = plane[hit].mean(axis=0)
        size = np.sqrt(hit.sum() / np.pi)
        at = (middle * [1, -1] / reach + 1) / 2 * GRID
        picture = polar(hit.reshape(GRID, GRID), at, size)
        turns.append(turn)
        towards.append([*middle, -1.0])
        sizes.append(size * 2 * reach / GRID)
        owns.append((picture * WEIGHT).sum())
        spectra.append(np.fft.rfft(picture, axis=1))
    return Silhouettes(distance, *map(np.array, (turns, spectra, towards, sizes, owns)))


RADIUS = (np.arange(RADII) + 0.5) / RADII * OUTERMOST
WEIGHT = np.repeat(RADIUS[:, None], ANGLES, axis=1)


def polar(inside: Bool, centre: F64, size: float) -> F64:
    """A mask [H, W] about ``centre`` (x, y) by radii in ``size`` pixels: F64[RADII, ANGLES] of 0 and 1.

    Angles run from x to -y: counter-clockwise as one looks at the picture.
    """
    angle = np.arange(ANGLES) / ANGLES * 2 * np.pi
    x = centre[0] + size * RADIUS[:, None] * np.cos(angle)
    y = centre[1] - size * RADIUS[:, None] * np.sin(angle)
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    height, width = inside.shape
    there = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    there &= inside[row.clip(0, height - 1), column.clip(0, width - 1)]
    return np.asarray(there, dtype=np.float64)


def pose_from_outline(scene: RayScene, view: View, around: Callable[[float], Silhouettes]) -> Outlined:
    """The pose of a view by its region, which must be whole.

    Args:
        around: the mesh's silhouettes from a distance near the one given.
    """
    if view.region is None or not view.region.any():
        return Outlined(None, 0.0, 0.0, "has no mask")
    flat = _without_distortion(view)
    assert flat.region is not None
    rows, columns = np.nonzero(flat.region)
    far = np.array(flat.region.shape) - 1 - BORDER_PX
    if min(rows.min(), columns.min()) < BORDER_PX or rows.max() > far[0] or columns.max() > far[1]:
        return Outlined(None, 0.0, 0.0, "is cut by the frame")
    if len(rows) < LEAST_PX**2:
        return Outlined(None, 0.0, 0.0, f"is only {np.sqrt(len(rows)):.0f} px large in its mask")
    centre = np.array([columns.mean(), rows.mean()]) + 0.5
    size_px = float(np.sqrt(len(rows) / np.pi))
    angle = size_px / np.sqrt(flat.lens.fx * flat.lens.fy)
    seen = around(TYPICAL * scene.radius / angle)
    best = sorted(_alike(seen, polar(flat.region, centre, size_px)), reverse=True)[:TRIED]
    starts = [_camera(flat.lens, scene.centre, seen, d, shift, centre, angle) for _, d, shift in best]
    overlaps = [iou(scene, flat, camera, COARSE) or 0.0 for camera in starts]
    order = sorted(range(len(starts)), key=lambda i: -overlaps[i])
    fits = [refine_by_contours(scene, flat, c) for c in _distinct(scene, [starts[i] for i in order])]
    fits.sort(key=lambda fit: -(fit.iou or 0.0))
    camera = fits[0].camera
    others = [fit for fit in fits[1:] if apart(camera, fit.camera, scene.centre)[0] > DISTINCT]
    found, rival = fits[0].iou or 0.0, max((fit.iou or 0.0 for fit in others), default=0.0)
    why = ""
    if found < FITS:
        why = f"in no pose is its silhouette the mesh's (intersection over union {found:.3f} at best)"
    elif 1 - found > CLEAR * (1 - rival):
        why = f"its silhouette fits several poses (intersections over union {found:.3f} and {rival:.3f})"
    posed = replace(view.lens, world_from_camera=camera.world_from_camera)
    return Outlined(None if why else posed, found, rival, why)


def _without_distortion(view: View) -> View:
    """The view as a lens without distortion would have seen it: its rays cost far less."""
    lens = replace(view.lens, k1=0.0, k2=0.0, p1=0.0, p2=0.0, world_from_camera=np.eye(4))
    assert view.region is not None
    region = without_specks(view.region)
    uv, _ = replace(view.lens, world_from_camera=np.eye(4)).project(lens.rays(lens.pixel_centres()))
    u, v = (np.nan_to_num(uv[:, i], nan=-9.0).astype(np.float32).reshape(region.shape) - 0.5 for i in (0, 1))
    mask = cv2.remap(region.astype(np.float32), u, v, cv2.INTER_LINEAR)
    gray = cv2.remap(view.gray, u, v, cv2.INTER_LINEAR)
    return View(view.file, lens, np.asarray(gray, dtype=np.uint8), np.asarray(mask > 0.5))


def _facing(toward: F64) -> F64:
    """A rotation whose z axis is ``toward``."""
    up = np.eye(3)[int(np.argmin(np.abs(toward)))]
    x = unit(np.cross(up, toward))
    return np.column_stack([x, np.cross(toward, x), toward])


def _alike(around: Silhouettes, picture: F64) -> list[tuple[float, int, int]]:
    """Intersection over union, direction, and turn (in steps of the angle) of the best turns of each."""
    spectrum = np.fft.rfft(picture, axis=1)
    both = np.fft.irfft((around.spectrum.conj() * spectrum * RADIUS[:, None]).sum(axis=1), ANGLES, axis=1)
    share = both / ((picture * WEIGHT).sum() + around.own[:, None] - both)
    turn = share.argmax(axis=1)
    # A slim silhouette is like itself upside down.
    other = (turn + ANGLES // 2) % ANGLES
    d = np.arange(len(share))
    found = [(float(share[i, turn[i]]), int(i), int(turn[i])) for i in d]
    return found + [(float(share[i, other[i]]), int(i), int(other[i])) for i in d]


def _camera(
    lens: Camera, centre: F64, around: Silhouettes, d: int, shift: int, centre_px: F64, angle: float
) -> Camera:
    """The camera that sees the mesh as direction ``d`` does, turned by ``shift``, about ``centre_px``.

    ``angle``: root of the silhouette's area over pi, over the focal length.
    """
    turned = shift / ANGLES * 2 * np.pi
    # The picture is turned counter-clockwise, and so the camera clockwise about its axis.
    turn = around.turn[d] @ Rotation.from_rotvec([0, 0, -turned]).as_matrix()
    seen = around.turn[d] @ around.toward[d]
    ray = lens.rays(centre_px[None])[0]
    # The least rotation that brings the silhouette's centre to where the photograph has it.
    tilt, _ = Rotation.align_vectors([ray], [turn.T @ unit(seen)])
    rotation = turn @ tilt.as_matrix().T
    middle = centre + around.distance * (around.turn[d][:, 2] + seen)
    away = around.distance * around.size[d] / angle
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = middle + away / ray[2] * (rotation @ ray)
    return replace(lens, world_from_camera=pose)


def _distinct(scene: RayScene, cameras: Sequence[Camera]) -> list[Camera]:
    """The first ``REFINED`` of them that are not near one before."""
    kept: list[Camera] = []
    for camera in cameras:
        if all(apart(camera, other, scene.centre)[0] > DISTINCT for other in kept):
            kept.append(camera)
        if len(kept) == REFINED:
            break
    return kept


class Outlines:
    """Poses by silhouettes, which are sought only where nothing else places a photograph."""

    def __init__(self, scene: RayScene, views: Mapping[str, View], progress: Progress) -> None:
        self.scene, self.views, self.progress = scene, views, progress
        self.why: dict[str, str] = {}
        self._around: dict[int, Silhouettes] = {}

    def around(self, distance: float) -> Silhouettes:
        """The mesh's silhouettes from about that far, cast once for distances within a tenth."""
        step = round(np.log(distance / self.scene.radius) / STEP)
        if step not in self._around:
            self._around[step] = silhouettes_around(self.scene, self.scene.radius * np.exp(step * STEP))
        return self._around[step]

    def of(self, names: Sequence[str], enough: int | None = None) -> dict[str, Camera]:
        """Poses of those photographs whose silhouette leaves no doubt, ``enough`` of them or all."""
        masked = [name for name in names if self.views[name].region is not None]
        found: dict[str, Camera] = {}
        if not masked:
            return found
        with self.progress.stage("Comparing silhouettes", len(masked)) as task:
            for name in masked:
                result = pose_from_outline(self.scene, self.views[name], self.around)
                if result.camera is not None:
                    found[name] = result.camera
                else:
                    self.why[name] = result.why
                task.advance()
                if len(found) == enough:
                    break
        return found

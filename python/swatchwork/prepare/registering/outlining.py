# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The pose of a photograph from its silhouette alone, without a guess.

The mesh's silhouettes from all around are compared with the photograph's, each about its centre, at its own
size, and at every turn in the image at once (a circular correlation of polar pictures). The most alike are
refined by contours. A silhouette cannot tell some poses apart, those of symmetric objects above all: a pose
is believed only where it fits well and the next best does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F64, Bool, unit
from swatchwork.capture import Camera
from swatchwork.prepare.registering.contours import BORDER_PX, without_specks
from swatchwork.prepare.registering.motion import apart
from swatchwork.prepare.registering.refining import iou, refine_by_contours
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene

DIRECTIONS = 2000
"""From which the mesh is seen: 4 degrees apart, and contours refine what is off by half of that."""
GRID = 64
ANGLES, RADII = 90, 24
OUTERMOST = 2.5
"""Of the polar pictures, in roots of the silhouette's area over pi."""
TRIED, REFINED, COARSE = 40, 4, 80
"""Of the most alike: those whose silhouette is cast in perspective, and those refined; and points along the
object's longer side by which the former are compared."""
FITS = 0.97
"""Least intersection over union of a pose that is believed."""
CLEAR = 0.6
"""What the silhouettes disagree on, 1 - IoU, over that of the next best pose, at most."""
DISTINCT = 10.0
"""Degrees between poses that are not the same."""


@dataclass(frozen=True, eq=False)
class Silhouettes:
    """Of the mesh from far away.

    Attributes:
        turn: F64[D, 3, 3], world_from_camera of each; z points at the camera.
        spectrum: complex [D, RADII, ANGLES // 2 + 1], of polar pictures along the angle.
        centre: F64[D, 3], a world point whose image is the silhouette's centre.
        size: F64[D], root of its area over pi, world units.
        own: F64[D], each picture's weighted area.
    """

    turn: F64
    spectrum: np.ndarray
    centre: F64
    size: F64
    own: F64


@dataclass(frozen=True, eq=False)
class Outlined:
    """A pose by the silhouette; ``camera`` is None where it is not sure, and ``why`` says why."""

    camera: Camera | None
    iou: float
    rival: float
    why: str = ""


def silhouettes_around(scene: RayScene, directions: int = DIRECTIONS) -> Silhouettes:
    """Cast the mesh's silhouettes from all around."""
    line = (np.arange(GRID) + 0.5) / GRID * 2 - 1
    plane = np.stack(np.meshgrid(line, -line), axis=-1).reshape(-1, 2)
    turns, spectra, centres, sizes, owns = [], [], [], [], []
    for toward in _all_around(directions):
        turn = _facing(toward)
        offset = scene.radius * plane @ turn[:, :2].T
        origin = scene.centre + offset + 2 * scene.radius * toward
        hit = scene.first_hit(origin, np.broadcast_to(-toward, origin.shape)).mesh == 0
        inside = hit.reshape(GRID, GRID)
        where = plane[hit].mean(axis=0) * [1, -1]
        size = np.sqrt(hit.sum() / np.pi) * 2 / GRID
        picture = polar(inside, (where + 1) / 2 * GRID, size * GRID / 2)
        turns.append(turn)
        centres.append(scene.centre + scene.radius * (turn[:, :2] @ (where * [1, -1])))
        sizes.append(size * scene.radius)
        owns.append((picture * WEIGHT).sum())
        spectra.append(np.fft.rfft(picture, axis=1))
    return Silhouettes(np.array(turns), np.array(spectra), np.array(centres), np.array(sizes), np.array(owns))


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


def pose_from_outline(scene: RayScene, view: View, around: Silhouettes) -> Outlined:
    """The pose of a view by its region, which must be whole."""
    if view.region is None or not view.region.any():
        return Outlined(None, 0.0, 0.0, "has no mask")
    region = without_specks(view.region)
    rows, columns = np.nonzero(region)
    far = np.array(region.shape) - 1 - BORDER_PX
    if min(rows.min(), columns.min()) < BORDER_PX or rows.max() > far[0] or columns.max() > far[1]:
        return Outlined(None, 0.0, 0.0, "is cut by the frame")
    centre = np.array([columns.mean(), rows.mean()]) + 0.5
    size_px = float(np.sqrt(len(rows) / np.pi))
    best = sorted(_alike(around, polar(region, centre, size_px)), reverse=True)[:TRIED]
    starts = [_camera(view.lens, around, d, shift, centre, size_px) for _, d, shift in best]
    overlaps = [iou(scene, view, camera, COARSE) or 0.0 for camera in starts]
    order = sorted(range(len(starts)), key=lambda i: -overlaps[i])
    fits = [refine_by_contours(scene, view, c) for c in _distinct(scene, [starts[i] for i in order])]
    fits.sort(key=lambda fit: -(fit.iou or 0.0))
    camera = fits[0].camera
    others = [fit for fit in fits[1:] if apart(camera, fit.camera, scene.centre)[0] > DISTINCT]
    found, rival = fits[0].iou or 0.0, max((fit.iou or 0.0 for fit in others), default=0.0)
    why = ""
    if found < FITS:
        why = f"in no pose is its silhouette the mesh's (intersection over union {found:.3f} at best)"
    elif 1 - found > CLEAR * (1 - rival):
        why = f"its silhouette fits several poses (intersections over union {found:.3f} and {rival:.3f})"
    return Outlined(None if why else camera, found, rival, why)


def _all_around(count: int) -> F64:
    """Unit vectors F64[count, 3], evenly spread along a spiral."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.arange(count) * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


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


def _camera(lens: Camera, around: Silhouettes, d: int, shift: int, centre_px: F64, size_px: float) -> Camera:
    """The camera that sees the mesh as direction ``d`` does, turned by ``shift``, about ``centre_px``."""
    angle = shift / ANGLES * 2 * np.pi
    # The picture is turned counter-clockwise, and so the camera clockwise about its axis.
    turn = around.turn[d] @ Rotation.from_rotvec([0, 0, -angle]).as_matrix()
    ray = replace(lens, world_from_camera=np.eye(4)).rays(centre_px[None])[0]
    away = around.size[d] * np.sqrt(lens.fx * lens.fy) / size_px
    # Looked at along the ray, not along the axis: the least rotation from the one to the other.
    tilt, _ = Rotation.align_vectors([ray], [[0.0, 0.0, -1.0]])
    rotation = turn @ tilt.as_matrix().T
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = around.centre[d] - away * (rotation @ ray)
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

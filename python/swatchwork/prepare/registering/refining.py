# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One photograph's pose refined by its silhouette and depth contours (paper, section 6)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture import Camera
from swatchwork.prepare.registering.aligning import Rig, Round, align
from swatchwork.prepare.registering.contours import (
    BORDER_PX,
    ImageEdges,
    contour_terms,
    distances,
    object_box,
    without_specks,
)
from swatchwork.prepare.registering.motion import moved
from swatchwork.prepare.registering.pairs import Pairs
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene

IOU_STEPS = 300
"""Points along the object's longer side on which silhouettes are compared."""
ENOUGH_SHARE = 0.3
"""Of contours that have a counterpart: below, the pose is not near, or the mesh is another object's."""
CHANCE = 0.002
"""Difference of two IoUs that is one of sampling."""
SURE = 0.97
"""IoU at the end from which on it is not asked whether an earlier stage was better."""
FAR = 0.9
"""IoU below which the object's place and size are set right first."""

Status = Literal["refined", "not settled", "start kept", "no contours"]
"""Came to rest; better than the start, but still moving; no better than the start; nothing to go by."""


@dataclass(frozen=True, eq=False)
class Refined:
    """A pose after refinement; never worse than before it.

    Attributes:
        iou_before, iou: intersection over union of mask and silhouette; None without a mask.
        rms_px: of the contours' distances, robustly weighted.
        history: rounds.
        unknown: motions of the last round, of 6, that contours and pairs say nothing of.
        status: see `Status`.
    """

    camera: Camera
    iou_before: float | None
    iou: float | None
    rms_px: float
    history: tuple[Round, ...]
    unknown: int
    status: Status


def iou(scene: RayScene, view: View, camera: Camera, steps: int = IOU_STEPS) -> float | None:
    """Intersection over union of the view's region and the mesh's silhouette, by points at pixel centres.

    None without a region. Large pictures are sampled at ``steps`` points along the object.
    """
    if view.region is None or not view.region.any():
        return None
    region = without_specks(view.region)
    rows, columns = (np.flatnonzero(region.any(axis=axis)) for axis in (1, 0))
    low, high = object_box(scene, camera)
    low = np.minimum(np.floor(low), [columns[0], rows[0]]).astype(int)
    high = np.maximum(np.ceil(high), [columns[-1] + 1, rows[-1] + 1]).astype(int)
    step = max(1, int((high - low).max()) // steps)
    u, v = (np.arange(low[i] + step // 2, high[i], step) for i in (0, 1))
    inside = region[np.ix_(v, u)]
    at = np.stack(np.meshgrid(u + 0.5, v + 0.5), axis=-1).reshape(-1, 2)
    there = np.isfinite(distances(scene, camera, at)).reshape(inside.shape)
    return float((there & inside).sum() / max((there | inside).sum(), 1))


def refine_by_contours(scene: RayScene, view: View, camera: Camera, pairs: Pairs | None = None) -> Refined:
    """The pose near ``camera`` whose contours lie on the photograph's.

    Args:
        scene: of the mesh.
        view: with a region, the silhouette leads; without, edges of the gray picture do, and the start must
            be within 1.5 % of the object's size.
        camera: the start.
        pairs: those that agreed with it, as weak additional terms: they hold what contours leave open.
    """
    before = iou(scene, view, camera)
    image = ImageEdges.of(view)
    start = camera
    if before is not None and before < FAR:
        start = _placed(scene, view, camera)
    stages = 3 if before is not None else 1
    if contour_terms(scene, image, start, 0.1 * _size(scene, start), 60).share < ENOUGH_SHARE:
        rms = contour_terms(scene, image, camera).rms_px
        return Refined(camera, before, before, rms, (), 6, "no contours")
    rig = Rig((start,), lambda cameras, step: (moved(cameras[0], step),), lambda cameras: [np.eye(6)])
    found = align(scene, [image], rig, [pairs], stages)
    chosen, after = _best(scene, view, camera, before, [stage[0] for stage in found.stages])
    if chosen is camera:
        status: Status = "start kept"
    else:
        status = "refined" if found.settled and chosen is found.stages[-1][0] else "not settled"
    rms = contour_terms(scene, image, chosen, size=200).rms_px
    return Refined(chosen, before, after, rms, found.history, found.history[-1].unknown, status)


def _best(
    scene: RayScene, view: View, camera: Camera, before: float | None, tried: list[Camera]
) -> tuple[Camera, float | None]:
    """The last pose, unless an earlier one covers the mask better; without a mask, the edges are compared."""
    if before is None:
        image = ImageEdges.of(view)
        start, end = (contour_terms(scene, image, c, size=200) for c in (camera, tried[-1]))
        better = end.share * (end.rms_px < np.inf) >= 0.95 * start.share
        return (tried[-1] if better else camera), None
    chosen, best = tried[-1], iou(scene, view, tried[-1]) or 0.0
    if best < max(SURE, before):
        for candidate in tried[:-1]:
            found = iou(scene, view, candidate) or 0.0
            if found > best + CHANCE:
                chosen, best = candidate, found
    return (chosen, best) if best >= before else (camera, before)


def _size(scene: RayScene, camera: Camera) -> float:
    low, high = object_box(scene, camera)
    return float((high - low).max())


def _placed(scene: RayScene, view: View, camera: Camera) -> Camera:
    """The camera moved so that the silhouette has the region's centre and area; as it was where cut."""
    assert view.region is not None
    region = without_specks(view.region)
    for _ in range(3):
        low, high = object_box(scene, camera)
        steps = np.maximum((high - low) / 100, 1.0).max()
        u, v = (np.arange(low[i] + steps / 2, high[i], steps) for i in (0, 1))
        at = np.stack(np.meshgrid(u, v), axis=-1).astype(np.float64).reshape(-1, 2)
        on: F64 = at[np.isfinite(distances(scene, camera, at))] if len(at) else at
        if not len(on) or _cut(on, camera, float(steps)) or not region.any():
            return camera
        rows, columns = np.nonzero(region)
        own = np.column_stack([columns, rows]).astype(np.float64) + 0.5
        if _cut(np.asarray(own, np.float64), camera, 1.0):
            return camera
        grow = float(np.sqrt(len(own) / (len(on) * steps**2)))
        camera = _towards(camera, scene.centre, on.mean(axis=0), own.mean(axis=0), grow)
    return camera


def _cut(points: F64, camera: Camera, steps: float) -> bool:
    edge = steps + BORDER_PX
    far = np.array([camera.width, camera.height]) - edge
    return bool((points < edge).any() or (points > far).any())


def _towards(camera: Camera, centre: F64, at: F64, wanted: F64, grow: float) -> Camera:
    """The camera moved without a turn: what is seen ``at`` comes to ``wanted``, ``grow`` times larger."""
    _, depth = camera.project(centre[None])
    if not depth[0] > 0:
        return camera
    rotation = camera.world_from_camera[:3, :3]
    seen, sought = (camera.rays(p[None])[0] @ rotation for p in (at, wanted))
    # Points at the object's depth, in the camera's axes.
    seen, sought = seen * depth[0] / -seen[2], sought * (depth[0] / grow) / -sought[2]
    return moved(camera, np.concatenate([np.zeros(3), seen - sought]))

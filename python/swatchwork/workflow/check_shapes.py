# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Silhouettes: whether the mesh, from each camera, covers what the photograph shows of the object."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations, product

import cv2
import numpy as np

from ..arrays import F32, F64, Bool
from ..capture import Camera, Frame, Photograph
from ..relight import cosine_map
from ..surface import RayScene

OBJECT_PX = 240
"""The object's larger side in the pictures that are compared."""
LARGEST_PX = 1600
"""Of those pictures' larger side, where the object is a small part of the photograph."""
GRID = 64
"""Points along a side of the grid on which other poses and other meshes are tried."""
SCALES = (1000.0, 100.0, 10.0, 25.4, 12.0, 1 / 12.0, 1 / 25.4, 0.1, 0.01, 0.001)


@dataclass(frozen=True, eq=False)
class FrameShape:
    """A frame's picture with the two silhouettes in it, at a common reduced size [H, W]."""

    frame: Frame
    camera: Camera
    """Reduced with the picture."""
    radiance: F32
    """[H, W, 3]"""
    region: Bool | None
    """Where alpha or mask has the object; None where the photograph has neither."""
    silhouette: Bool
    """Where the mesh is."""

    @cached_property
    def iou(self) -> float | None:
        """Intersection over union of the two; None where it cannot be judged."""
        if self.region is None or not self.region.any():
            return None
        return float((self.region & self.silhouette).sum() / (self.region | self.silhouette).sum())

    @property
    def least(self) -> float:
        """The IoU to expect: 5 % off, and a quarter of a pixel along the border for sampling."""
        if self.region is None or not self.region.any():
            return 0.0
        inner = cv2.erode(self.region.astype(np.uint8), np.ones((3, 3), np.uint8))
        border = self.region.sum() - inner.sum()
        return float(0.95 - 0.25 * border / self.region.sum())

    @property
    def fits(self) -> bool:
        """False where the silhouettes clearly disagree."""
        return self.iou is None or self.iou >= self.least

    @cached_property
    def grid(self) -> tuple[F64, Bool]:
        """Points [Q, 2] in pixels of the photograph, around its object, and whether each is inside it."""
        assert self.region is not None
        rows, columns = np.nonzero(self.region)
        low = np.array([columns.min(), rows.min()], np.float64)
        high = np.array([columns.max(), rows.max()], np.float64) + 1
        margin = 0.25 * (high - low).max()
        height, width = self.region.shape
        low, high = np.maximum(low - margin, 0), np.minimum(high + margin, [width, height])
        line = (np.arange(GRID) + 0.5) / GRID
        at = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2) * (high - low) + low
        inside = self.region[at[:, 1].astype(int), at[:, 0].astype(int)]
        return at * (self.frame.camera.width / width, self.frame.camera.height / height), inside

    def offset_in_words(self) -> str:
        """How the photograph's object lies to the mesh's, in pixels of the photograph."""
        if self.region is None or not self.silhouette.any():
            return "the mesh is not in the picture"
        scale = self.frame.camera.width / self.region.shape[1]
        centres = [np.argwhere(mask).mean(axis=0) * scale for mask in (self.region, self.silhouette)]
        down, right = centres[0] - centres[1]
        size = float(np.sqrt(self.region.sum() / self.silhouette.sum()))
        across, along = ("right" if right > 0 else "left"), ("below" if down > 0 else "above")
        return (
            f"the photograph's object lies {abs(right):.0f} px {across} of the mesh and {abs(down):.0f} px "
            f"{along} it, and is {size:.2f} times its size"
        )


def frame_shape(frame: Frame, photograph: Photograph, scene: RayScene) -> FrameShape:
    """Reduce a photograph until its object is about ``OBJECT_PX`` wide, and cast the mesh's silhouette."""
    region: Bool | None = None
    if (photograph.alpha < 1).any():
        region = photograph.alpha > 0.5
    if photograph.mask is not None:
        region = photograph.mask if region is None else region & photograph.mask
    camera = frame.camera
    side = float(max(camera.width, camera.height))
    if region is not None and region.any():
        rows, columns = np.nonzero(region)
        side = float(max(np.ptp(rows), np.ptp(columns)) + 1)
    else:
        uv, _ = camera.project(scene.meshes[0].vertices)
        if np.isfinite(uv).all():
            side = float(np.clip(np.ptp(uv, axis=0).max(), 1, side))
    scale = min(1.0, OBJECT_PX / side, LARGEST_PX / max(camera.width, camera.height))
    width, height = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    x, y = width / camera.width, height / camera.height
    small = replace(
        camera,
        width=width,
        height=height,
        fx=camera.fx * x,
        fy=camera.fy * y,
        cx=camera.cx * x,
        cy=camera.cy * y,
    )

    def smaller(image: F32) -> F32:
        return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), dtype=np.float32)

    return FrameShape(
        frame,
        small,
        smaller(photograph.radiance),
        None if region is None else smaller(region.astype(np.float32)) > 0.5,
        np.isfinite(cosine_map(scene, small)),
    )


@dataclass(frozen=True, eq=False)
class Move:
    """The mesh moved: x -> linear (x - about) + about."""

    linear: F64
    about: F64
    words: str

    @property
    def mirrors(self) -> bool:
        """Whether left becomes right."""
        return bool(np.linalg.det(self.linear) < 0)


def axis_moves(centre: F64) -> list[Move]:
    """The mesh with its axes swapped or reversed in every way, about the origin and about its centre."""
    moves = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        linear = np.zeros((3, 3))
        linear[range(3), order] = signs
        if not np.array_equal(linear, np.eye(3)):
            named = ", ".join(("" if s > 0 else "-") + "xyz"[i] for i, s in zip(order, signs, strict=True))
            for about in (np.zeros(3), centre):
                moves.append(Move(linear, about, f"(x, y, z) -> ({named})"))
    return moves


def scale_moves() -> list[Move]:
    """The mesh in other units."""
    return [Move(np.eye(3) * s, np.zeros(3), f"times {s:.4g}") for s in SCALES]


def overlap(scene: RayScene, camera: Camera, shape: FrameShape, move: Move | None = None) -> tuple[int, int]:
    """Sizes of intersection and union of a photograph's region with the mesh from a camera, on the grid.

    ``camera`` has the photograph's full size; ``move`` is of the mesh.
    """
    uv, inside = shape.grid
    direction, origin = camera.rays(uv), camera.position
    if move is not None:
        # The ray is moved back instead of the mesh forward.
        back = np.linalg.inv(move.linear)
        direction, origin = direction @ back.T, back @ (origin - move.about) + move.about
    there = np.isfinite(direction).all(axis=1)
    hit = np.zeros(len(uv), bool)
    toward = direction[there]
    hit[there] = scene.first_hit(np.broadcast_to(origin, toward.shape), toward).mesh == 0
    return int((hit & inside).sum()), int((hit | inside).sum())


def better(own: float, other: float) -> bool:
    """Whether another IoU is so much better that it is no chance."""
    return other > 0.85 and other - own > 0.03 and 1 - other < (1 - own) / 2


def best_move(scene: RayScene, shapes: list[FrameShape], moves: list[Move]) -> tuple[float, float, Move]:
    """IoU pooled over frames of the mesh as it is, and of the best of its moves, which is given too."""

    def pooled(move: Move | None) -> float:
        both, either = np.sum([overlap(scene, s.frame.camera, s, move) for s in shapes], axis=0)
        return float(both / max(either, 1))

    found = [pooled(move) for move in moves]
    best = int(np.argmax(found))
    return pooled(None), found[best], moves[best]


def best_pose(scene: RayScene, shapes: list[FrameShape], i: int) -> tuple[float, float, int]:
    """IoU of photograph i in its own pose, and in the best of the other frames' poses, with its number."""
    camera = shapes[i].frame.camera
    own, best, place = 0.0, -1.0, i
    for j, other in enumerate(shapes):
        posed = replace(camera, world_from_camera=other.frame.camera.world_from_camera)
        both, either = overlap(scene, posed, shapes[i])
        found = both / max(either, 1)
        if j == i:
            own = found
        elif found > best:
            best, place = found, j
    return own, best, place

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Contours of the mesh, found in the depth that a camera sees, and how far they lie from the photograph's.

A point of an occluding contour that stays fixed on the mesh moves across the contour as the contour does, to
first order in the camera's motion: its derivative is the residual's, and the points are found anew each time.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from swatchwork.arrays import F32, F64, I64, U8, Bool
from swatchwork.capture import Camera
from swatchwork.prepare.registering.motion import projected
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene

JUMP = 0.04
"""Jump in depth, in radii of the object, that makes a contour."""
BISECTIONS = 12
"""Four thousandths of a grid's step: a thousandth of a pixel, and above what single precision resolves."""
BORDER_PX = 2.0
"""The photograph's frame is no contour, and neither is what the blur of the mask smears along it."""
BLUR_PX = 1.0
"""Of the mask and the gray, so that stairs of pixels become an edge whose place is known to a part of one."""
SPECK = 1e-3
"""Share of the region up to which a hole or an island of the mask counts as noise."""
INNER_REACH = 0.03
"""Of the object's size: how far an edge of the photograph is looked for, where no mask says which it is."""
SLOPE, OVER_MEDIAN = 2.0, 3.0
"""Least slope of such an edge in gray levels a pixel, and over the median slope around it."""
INNER_WEIGHT = 0.3
"""An edge of the photograph may be one of texture or of a shadow."""
SOFT_PX = 0.5
"""Distance from which on a robust weight is reduced, at least."""


@dataclass(frozen=True, eq=False)
class Contours:
    """Points of the mesh's occluding contours as a camera sees them.

    Attributes:
        x_in_world: F64[R, 3], on the nearer surface.
        uv_px: F64[R, 2].
        normal: F64[R, 2], unit, in the image, from the nearer surface outward.
        outer: Bool[R], whether nothing of the object lies behind.
    """

    x_in_world: F64
    uv_px: F64
    normal: F64
    outer: Bool


@dataclass(frozen=True, eq=False)
class ImageEdges:
    """A photograph prepared for looking up edges: gray U8[H, W], and the blurred mask U8[H, W] or None."""

    gray: U8
    mask: U8 | None

    @classmethod
    def of(cls, view: View) -> ImageEdges:
        """From a view; its mask without specks and pinholes."""
        if view.region is None or not view.region.any():
            return cls(view.gray, None)
        whole = without_specks(view.region)
        blurred = cv2.GaussianBlur(
            whole.astype(np.uint8) * 255, (0, 0), BLUR_PX, borderType=cv2.BORDER_REPLICATE
        )
        return cls(view.gray, np.asarray(blurred, dtype=np.uint8))


@dataclass(frozen=True, eq=False)
class ContourTerms:
    """Distances of the mesh's contours from the photograph's, along their normals.

    Attributes:
        residual_px: F64[R], positive where the photograph's lies further out.
        by_step: F64[R, 6], its derivatives by the step of `moved`.
        weight: F64[R], 0 to 1, robust.
        outer: Bool[R], as in `Contours`.
        share: of the contours in the picture, those whose counterpart was found.
    """

    residual_px: F64
    by_step: F64
    weight: F64
    outer: Bool
    share: float

    @property
    def rms_px(self) -> float:
        """Weighted; of the silhouette's where there are such. Infinite without any."""
        chosen = self.outer if self.outer.any() else ~self.outer
        weight = self.weight[chosen]
        if weight.sum() <= 0:
            return np.inf
        return float(np.sqrt((weight * self.residual_px[chosen] ** 2).sum() / weight.sum()))


def without_specks(region: Bool) -> Bool:
    """The region without islands and holes that are tiny beside it; a hole of the object's own stays."""
    whole = region.astype(np.uint8)
    least = SPECK * region.sum()
    for value in (1, 0):
        _, label, stats, _ = cv2.connectedComponentsWithStats(
            (whole == value).astype(np.uint8), connectivity=4
        )
        small = stats[:, cv2.CC_STAT_AREA] < least
        small[0] = False
        if value == 1 and len(stats) > 1:
            small[1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())] = False
        if small.any():
            whole[small[label]] = 1 - value
    return whole.astype(bool)


def object_box(scene: RayScene, camera: Camera) -> tuple[F64, F64]:
    """Corners F64[2], F64[2] of the box around the mesh in the image, within its frame; all of it where
    part of the mesh is not seen."""
    size = np.array([camera.width, camera.height], np.float64)
    mesh = scene.meshes[0]
    uv, _ = camera.project(mesh.vertices[np.unique(mesh.faces)])
    if not np.isfinite(uv).all():
        return np.zeros(2), size
    low, high = np.clip(uv.min(axis=0) - 1, 0, size), np.clip(uv.max(axis=0) + 1, 0, size)
    return low, high


def distances(scene: RayScene, camera: Camera, uv_px: F64) -> F64:
    """Of the object along the rays through image points [P, 2]; infinite beside it, NaN out of the lens."""
    direction = camera.rays(uv_px)
    there = np.isfinite(direction[:, 0])
    found = np.full(len(uv_px), np.nan)
    hit = scene.first_hit(np.broadcast_to(camera.position, (int(there.sum()), 3)), direction[there])
    found[there] = np.where(hit.mesh == 0, hit.t, np.inf)
    return found


def depth_contours(scene: RayScene, camera: Camera, size: int = 160) -> Contours:
    """The contours, found between the points of a grid that is ``size`` steps long over the object.

    Where two neighbours see depths that differ, the place of the jump is found by halving; steep surfaces
    have none and drop out. Parts of the mesh narrower than a step can be missed.
    """
    low, high = object_box(scene, camera)
    extent = np.maximum(high - low, 0)
    pitch = max(float(extent.max()) / size, 0.25)
    steps = np.ceil(extent / pitch).astype(int) + 1
    if min(extent) <= 0:
        return Contours(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, bool))
    u, v = (np.linspace(low[i], high[i], steps[i]) for i in (0, 1))
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    t = distances(scene, camera, grid.reshape(-1, 2)).reshape(grid.shape[:2])
    jump = JUMP * scene.radius
    across, down = _jumps(t[:, :-1], t[:, 1:], jump), _jumps(t[:-1], t[1:], jump)
    first = np.concatenate([grid[:, :-1][across], grid[:-1][down]])
    second = np.concatenate([grid[:, 1:][across], grid[1:][down]])
    t_first = np.concatenate([t[:, :-1][across], t[:-1][down]])
    t_second = np.concatenate([t[:, 1:][across], t[1:][down]])
    swap = t_second < t_first
    near, far = np.where(swap[:, None], second, first), np.where(swap[:, None], first, second)
    outward = far - near
    t_near, t_far = np.minimum(t_first, t_second), np.maximum(t_first, t_second)
    for _ in range(BISECTIONS):
        middle = (near + far) / 2
        t_middle = distances(scene, camera, middle)
        with np.errstate(invalid="ignore"):
            nearer = np.isfinite(t_middle) & (np.abs(t_middle - t_near) <= np.abs(t_far - t_middle))
        near, t_near = np.where(nearer[:, None], middle, near), np.where(nearer, t_middle, t_near)
        far, t_far = np.where(nearer[:, None], far, middle), np.where(nearer, t_far, t_middle)
    normal = _normals(across, down, near, outward, ~np.isfinite(t_far))
    with np.errstate(invalid="ignore"):
        kept = (t_far - t_near > jump) & (np.abs(normal).max(axis=1, initial=0.0) > 0)
    near, t_near = near[kept], t_near[kept]
    x = camera.position + t_near[:, None] * camera.rays(near)
    return Contours(x, near, normal[kept], ~np.isfinite(t_far[kept]))


def _jumps(a: F64, b: F64, jump: float) -> Bool:
    """Where one is on the object and the other is not, or both are and one is further away."""
    one, two = np.isfinite(a), np.isfinite(b)
    known = ~(np.isnan(a) | np.isnan(b))
    with np.errstate(invalid="ignore"):
        return np.asarray(known & ((one != two) | (one & two & (np.abs(a - b) > jump / 2))))


def _normals(across: Bool, down: Bool, uv: F64, outward: F64, outer: Bool) -> F64:
    """Unit normals [E, 2] of the polyline through the crossings, by the cells with two crossings of a kind.

    The surface's own normals would not do: at an edge of the mesh there are two.
    """
    number_across, number_down = (np.full(where.shape, -1) for where in (across, down))
    number_across[across] = np.arange(across.sum())
    number_down[down] = across.sum() + np.arange(down.sum())
    sides = np.stack(
        [number_across[:-1], number_across[1:], number_down[:, :-1], number_down[:, 1:]], axis=-1
    )
    sides = sides.reshape(-1, 4)
    sides = np.sort(sides[(sides >= 0).sum(axis=1) == 2], axis=1)[:, 2:]
    i, j = sides[outer[sides[:, 0]] == outer[sides[:, 1]]].T
    along = uv[j] - uv[i]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    total = np.zeros_like(uv)
    for end in (i, j):
        sign = np.sign((normal * outward[end]).sum(axis=1))
        np.add.at(total, end, sign[:, None] * normal)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.where(length > 0, length, 1.0))


def contour_terms(
    scene: RayScene, image: ImageEdges, camera: Camera, reach_px: float = 8.0, size: int = 160
) -> ContourTerms:
    """How far the mesh's contours are from the photograph's, which is looked for within ``reach_px``.

    The silhouette's counterpart is the border of the mask, or without one the strongest edge of the gray
    picture, as for inner contours. What lies at the picture's frame is left out.
    """
    found = depth_contours(scene, camera, size)
    low, high = object_box(scene, camera)
    inner_px = min(reach_px, max(INNER_REACH * float((high - low).max()), 3.0))
    residual, weight = np.full(len(found.uv_px), np.nan), np.ones(len(found.uv_px))
    by_mask = found.outer if image.mask is not None else np.zeros_like(found.outer)
    if image.mask is not None:
        residual[by_mask] = _to_border(image.mask, found.uv_px[by_mask], found.normal[by_mask], reach_px)
    by_gray = np.flatnonzero(~by_mask)
    residual[by_gray] = _to_edge(image.gray, found.uv_px[by_gray], found.normal[by_gray], inner_px)
    weight[by_gray] = INNER_WEIGHT
    frame = np.array([camera.width, camera.height])
    at = found.uv_px + residual[:, None] * found.normal
    with np.errstate(invalid="ignore"):
        inside = ((found.uv_px > BORDER_PX) & (found.uv_px < frame - BORDER_PX)).all(axis=1)
        kept = inside & ((at > BORDER_PX) & (at < frame - BORDER_PX)).all(axis=1)
    residual, weight, normal = residual[kept], weight[kept], found.normal[kept]
    _, by_step, _ = projected(camera, found.x_in_world[kept])
    by_step = -np.einsum("ri,rij->rj", normal, by_step)
    for of in (by_mask[kept], ~by_mask[kept]):
        if of.any():
            weight[of] *= _robust(residual[of])
    share = float(kept.sum() / max(inside.sum(), 1))
    return ContourTerms(residual, by_step, weight, found.outer[kept], share)


def _robust(residual_px: F64) -> F64:
    """Cauchy's weights, at the scale of the median: half of the points at least are taken as sound."""
    scale = max(1.4826 * float(np.median(np.abs(residual_px))), SOFT_PX)
    return np.asarray(1 / (1 + (residual_px / (2 * scale)) ** 2))


def _profiles(picture: U8, uv_px: F64, normal: F64, reach_px: float) -> tuple[F64, F32]:
    """Steps [S] along the normals in pixels, and the picture's values [R, S] there."""
    step = 0.5 if reach_px <= 12 else 1.0
    steps = np.arange(-np.ceil(reach_px / step), np.ceil(reach_px / step) + 1) * step
    # OpenCV's pixel centres are at whole numbers; its maps have fewer than 32767 rows.
    at = (uv_px[:, None] + steps[:, None] * normal[:, None] - 0.5).astype(np.float32)
    rows = [
        cv2.remap(picture, part[..., 0], part[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for part in np.array_split(at, max(1, len(at) // 16384 + 1))
        if len(part)
    ]
    values = np.concatenate(rows) if rows else np.zeros((0, len(steps)))
    return steps, np.asarray(values, dtype=np.float32)


def _to_border(mask: U8, uv_px: F64, normal: F64, reach_px: float) -> F64:
    """Signed distances [R] to the nearest place where the mask ends in the normal's direction, or NaN."""
    steps, value = _profiles(mask, uv_px, normal, reach_px)
    before, after = value[:, :-1], value[:, 1:]
    ends = (before >= 127.5) & (after < 127.5)
    share = (before - 127.5) / np.where(ends, before - after, 1)
    place = np.where(ends, steps[:-1] + share * (steps[1] - steps[0]), np.inf)
    nearest = np.abs(place).argmin(axis=1) if len(place) else np.zeros(0, int)
    return _picked(place, nearest)


def _to_edge(gray: U8, uv_px: F64, normal: F64, reach_px: float) -> F64:
    """Signed distances [R] to the strongest edge across the normal, or NaN where none stands out."""
    steps, value = _profiles(gray, uv_px, normal, reach_px + 2)
    if not len(value):
        return np.zeros(0)
    pitch = steps[1] - steps[0]
    smooth = cv2.GaussianBlur(value, (0, 0), BLUR_PX / pitch, sigmaY=1e-6, borderType=cv2.BORDER_REPLICATE)
    slope = np.abs(np.gradient(smooth, pitch, axis=1))
    middle = slope[:, 1:-1]
    peak = np.where((middle >= slope[:, :-2]) & (middle >= slope[:, 2:]), middle, 0)
    peak[:, np.abs(steps[1:-1]) > reach_px] = 0
    best = peak.argmax(axis=1)
    rows = np.arange(len(best))
    height = peak[rows, best]
    a, b, c = slope[rows, best], middle[rows, best], slope[rows, best + 2]
    shift = np.clip(0.5 * (a - c) / np.minimum(a - 2 * b + c, -1e-9), -0.5, 0.5)
    stands_out = (height > SLOPE) & (height > OVER_MEDIAN * np.median(slope, axis=1))
    return np.asarray(np.where(stands_out, steps[best + 1] + shift * pitch, np.nan))


def _picked(place: F64, column: I64) -> F64:
    picked = place[np.arange(len(place)), column]
    return np.asarray(np.where(np.isfinite(picked), picked, np.nan))

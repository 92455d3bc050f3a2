# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What surface each pixel of a frame shows: near and far point, and how much of the pixel it fills."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F64, I32, Bool, norm
from swatchwork.capture import Camera
from swatchwork.surface import RayScene, each_of

# Sub-pixel rays along each side, for pixels near a silhouette, a depth discontinuity or a grazing slope.
SUBPIXELS = 4
# Neighbouring pixels whose points are further apart than this many pixel widths are looked at closely.
STEP = 3.0


@dataclass(frozen=True)
class PixelMap:
    """The object as a frame's pixels see it, by casting rays; arrays over all H * W pixels, row by row.

    ``near``, ``far`` F64[H*W, 3]: nearest and farthest visible point of the object inside the pixel (NaN
    where there is none); ``near_normal``, ``far_normal``: unit normals of the triangles there;
    ``cover`` F64[H*W]: share of the pixel that the object fills; ``blocked`` Bool[H*W]: an occluder shows
    in it; ``centre`` Bool[H*W]: the pixel's centre shows the object.
    """

    near: F64
    far: F64
    near_normal: F64
    far_normal: F64
    cover: F64
    blocked: Bool
    centre: Bool


def pixel_map(scene: RayScene, camera: Camera) -> PixelMap:
    """Cast one ray a pixel, and 4 x 4 where that could miss a silhouette or a depth discontinuity."""
    height, width = camera.height, camera.width
    centres = camera.pixel_centres()
    point, normal, mesh = _hits(scene, camera, centres)
    cover = (mesh == 0).astype(np.float64)
    blocked = mesh > 0
    mine = (mesh == 0)[:, None]
    point, normal = np.where(mine, point, np.nan), np.where(mine, normal, np.nan)
    near, far, near_normal, far_normal = point, point.copy(), normal, normal.copy()

    critical = np.flatnonzero(_critical(point.reshape(height, width, 3), mesh.reshape(height, width), camera))
    if len(critical):
        # From border to border: what is whole at its corners is whole.
        offset = np.linspace(-0.5, 0.5, SUBPIXELS)
        grid = np.stack(np.meshgrid(offset, offset), axis=-1).reshape(-1, 2)
        inside = (centres[critical][:, None] + grid).reshape(-1, 2)
        p, n, m = _hits(scene, camera, inside)
        shape = (len(critical), len(grid))
        p, n, m = p.reshape(*shape, 3), n.reshape(*shape, 3), m.reshape(shape)
        depth = np.where(m == 0, norm(p - camera.position), np.nan)
        cover[critical] = (m == 0).mean(axis=1)
        blocked[critical] = (m > 0).any(axis=1)
        some = np.flatnonzero((m == 0).any(axis=1))
        for where, pick, points, normals in (
            (critical[some], np.nanargmin(depth[some], axis=1), near, near_normal),
            (critical[some], np.nanargmax(depth[some], axis=1), far, far_normal),
        ):
            points[where], normals[where] = p[some, pick], n[some, pick]
    return PixelMap(near, far, near_normal, far_normal, cover, blocked, mine[:, 0])


def _hits(scene: RayScene, camera: Camera, uv_px: F64) -> tuple[F64, F64, I32]:
    """First hits through image points [R, 2]: point [R, 3], unit normal [R, 3], mesh [R] (-1: none)."""
    point, normal = np.full((len(uv_px), 3), np.nan), np.full((len(uv_px), 3), np.nan)
    mesh = np.full(len(uv_px), -1, dtype=np.int32)

    def look(part: slice) -> None:
        direction = camera.rays(uv_px[part])
        looks = np.flatnonzero(np.isfinite(direction).all(axis=1))
        direction = direction[looks]
        origin = np.broadcast_to(camera.position, direction.shape)
        hit = scene.cast(origin, direction, np.full(len(looks), np.inf), "INTERSECT")
        found = hit["geomID"].astype(np.int32)
        mesh[part][looks] = found
        mine = np.flatnonzero(found == 0)
        place = looks[mine]
        point[part][place] = camera.position + hit["tfar"][mine, None].astype(np.float64) * direction[mine]
        normal[part][place] = scene.face_normal[hit["primID"][mine]]

    each_of(look, len(uv_px))
    return point, normal, mesh


def _critical(point: F64, mesh: I32, camera: Camera) -> Bool:
    """Bool[H * W]: pixels beside one that shows something else, or the same surface a step away."""
    pixel = norm(point - camera.position) / np.sqrt(camera.fx * camera.fy)
    critical: Bool = np.zeros(mesh.shape, dtype=bool)
    for axis in (0, 1):
        one: tuple[slice, ...] = (
            (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        )
        two: tuple[slice, ...] = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        away = norm(point[one] - point[two])
        # NaN (something other than the object) compares false on the right, and so counts as a step.
        step = ~(away <= STEP * np.minimum(pixel[one], pixel[two]))
        step &= (mesh[one] == 0) | (mesh[two] == 0) | (mesh[one] != mesh[two])
        critical[one] |= step
        critical[two] |= step
    # Silhouettes cut corners: take the diagonal neighbours too.
    grown: Bool = critical.copy()
    grown[1:] |= critical[:-1]
    grown[:-1] |= critical[1:]
    grown[:, 1:] |= grown[:, :-1].copy()
    grown[:, :-1] |= grown[:, 1:].copy()
    return grown.ravel()

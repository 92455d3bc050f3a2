# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The outline of a mesh in a camera's image, lens and all: silhouette, and where one part hides another."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import F64, U8
from ..capture import Camera
from ..surface import RayScene

STEP = 0.02
"""Least jump in depth that is drawn, in radii of the mesh: above facets and fine relief, below a limb."""
LINE, HALO = (64, 224, 255), (8, 16, 24)
"""sRGB: a light line that few objects have the colour of, and dark beside it for light ones."""


def outline(rays: RayScene, camera: Camera, window: F64, size: tuple[int, int]) -> U8:
    """Lines U8[H, W, 4], straight alpha, over a part of the image.

    Args:
        window: left, top, right, bottom in pixels of the camera; may reach beyond its image.
        size: (W, H) of the drawing.
    """
    width, height = size
    left, top, right, bottom = window
    v, u = np.mgrid[0:height, 0:width] + 0.5
    uv_px = np.column_stack(
        [left + u.ravel() * (right - left) / width, top + v.ravel() * (bottom - top) / height]
    )
    direction = camera.rays(uv_px)
    met = np.flatnonzero(np.isfinite(direction).all(axis=1))
    hit = rays.first_hit(np.broadcast_to(camera.position, (len(met), 3)), direction[met])
    depth = np.full(len(uv_px), np.inf)
    depth[met] = hit.t * (direction[met] @ -camera.world_from_camera[:3, 2])
    edge = np.asarray(edges(depth.reshape(height, width), STEP * rays.radius), dtype=np.float32)
    drawn = np.empty((height, width, 4), dtype=np.uint8)
    core = np.clip(1.6 * cv2.GaussianBlur(edge, (0, 0), 0.7), 0, 1)
    halo = np.clip(0.9 * cv2.GaussianBlur(cv2.dilate(edge, np.ones((3, 3))), (0, 0), 1.0), 0, 0.6)
    share = core[..., None] / np.maximum(np.maximum(core, halo), 1e-6)[..., None]
    drawn[..., :3] = share * LINE + (1 - share) * np.asarray(HALO)
    drawn[..., 3] = 255 * np.maximum(core, halo)
    return drawn


def edges(depth: F64, step: float) -> np.ndarray:
    """Bool[H, W]: pixels that lie at least ``step`` before what their neighbours lead one to expect.

    1 / depth of a plane is linear in the image, whatever its slant, so its second difference shows only what
    is no plane. Depth [H, W] is inf where there is nothing.
    """
    # Beyond the border a plane goes on.
    nearness = np.pad(1 / depth, 1, mode="reflect", reflect_type="odd")
    middle = nearness[1:-1, 1:-1]
    across = 2 * middle - nearness[1:-1, :-2] - nearness[1:-1, 2:]
    down = 2 * middle - nearness[:-2, 1:-1] - nearness[2:, 1:-1]
    return np.asarray(np.maximum(across, down) > step * middle**2)

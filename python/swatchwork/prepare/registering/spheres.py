# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Spheres without a scan: the pose by the outline, an ellipse off the optical axis (paper, section 6).

The world's origin is the sphere's centre, and its axes are the camera's: a sphere looks the same from all
sides, and each photograph is a world of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from swatchwork.arrays import F64, Bool
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.ball import given_outline
from swatchwork.prepare.mirror import PerspectiveBall
from swatchwork.prepare.registering.contours import BLUR_PX, BORDER_PX, without_specks

FEWEST = 30
"""Points of an outline, of some hundreds."""
ROUND_PX, ROUND_SHARE = 1.0, 0.01
"""Rms up to which an outline is a sphere's: pixels, and a share of its radius."""


@dataclass(frozen=True, eq=False)
class SpherePose:
    """A camera before a sphere about the origin.

    Attributes:
        camera: its rotation is the identity.
        rms_px: distance of the outline from the sphere's.
        radius_px: mean radius in the photograph.
        cut: share of the sphere's outline that lies outside the photograph.
    """

    camera: Camera
    rms_px: float
    radius_px: float
    cut: float


def sphere_camera(
    lens: Camera, outline: Bool | tuple[float, ...], radius: float, *, name: str = "the sphere"
) -> SpherePose:
    """The camera that sees a sphere of ``radius`` (world units) with a given outline.

    Args:
        lens: its pose is not used.
        outline: the region Bool[H, W] that the sphere fills; or a circle (x, y, radius) or an ellipse
            (x, y, semi-axis, semi-axis, degrees of the first from right to down) in pixels.
        name: of the photograph, for errors.

    Raises:
        InputError: the radius is not positive; the region is empty, of another size, or no sphere's.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise InputError(f"the sphere's radius is {radius:g}", file=name, expected="a positive length")
    lens = replace(lens, world_from_camera=np.eye(4))
    if isinstance(outline, tuple):
        given = given_outline(outline, (lens.width, lens.height), lens, name, allow_cut=True)
        assert isinstance(given.ball, PerspectiveBall)
        ball, rms = given.ball, given.residual_px
    else:
        ball, rms = _fitted(lens, outline, name)
    points = ball.outline()
    inside = ((points >= 0) & (points <= (lens.width, lens.height))).all(axis=1)
    size = float(np.linalg.norm(points - points.mean(axis=0), axis=1).mean())
    if rms > max(ROUND_PX, ROUND_SHARE * size):
        raise InputError(
            f"the outline is {rms:.1f} px off that of a sphere of {size:.0f} px radius",
            file=name,
            expected="a mask of one sphere, all that is seen of it, and this camera's focal length",
        )
    pose = np.eye(4)
    pose[:3, 3] = -ball.centre * radius
    return SpherePose(replace(lens, world_from_camera=pose), rms, size, float(1 - inside.mean()))


def _fitted(lens: Camera, region: Bool, name: str) -> tuple[PerspectiveBall, float]:
    if region.shape != (lens.height, lens.width):
        raise InputError(
            f"the region has {region.shape[1]} x {region.shape[0]} pixels",
            file=name,
            expected=f"{lens.width} x {lens.height} as the photograph",
        )
    points = region_outline(region)
    ball = PerspectiveBall.fit(lens, points) if len(points) >= FEWEST else None
    for _ in range(10):
        if ball is None:
            break
        off = np.abs(ball.residual_px(points))
        # A stand or a hand beside the sphere is no part of it; half of the outline is taken as sound.
        near = off <= max(3 * 1.4826 * float(np.median(off)), 1.0)
        ball = PerspectiveBall.fit(lens, points[near])
    if ball is None:
        raise InputError(
            f"the region ({int(region.sum())} pixels) has no outline of a sphere",
            file=name,
            expected="the disc or ellipse that the sphere fills in the photograph",
        )
    off = np.abs(ball.residual_px(points))
    near = off <= max(3 * 1.4826 * float(np.median(off)), 1.0)
    return ball, float(np.sqrt(np.mean(off[near] ** 2)))


def region_outline(region: Bool) -> F64:
    """Points F64[P, 2] of the outer border of the largest part of a region, to a part of a pixel.

    They lie where the blurred region falls below one half; what runs along the picture's frame is left out.
    """
    if not region.any():
        return np.zeros((0, 2))
    whole = without_specks(region).astype(np.uint8)
    contours, _ = cv2.findContours(whole, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    border = max(contours, key=cv2.contourArea).reshape(-1, 2).astype(np.float64)
    # By the slope of the blurred region, to first order: it is steepest, and so nearly straight, there.
    blurred = cv2.GaussianBlur(whole.astype(np.float32), (0, 0), BLUR_PX, borderType=cv2.BORDER_REPLICATE)
    dx, dy = (cv2.Sobel(blurred, cv2.CV_32F, i, 1 - i, scale=1 / 8) for i in (1, 0))
    x = border
    for _ in range(3):
        u, v = (x[:, i].astype(np.float32)[None] for i in (0, 1))
        value, gx, gy = (cv2.remap(image, u, v, cv2.INTER_LINEAR)[0] for image in (blurred, dx, dy))
        slope = np.column_stack([gx, gy]).astype(np.float64)
        steep = np.maximum((slope**2).sum(axis=1), 1e-4)
        x = x + slope * ((0.5 - value.astype(np.float64)) / steep)[:, None]
    at = x + 0.5
    inside = (at > BORDER_PX) & (at < np.array(region.shape[::-1]) - BORDER_PX)
    close = np.linalg.norm(x - border, axis=1) < 2
    return np.asarray(at[inside.all(axis=1) & close])

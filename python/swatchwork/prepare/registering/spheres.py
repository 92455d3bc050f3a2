# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A sphere's place by its outline, exact in perspective; how the sphere is turned it does not say.

The centre is fixed by any outline, cut or whole: a sphere of known radius has one distance at which its cone
of tangents is that wide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.optimize

from swatchwork.arrays import F64, norm
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.ball import ball_through
from swatchwork.prepare.mirror import PerspectiveBall
from swatchwork.prepare.registering.contours import BORDER_PX, ImageEdges
from swatchwork.prepare.registering.least import root_mean_square
from swatchwork.prepare.registering.units import BY_SILHOUETTES, OFF, scale_error
from swatchwork.prepare.registering.view import View

LEAST_SHARE = 0.6
"""Of the mask's border that must lie within `TOLERANCE_PX` of the outline."""
TOLERANCE_PX = 1.5


def border_points(view: View) -> F64:
    """Places F64[E, 2] where the view's region ends, to a part of a pixel; the picture's frame is no end."""
    mask = ImageEdges.of(view).mask
    if mask is None:
        return np.zeros((0, 2))
    value = mask.astype(np.float64) - 127.5
    found = []
    for across in (0, 1):
        a, b = (value[:, :-1], value[:, 1:]) if across == 0 else (value[:-1], value[1:])
        v, u = np.nonzero((a > 0) != (b > 0))
        at = np.column_stack([u, v]) + 0.5
        at[:, across] += a[v, u] / (a[v, u] - b[v, u])
        found.append(at)
    points = np.concatenate(found)
    inside = ((points > BORDER_PX) & (points < np.array(mask.shape[::-1]) - BORDER_PX)).all(axis=1)
    return points[inside]


def sphere_camera(view: View, radius: float) -> tuple[Camera, float]:
    """The camera in a world with the sphere's centre as origin and the camera's own axes, by view.region.

    Args:
        radius: world units.

    Returns:
        The camera, and the rms in pixels of the border from the outline, over the points that agree.

    Raises:
        InputError: no mask, or one whose border is no sphere's outline.
    """
    points = border_points(view)
    ball = ball_through(points, view.lens, TOLERANCE_PX)
    off = np.abs(ball.residual_px(points)) if ball is not None else np.zeros(0)
    near = off < TOLERANCE_PX
    if ball is None or near.mean() < LEAST_SHARE:
        share = "" if ball is None else f" ({100 * near.mean():.0f} % of its border lies on the best one)"
        raise InputError(
            f"the mask is not a sphere's{share}" if len(points) else "there is no mask",
            file=view.file,
            expected="a mask or alpha whose border is the outline of the sphere",
            hint="Leave stands and shadows out of the mask",
        )
    pose = np.eye(4)
    pose[:3, 3] = -radius * ball.centre
    return replace(view.lens, world_from_camera=pose), root_mean_square(off[near])


def sphere_in_rig(
    views: Sequence[View], cameras_in_rig: Mapping[str, Camera], radius: float
) -> tuple[F64, dict[str, float]]:
    """The sphere's centre F64[3] in the coordinates of cameras known to each other, by all their outlines.

    Returns:
        The centre, and the rms in pixels of each photograph's outline.

    Raises:
        InputError: no photograph with a mask is among them, a mask is no sphere's, or the outlines meet only
            at another radius.
    """
    seen = [v for v in views if v.name in cameras_in_rig and v.region is not None]
    if not seen:
        raise InputError(
            "no photograph that shows the board has a mask", expected="the sphere's mask in one at least"
        )
    balls, points = {}, {}
    for view in seen:
        camera, _ = sphere_camera(view, radius)
        balls[view.name] = -camera.position
        at = border_points(view)
        off = PerspectiveBall(view.lens, -camera.position / radius).residual_px(at)
        points[view.name] = at[np.abs(off) < TOLERANCE_PX]
    poses = {view.name: cameras_in_rig[view.name].world_from_camera for view in seen}
    _check_radius(poses, balls)
    centres = [poses[name][:3, :3] @ ball + poses[name][:3, 3] for name, ball in balls.items()]

    def misses(centre: F64) -> list[F64]:
        rows = []
        for view in seen:
            pose = poses[view.name]
            local = (centre - pose[:3, 3]) @ pose[:3, :3] / radius
            # A step into the sphere has no outline: it is held off.
            local *= max(1.0, 1.001 / float(norm(local)))
            rows.append(PerspectiveBall(view.lens, local).residual_px(points[view.name]))
        return rows

    def residuals(x: F64) -> F64:
        return np.concatenate(misses(radius * x))

    start = np.mean(centres, axis=0)
    found = scipy.optimize.least_squares(residuals, start / radius, loss="cauchy", f_scale=TOLERANCE_PX)
    centre = radius * found.x
    rms_px = {view.name: root_mean_square(off) for view, off in zip(seen, misses(centre), strict=True)}
    return centre, rms_px


def _check_radius(poses: Mapping[str, F64], balls: Mapping[str, F64]) -> None:
    """Raises InputError where the rays to the centre meet at distances other than the radius says."""
    if len(balls) < 2:
        return
    # p + s d = c for each photograph: unknown are c and the common scale s of the distances.
    usual = float(np.mean([norm(ball) for ball in balls.values()]))
    rows = [np.column_stack([np.eye(3), poses[n][:3, :3] @ ball / -usual]) for n, ball in balls.items()]
    A, b = np.concatenate(rows), np.concatenate([poses[name][:3, 3] for name in balls])
    x, _, rank, sv = np.linalg.lstsq(A, b, rcond=None)
    scale = float(x[3]) / usual
    loose = rank < 4 or sv[-1] < 0.05 * sv[0]
    if not loose and scale > 0 and abs(np.log(scale)) > 5 * OFF:
        raise scale_error(
            1 / scale,
            f"the outlines meet at {scale:.3g} times the distance that --sphere says",
            BY_SILHOUETTES,
            "sphere",
        )

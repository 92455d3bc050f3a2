# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Least squares of a camera's pose, and perhaps its focal length, on points whose images are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture import Camera
from swatchwork.prepare.registering.motion import moved, projected

ROUNDS = 30
UNSEEN_PX = 1e6
"""Residual of a point that the camera does not see, such as one behind it."""


def misses_px(camera: Camera, uv_px: F64, x_in_world: F64) -> F64:
    """Distances F64[C] in pixels of the points' images from where they should be; infinite where unseen."""
    off = np.linalg.norm(camera.project(x_in_world)[0] - uv_px, axis=1)
    return np.asarray(np.where(np.isfinite(off), off, np.inf))


def root_mean_square(values: F64) -> float:
    """Of no values, 0."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def zoomed(camera: Camera, factor: float) -> Camera:
    """The camera with both focal lengths times a factor."""
    return replace(camera, fx=camera.fx * factor, fy=camera.fy * factor)


def least_squares(
    camera: Camera, uv_px: F64, x_in_world: F64, *, focal: bool = False, exactness: float = 1e-10
) -> tuple[Camera, F64]:
    """Levenberg and Marquardt's minimum of the squared distances in pixels, started from ``camera``.

    The unknowns are the six of `moved` and, with ``focal``, the logarithm of a factor of fx and fy. It ends
    where a round lowers the squared distances by a smaller share than ``exactness``.

    Returns:
        The camera, and the normal matrix F64[n, n] there.
    """
    damping = 1e-4
    cost = _cost(camera, uv_px, x_in_world)
    normal = np.eye(7 if focal else 6)
    for _ in range(ROUNDS):
        r, J = _linearised(camera, uv_px, x_in_world, focal)
        normal = J.T @ J
        before = cost
        while damping < 1e8:
            # Marquardt's diagonal: rotations and translations have different units.
            damped = normal + damping * np.diag(np.maximum(np.diag(normal), 1e-300))
            step = np.asarray(np.linalg.lstsq(damped, -J.T @ r, rcond=None)[0], dtype=np.float64)
            trial = moved(camera, step[:6])
            if focal:
                trial = zoomed(trial, float(np.exp(np.clip(step[6], -0.5, 0.5))))
            trial_cost = _cost(trial, uv_px, x_in_world)
            if trial_cost < cost:
                camera, cost = trial, trial_cost
                damping = max(damping / 10, 1e-9)
                break
            damping *= 10
        if damping >= 1e8 or before - cost <= exactness * before:
            break
    return camera, normal


def _cost(camera: Camera, uv_px: F64, x_in_world: F64) -> float:
    return float((np.minimum(misses_px(camera, uv_px, x_in_world), UNSEEN_PX) ** 2).sum())


def _linearised(camera: Camera, uv_px: F64, x_in_world: F64, focal: bool) -> tuple[F64, F64]:
    at, by_step, _ = projected(camera, x_in_world)
    if focal:
        # Pixels are the distorted point times the focal length, from the principal point on.
        by_step = np.concatenate([by_step, (at - [camera.cx, camera.cy])[..., None]], axis=-1)
    seen = np.isfinite(at[:, 0])
    return (at - uv_px)[seen].ravel(), by_step[seen].reshape(-1, by_step.shape[-1])

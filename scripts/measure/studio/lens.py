# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where the pixels of a distorted lens look, by OpenCV alone: the package's own camera is under test."""

from __future__ import annotations

import cv2
import numpy as np

from swatchwork.arrays import F64, Float
from swatchwork.capture import Camera


def slopes(camera: Camera, uv_px: Float) -> F64:
    """Undistorted x / depth, y / depth (y down) F64[P, 2] of image points [P, 2], pixel centres at +0.5."""
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    lens = np.array([camera.k1, camera.k2, camera.p1, camera.p2])
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-12)
    points = np.ascontiguousarray(uv_px, dtype=np.float64).reshape(-1, 1, 2)
    return np.asarray(cv2.undistortPoints(points, matrix, lens, criteria=until)).reshape(-1, 2)


def corner_slopes(camera: Camera) -> F64:
    """`slopes` F64[H + 1, W + 1, 2] at the corners of all pixels; within one they are straight to 1e-4 px."""
    v, u = np.mgrid[0 : camera.height + 1, 0 : camera.width + 1].astype(np.float64)
    return slopes(camera, np.stack([u, v], axis=-1)).reshape(camera.height + 1, camera.width + 1, 2)

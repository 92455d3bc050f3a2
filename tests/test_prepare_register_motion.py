# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Derivatives of projections, against differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from swatchwork.capture import Camera
from swatchwork.prepare.registering import apart, moved, projected


@pytest.fixture
def camera():
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0.3, -0.8, 0.2]).as_matrix()
    pose[:3, 3] = pose[:3, 2] * 4 + [0.1, 0.2, 0.0]
    return Camera(640, 480, 900.0, 880.0, 330.0, 250.0, pose, -0.12, 0.03, 0.002, -0.001)


def test_derivatives_are_what_differences_say(camera):
    x = np.random.default_rng(1).normal(0, 0.4, (20, 3))
    _, by_step, by_point = projected(camera, x)
    h = 1e-6
    for i in range(6):
        step = np.eye(6)[i] * h
        slope = (projected(moved(camera, step), x)[0] - projected(moved(camera, -step), x)[0]) / (2 * h)
        # Central differences of coordinates of hundreds of pixels keep nine digits over a millionth.
        np.testing.assert_allclose(by_step[:, :, i], slope, atol=1e-4)
    for i in range(3):
        step = np.eye(3)[i] * h
        slope = (projected(camera, x + step)[0] - projected(camera, x - step)[0]) / (2 * h)
        np.testing.assert_allclose(by_point[:, :, i], slope, atol=1e-4)


def test_poses_apart(camera):
    turned = moved(camera, np.radians([0.0, 0.5, 0.0, 0, 0, 0]))
    assert apart(camera, turned, np.zeros(3)) == pytest.approx((0.5, 0.0), abs=1e-6)
    away = replace(camera, world_from_camera=camera.world_from_camera.copy())
    away.world_from_camera[:3, 3] *= 1.01
    assert apart(camera, away, np.zeros(3)) == pytest.approx((0.0, 0.01), abs=1e-6)

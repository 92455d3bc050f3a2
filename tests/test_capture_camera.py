# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The camera against OpenCV, and against itself backwards."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from swatchwork.arrays import unit
from swatchwork.capture import Camera
from swatchwork.errors import InputError

LENS = {"k1": -0.21, "k2": 0.06, "p1": 0.0013, "p2": -0.0021}
OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])


def pose(seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    m = np.eye(4)
    m[:3, :3] = q * np.sign(np.linalg.det(q))
    m[:3, 3] = rng.normal(size=3)
    return m


def camera(**changes: object) -> Camera:
    given = {
        "width": 64,
        "height": 48,
        "fx": 50.0,
        "fy": 52.0,
        "cx": 31.0,
        "cy": 25.5,
        "world_from_camera": pose(),
    }
    return Camera(**(given | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("lens", [{}, LENS])
def test_projects_as_opencv_does(lens: dict[str, float]) -> None:
    cam = camera(**lens)
    rng = np.random.default_rng(0)
    x_in_camera = rng.uniform([-0.6, -0.5, -3], [0.6, 0.5, -1.5], size=(200, 3))
    x_in_world = x_in_camera @ cam.world_from_camera[:3, :3].T + cam.position
    # OpenCV's pixel centres are at whole numbers: its principal point is half a pixel lower.
    matrix = np.array([[cam.fx, 0, cam.cx - 0.5], [0, cam.fy, cam.cy - 0.5], [0, 0, 1]])
    expected, _ = cv2.projectPoints(
        x_in_camera @ OPENCV_FROM_OPENGL,
        np.zeros(3),
        np.zeros(3),
        matrix,
        np.array([*lens.values()] or [0.0] * 4),
    )
    uv_px, depth = cam.project(x_in_world)
    np.testing.assert_allclose(uv_px - 0.5, expected[:, 0], atol=1e-9)  # rounding
    np.testing.assert_allclose(depth, -x_in_camera[:, 2], atol=1e-12)


@pytest.mark.parametrize("lens", [{}, LENS, {"k1": 0.4}, {"k1": 0.1, "k2": -0.02, "p2": 0.01}])
def test_rays_undo_projection(lens: dict[str, float]) -> None:
    cam = camera(**lens)
    centres = cam.pixel_centres()
    assert centres.shape == (64 * 48, 2)
    np.testing.assert_array_equal(centres[1], [1.5, 0.5])
    d = cam.rays(centres)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-14)
    uv_px, depth = cam.project(cam.position + 2.5 * d)
    assert (depth > 0).all()
    np.testing.assert_allclose(uv_px, centres, atol=1e-8)  # the undistortion stops at 1e-9 of a focal length


def test_image_axes_are_right_and_down() -> None:
    cam = camera(world_from_camera=np.eye(4), cx=32.0, cy=24.0)
    uv_px, depth = cam.project(np.array([[0, 0, -2.0], [0.1, 0, -2], [0, 0.1, -2], [0, 0, 2]]))
    np.testing.assert_allclose(uv_px[:3], [[32, 24], [34.5, 24], [32, 21.4]])
    np.testing.assert_allclose(depth, [2, 2, 2, -2])
    assert np.isnan(uv_px[3]).all(), "behind the camera"


def test_points_beyond_the_turning_radius_do_not_fold_back_into_the_image() -> None:
    # r (1 - r^2 / 3) turns back at r = 1; a point at r = 1.6 would land at 0.235, in the middle of the image.
    cam = camera(k1=-1 / 3, world_from_camera=np.eye(4))
    uv_px, depth = cam.project(np.array([[1.6, 0, -1], [0.9, 0, -1]]))
    assert np.isnan(uv_px[0]).all() and depth[0] > 0
    np.testing.assert_allclose(uv_px[1], [31.0 + 50 * 0.9 * (1 - 0.27), 25.5])
    # The largest distorted radius is 2/3: image points beyond it have no ray.
    d = cam.rays(np.array([[31.0 + 50 * 0.7, 25.5], [31.0 + 50 * 0.6, 25.5]]))
    assert np.isnan(d[0]).all() and np.isfinite(d[1]).all()


def test_strong_barrel_distortion_is_undone_up_to_its_rim() -> None:
    cam = camera(k1=-1 / 3, world_from_camera=np.eye(4))
    r = np.linspace(0, 0.999, 400)
    x = np.column_stack([r * np.cos(5 * r), r * np.sin(5 * r), -np.ones_like(r)])
    d = cam.rays(cam.project(x)[0])
    # The derivative vanishes at r = 1, so rounding of 1e-16 / 0.002 is all that may be left, times safety.
    np.testing.assert_allclose(d, unit(x), atol=1e-9)


def test_a_pose_rounded_by_its_writer_becomes_a_rotation_again() -> None:
    cam = camera(world_from_camera=np.round(pose(), 4))
    rotation = cam.world_from_camera[:3, :3]
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(rotation, pose()[:3, :3], atol=1e-4)


def spoiled(row: int, column: int, value: float) -> np.ndarray:
    m = pose()
    m[row, column] = value
    return m


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fx": 0.0}, "focal length fx is 0"),
        ({"fy": -3.0}, "focal length fy is -3"),
        ({"cx": np.nan}, "cx is nan"),
        ({"width": 0}, "width 0"),
        (
            {"world_from_camera": pose() * np.diag([2, 2, 2, 1.0]).sum(axis=0)},
            "not rigid: its axes have lengths 2, 2, 2",
        ),
        ({"world_from_camera": pose() @ np.diag([-1, 1, 1, 1.0])}, "mirrored"),
        ({"world_from_camera": spoiled(1, 3, np.nan)}, "contains nan"),
        ({"world_from_camera": spoiled(3, 0, 0.5)}, "last row"),
        ({"world_from_camera": np.eye(3)}, "shape [3, 3]"),
    ],
)
def test_refuses(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        camera(**changes)
    assert message in str(caught.value) and "expected" in str(caught.value)

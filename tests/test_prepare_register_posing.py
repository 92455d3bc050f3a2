# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Poses from clicked pairs: wrong pairs found, and pairs that give no pose told apart by their reason."""

from dataclasses import replace

import numpy as np
import pytest

from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering import apart, default_tolerance_px, pose_from_pairs
from swatchwork.simulate import look_at, shape

MESH = shape("blob", 32)
LENS = Camera(1200, 800, 1500.0, 1480.0, 610.0, 390.0, np.eye(4), -0.12, 0.03, 0.001, -0.0015)
POSE = look_at([2.6, 2.2, 1.6])
CAMERA = replace(LENS, world_from_camera=POSE)
ORIGIN = np.zeros(3)


def clicked(count, seed=0, noise_px=0.0, camera=CAMERA):
    """Points of the mesh that face the camera, and where a hand puts them in the image."""
    rng = np.random.default_rng(seed)
    facing = ((camera.position - MESH.vertices) * MESH.normals).sum(axis=1) > 0.2
    x = MESH.vertices[rng.choice(np.flatnonzero(facing), count, replace=False)]
    uv, _ = camera.project(x)
    return uv + rng.normal(0, noise_px, uv.shape), x


@pytest.mark.parametrize("count", [4, 5, 6, 12, 40])
def test_exact_pairs_give_the_exact_pose(count):
    uv, x = clicked(count)
    posed = pose_from_pairs(LENS, uv, x)
    # Newton's inverse of the lens and the least squares both go to rounding.
    assert apart(CAMERA, posed.camera, ORIGIN) == pytest.approx((0, 0), abs=1e-5)
    assert posed.inliers.all() and posed.rms_px < 1e-4 and posed.camera.width == 1200
    assert not posed.focal_off and (count < 6 or posed.focal_fits == pytest.approx(1, abs=1e-4))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [12, 16, 20])
def test_a_third_of_wrong_pairs_is_thrown_out(count, seed):
    uv, x = clicked(count, seed, noise_px=1.2)
    rng = np.random.default_rng(seed + 100)
    wrong = np.sort(rng.choice(count, int(0.3 * count), replace=False))
    away = rng.normal(size=(len(wrong), 2))
    uv[wrong] += away / np.linalg.norm(away, axis=1, keepdims=True) * rng.uniform(25, 200, (len(wrong), 1))
    # Five standard deviations of a click.
    posed = pose_from_pairs(LENS, uv, x, tolerance_px=6.0)
    assert posed.outliers == tuple(wrong)
    degrees, share = apart(CAMERA, posed.camera, ORIGIN)
    # 1.2 px of 8 clicks on an object 600 px wide: 0.2 degrees, a few times that where weak.
    assert degrees < 1.5 and share < 0.03 and posed.rms_px < 2.5


def test_the_tolerance_grows_with_the_photograph():
    assert default_tolerance_px(LENS) == pytest.approx(4.8)
    assert default_tolerance_px(replace(LENS, width=640)) == 4.0


def test_points_of_a_plane_have_one_pose_near_and_two_afar():
    grid = np.stack(np.meshgrid([-0.4, 0, 0.4], [-0.3, 0, 0.3]), axis=-1).reshape(-1, 2)
    x = np.column_stack([grid, np.zeros(9)])
    near = replace(LENS, world_from_camera=look_at([0.9, 0.5, 1.0]))
    posed = pose_from_pairs(LENS, near.project(x)[0], x)
    assert not posed.ambiguous and apart(near, posed.camera, ORIGIN) == pytest.approx((0, 0), abs=1e-5)
    far = replace(LENS, world_from_camera=look_at([5.0, 0.0, 40.0]))
    noise = np.random.default_rng(0).normal(0, 0.5, (9, 2))
    posed = pose_from_pairs(LENS, far.project(x)[0] + noise, x)
    assert posed.ambiguous and posed.rival_px >= posed.rms_px


def test_a_wrong_focal_length_is_told_by_pairs_in_depth():
    uv, x = clicked(16, noise_px=0.5)
    posed = pose_from_pairs(replace(LENS, fx=LENS.fx * 1.1, fy=LENS.fy * 1.1), uv, x)
    # Half a pixel on an object a quarter as deep as it is away: 1 %.
    assert posed.focal_off and posed.focal_fits == pytest.approx(1 / 1.1, abs=0.03)
    assert posed.focal_deviation < 0.02
    assert not pose_from_pairs(LENS, uv, x).focal_off


def test_a_focal_length_far_off_is_named():
    near = replace(LENS, fx=700.0, fy=700.0, world_from_camera=look_at([1.2, 1.0, 0.7]))
    uv, x = clicked(16, noise_px=0.5, camera=near)
    with pytest.raises(InputError, match="focal length of 1400 px does not fit: with 700 px 16 of 16"):
        pose_from_pairs(replace(near, fx=1400.0, fy=1400.0), uv, x)


@pytest.mark.parametrize("axis", range(3))
def test_a_mirrored_mesh_is_named(axis):
    uv, x = clicked(14, noise_px=1.0)
    x[:, axis] *= -1
    with pytest.raises(InputError, match="mirror image: with it 14 of 14 agree"):
        pose_from_pairs(LENS, uv, x)


def test_swapped_u_and_v_are_named():
    uv, x = clicked(14, noise_px=1.0)
    with pytest.raises(InputError, match="u and v are swapped"):
        pose_from_pairs(LENS, uv[:, ::-1], x)


def test_too_few_pairs_are_told():
    uv, x = clicked(3)
    with pytest.raises(InputError, match="IMG_1: 3 distinct pairs of points; expected 4 or more, better 6"):
        pose_from_pairs(LENS, uv, x, name="IMG_1")
    with pytest.raises(InputError, match="3 distinct pairs"):
        pose_from_pairs(LENS, uv[[0, 1, 2, 2]], x[[0, 1, 2, 2]])


def test_of_five_pairs_all_must_agree():
    uv, x = clicked(5)
    uv[2] += 60
    with pytest.raises(InputError, match=r"of 5 pairs agree on a pose.*expected all, of fewer than 6"):
        pose_from_pairs(LENS, uv, x)


def test_chance_is_no_pose():
    rng = np.random.default_rng(3)
    uv, x = rng.uniform(100, 700, (14, 2)), rng.normal(size=(14, 3))
    with pytest.raises(InputError, match=r"of 14 pairs agree on a pose.*expected 7 or more"):
        pose_from_pairs(LENS, uv, x)


def test_points_on_a_line_are_told():
    rng = np.random.default_rng(0)
    x = rng.uniform(-0.7, 0.7, (8, 1)) * [1.0, 0.5, -0.3] + rng.normal(0, 0.001, (8, 3))
    with pytest.raises(InputError, match="lie on a line"):
        pose_from_pairs(LENS, CAMERA.project(x)[0], x)


def test_points_of_one_place_of_the_photograph_are_told():
    _, x = clicked(8)
    with pytest.raises(InputError, match=r"lie within 3\.0 px"):
        pose_from_pairs(LENS, np.random.default_rng(0).permutation(8)[:, None] * [3 / 7, 0.1] + 400, x)


def test_the_lens_pose_and_the_unit_do_not_matter():
    uv, x = clicked(12, noise_px=1.0)
    plain = pose_from_pairs(LENS, uv, x)
    other = pose_from_pairs(replace(LENS, world_from_camera=POSE), uv, 1000 * x + [5e4, 0, 0])
    np.testing.assert_allclose(other.camera.position, 1000 * plain.camera.position + [5e4, 0, 0], atol=0.01)

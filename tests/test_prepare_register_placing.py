# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Cameras posed by a board, and the mesh placed among them by pairs and silhouettes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from board_photographs import BOARD, COUNT, MESH_FROM_BOARD, SQUARE, clicks, photograph, thing, truth
from swatchwork.errors import InputError
from swatchwork.prepare import Checkerboard
from swatchwork.prepare.registering import apart
from swatchwork.prepare.registering.on_board import board_poses
from swatchwork.prepare.registering.placing import carried, place_mesh
from swatchwork.prepare.registering.units import units_of
from swatchwork.surface import RayScene

ORIGIN = np.zeros(3)


@cache
def views():
    return [photograph(i) for i in range(COUNT)]


@cache
def poses():
    return board_poses(views(), BOARD, SQUARE)


def worst(cameras):
    off = [apart(truth()[name], camera, ORIGIN) for name, camera in cameras.items()]
    return max(angle for angle, _ in off), max(away for _, away in off)


def thing_times(scale):
    mesh = thing().meshes[0]
    return RayScene([replace(mesh, vertices=scale * mesh.vertices)])


def test_cameras_are_where_the_board_says():
    found = poses()
    assert set(found.cameras) == set(truth()) and not found.unseen and not found.ambiguous
    angle, away = worst(carried(found.cameras, MESH_FROM_BOARD))
    # 28 corners known to a twentieth of a pixel, on a board 150 px long.
    assert max(found.rms_px.values()) < 0.15 and angle < 0.08 and away < 0.0015


def test_a_photograph_upside_down_sees_the_same_first_corner():
    view = views()[0]
    lens = replace(view.lens, k1=0.0, k2=0.0, p1=0.0, p2=0.0)
    half = replace(lens, cx=lens.width - lens.cx, cy=lens.height - lens.cy)
    turned = replace(view, gray=np.ascontiguousarray(view.gray[::-1, ::-1]), lens=half)
    upright, other = (board_poses([v], BOARD, SQUARE) for v in (replace(view, lens=lens), turned))
    (a,), (b,) = upright.cameras.values(), other.cameras.values()
    np.testing.assert_allclose(a.position, b.position, atol=0.01)


def test_pairs_in_one_photograph_place_a_plain_object():
    found = place_mesh(thing(), views(), poses().cameras, {"b0": clicks()}, stand=poses().centre)
    angle, away = worst(found.cameras)
    # The goal; clicks are off by 1.5 px, silhouettes of four sides do the rest.
    assert angle < 0.1 and away < 0.002
    assert found.iou is not None and found.iou > 0.997 and found.inliers["b0"].sum() >= 6
    again = carried(poses().cameras, found.mesh_from_rig)
    for name, camera in found.cameras.items():
        np.testing.assert_allclose(camera.world_from_camera, again[name].world_from_camera, atol=1e-9)


def test_pairs_in_several_photographs_need_no_mask():
    bare = [replace(view, region=None) for view in views()]
    pairs = {f"b{i}": clicks(i, 8) for i in range(COUNT)}
    pairs["b3"].uv_px[:3] += 80
    found = place_mesh(thing(), bare, poses().cameras, pairs)
    angle, away = worst(found.cameras)
    # 29 clicks of 1.5 px on an object of 150 px; three seeds without wrong clicks gave 0.5 to 0.8 degrees.
    assert angle < 1.5 and away < 0.025
    assert found.iou is None and not found.inliers["b3"][:3].any()


def test_without_pairs_the_board_is_the_world():
    bare = [replace(view, region=None) for view in views()]
    found = place_mesh(thing(), bare, poses().cameras, {})
    np.testing.assert_allclose(found.mesh_from_rig, np.eye(4), atol=1e-12)


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        (1000.0, "in millimetres where --square is in metres"),
        (0.001, "in metres where --square is in millimetres"),
        (10.0, "in millimetres where --square is in centimetres"),
    ],
)
def test_other_units_are_told_by_one_photograph(scale, words):
    bare = [replace(view, region=None) for view in views()]
    with pytest.raises(InputError, match=words):
        place_mesh(
            thing_times(scale), bare, poses().cameras, {"b0": clicks(scale=scale)}, stand=poses().centre
        )


def test_a_scale_is_told_by_pairs_in_two_photographs():
    bare = [replace(view, region=None) for view in views()]
    pairs = {name: clicks(i, scale=1.5) for i, name in ((0, "b0"), (2, "b2"))}
    with pytest.raises(InputError, match=r"1\.[45]\d? times too large"):
        place_mesh(thing_times(1.5), bare, poses().cameras, pairs, stand=poses().centre)


def test_a_scale_is_told_by_silhouettes():
    with pytest.raises(InputError, match=r"1\.[45]\d? times too large for the board .*silhouettes"):
        place_mesh(
            thing_times(1.5), views(), poses().cameras, {"b0": clicks(scale=1.5)}, stand=poses().centre
        )


def test_factors_of_units():
    assert units_of(25.3, 0.04) == ("millimetres", "inches")
    assert units_of(1 / 12, 0.04) == ("feet", "inches")
    assert units_of(1.5, 0.04) is None


def test_boards_that_do_not_do():
    with pytest.raises(InputError, match="upside down"):
        board_poses(views(), Checkerboard(7, 5), SQUARE)
    with pytest.raises(InputError, match="none of the 1 photographs"):
        board_poses(views()[:1], Checkerboard(12, 9), SQUARE)
    with pytest.raises(InputError, match="positive length"):
        board_poses(views(), BOARD, 0.0)

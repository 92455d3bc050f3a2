# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Cameras before spheres, by masks and by given outlines."""

from dataclasses import replace

import numpy as np
import pytest

from registering_views import LENS
from swatchwork.errors import InputError
from swatchwork.prepare.registering import sphere_camera

AT = np.array([0.15, 0.1, -2.0])
RADIUS = 0.4


def region_of(lens, centre=AT, radius=RADIUS):
    """Pixels whose ray meets the sphere."""
    along = lens.rays(lens.pixel_centres()) @ centre
    return (along**2 > centre @ centre - radius**2).reshape(lens.height, lens.width)


@pytest.mark.parametrize("lens", [LENS, replace(LENS, k1=0.0, k2=0.0, p1=0.0, p2=0.0)])
def test_a_mask_gives_the_camera(lens):
    found = sphere_camera(lens, region_of(lens), RADIUS)
    np.testing.assert_array_equal(found.camera.world_from_camera[:3, :3], np.eye(3))
    # A tenth of a pixel of a radius of 190, all around: 1e-4 of the distance, and less of the direction.
    np.testing.assert_allclose(found.camera.position, -AT, atol=1e-3)
    assert found.rms_px < 0.2 and found.cut == 0 and found.radius_px == pytest.approx(195, abs=10)


def test_a_cut_sphere_is_fitted_by_what_is_seen():
    centre = np.array([0.55, 0.1, -2.0])
    found = sphere_camera(LENS, region_of(LENS, centre), RADIUS)
    assert 0.1 < found.cut < 0.5
    np.testing.assert_allclose(found.camera.position, -centre, atol=5e-3)


def test_a_stand_below_is_left_out():
    region = region_of(LENS)
    columns = np.flatnonzero(region.any(axis=0))
    region[300:, int(columns.mean()) - 12 : int(columns.mean()) + 12] = True
    found = sphere_camera(LENS, region, RADIUS)
    np.testing.assert_allclose(found.camera.position, -AT, atol=4e-3)


def test_a_given_circle_on_the_axis():
    lens = replace(LENS, k1=0.0, k2=0.0, p1=0.0, p2=0.0, fy=LENS.fx)
    found = sphere_camera(lens, (lens.cx, lens.cy, 100.0), 2.0)
    # tan of the half angle is 100 / f.
    distance = 2.0 / np.sin(np.arctan(100 / lens.fx))
    np.testing.assert_allclose(found.camera.position, [0, 0, distance], atol=1e-6)


def test_what_is_no_sphere_is_told():
    square = np.zeros((LENS.height, LENS.width), bool)
    square[100:300, 200:400] = True
    with pytest.raises(InputError, match=r"photo: the outline is .* px off that of a sphere"):
        sphere_camera(LENS, square, 1.0, name="photo")
    with pytest.raises(InputError, match="has no outline of a sphere"):
        sphere_camera(LENS, np.zeros_like(square), 1.0)
    with pytest.raises(InputError, match="the region has 10 x 10 pixels"):
        sphere_camera(LENS, np.zeros((10, 10), bool), 1.0)
    with pytest.raises(InputError, match="radius is -1; expected a positive length"):
        sphere_camera(LENS, square, -1.0)

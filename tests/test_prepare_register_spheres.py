# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Spheres placed by their outline, and the mesh that stands for one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering import View
from swatchwork.prepare.registering.contours import depth_contours
from swatchwork.prepare.registering.spheres import sphere_camera, sphere_in_rig
from swatchwork.simulate import look_at
from swatchwork.surface import RayScene, has_injective_uv, sphere_mesh

LENS = Camera(640, 480, 700.0, 690.0, 326.0, 236.0, np.eye(4), -0.12, 0.03, 0.001, -0.0015)
RADIUS = 40.0


def view_of(centre, camera=LENS, name="ball"):
    """A view of a sphere, its mask exact at pixel centres."""
    local = (np.asarray(centre, float) - camera.position) @ camera.world_from_camera[:3, :3]
    rays = replace(camera, world_from_camera=np.eye(4)).rays(camera.pixel_centres())
    along = rays @ local
    region = (along > 0) & (along**2 > local @ local - RADIUS**2)
    lens = replace(camera, world_from_camera=np.eye(4))
    gray = np.zeros((LENS.height, LENS.width), np.uint8)
    return View(Path(f"{name}.png"), lens, gray, region.reshape(gray.shape))


@pytest.mark.parametrize("centre", [(0.0, 0.0, -200.0), (60.0, -30.0, -180.0), (95.0, 40.0, -190.0)])
def test_an_outline_places_the_camera(centre):
    # The last one is cut by the frame.
    view = view_of(centre)
    found, rms_px = sphere_camera(view, RADIUS)
    np.testing.assert_array_equal(found.world_from_camera[:3, :3], np.eye(3))
    off = np.linalg.norm(found.position + centre)
    # Pixels that are in or out: 0.3 px rms; the mean of some hundred leaves 0.03 of a radius of 140.
    assert off < 0.002 * np.linalg.norm(centre) and rms_px < 0.4


def test_what_is_no_sphere_is_told():
    view = view_of((0.0, 0.0, -200.0))
    square = np.zeros_like(view.region)
    square[100:300, 200:400] = True
    with pytest.raises(InputError, match="not a sphere's"):
        sphere_camera(replace(view, region=square), RADIUS)
    with pytest.raises(InputError, match="no mask"):
        sphere_camera(replace(view, region=None), RADIUS)


def cameras_around():
    places = ([200, 0, 60], [0, 220, 40], [-150, 120, 90])
    return {
        f"s{i}": replace(LENS, world_from_camera=look_at(np.array(p, float), np.array([5.0, 8.0, 2.0])))
        for i, p in enumerate(places)
    }


def test_several_outlines_meet_in_one_centre():
    centre = np.array([7.0, 3.0, -4.0])
    cameras = cameras_around()
    views = [view_of(centre, camera, name) for name, camera in cameras.items()]
    found, rms_px = sphere_in_rig(views, cameras, RADIUS)
    # A tenth of a pixel at 200 / 700 a pixel.
    assert np.linalg.norm(found - centre) < 0.03 and max(rms_px.values()) < 0.4
    with pytest.raises(InputError, match="in millimetres where --square is in centimetres"):
        sphere_in_rig(views, cameras, 10 * RADIUS)


def test_the_mesh_is_a_sphere_to_a_tenth_of_a_pixel():
    mesh = sphere_mesh(RADIUS)
    assert has_injective_uv(mesh) and len(mesh.faces) == 2 * 256 * 127
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    outward = np.einsum("fx,fx->f", np.cross(b - a, c - a), a + b + c)
    assert outward.min() > 0
    camera = Camera(800, 800, 1400.0, 1400.0, 400.0, 400.0, look_at([130.0, 90.0, 60.0]))
    uv = depth_contours(RayScene([mesh]), camera).uv_px
    distance = np.linalg.norm(camera.position)
    true_px = 1400 * RADIUS / np.sqrt(distance**2 - RADIUS**2)
    off = np.linalg.norm(uv - 400, axis=1) - true_px
    # 660 px wide; a thousandth of a pixel is the contours' own.
    assert true_px > 330 and off.max() < 0.002 and off.min() > -0.1


def test_a_radius_is_a_length():
    with pytest.raises(InputError, match="radius"):
        sphere_mesh(-1.0)

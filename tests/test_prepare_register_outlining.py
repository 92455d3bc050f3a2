# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Poses by silhouettes alone: a photograph at a time, without a guess."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swatchwork.capture import Camera, read_capture
from swatchwork.prepare.registering import View, apart, pose_from_outline
from swatchwork.prepare.registering.outlining import ANGLES, Outlines, polar
from swatchwork.progress import SILENT
from swatchwork.simulate import look_at, shape
from swatchwork.surface import RayScene, read_mesh
from swatchwork.workflow.register_inputs import read_views

LENS = Camera(320, 240, 330.0, 325.0, 161.0, 118.0, np.eye(4), k1=-0.1, k2=0.02)


def seen(scene: RayScene, camera: Camera) -> View:
    """A view whose region is where the mesh is."""
    centres = camera.pixel_centres()
    origin = np.broadcast_to(camera.position, (len(centres), 3))
    there = scene.first_hit(origin, camera.rays(centres)).mesh == 0
    region = there.reshape(camera.height, camera.width)
    gray = np.where(region, 180, 20).astype(np.uint8)
    return View(Path("a.png"), replace(camera, world_from_camera=np.eye(4)), gray, region)


def test_a_turn_of_the_picture_is_a_shift_of_the_polar_one():
    y, x = np.mgrid[:200, :200] + 0.5 - 100
    angle = 2 * np.pi * 20 / ANGLES

    def ellipse(turn: float) -> np.ndarray:
        # Counter-clockwise as one looks at it, y being down.
        u, v = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
        return (u / 60) ** 2 + (v / 25) ** 2 + 0.004 * u < 1

    middle = np.array([100.0, 100.0])
    straight, turned = (polar(ellipse(t), middle, 40.0) for t in (0.0, angle))
    # Pixels at the border of a mask without shades.
    assert (np.roll(straight, 20, axis=1) != turned).mean() < 0.03
    assert (straight != turned).mean() > 0.1


def test_a_crooked_object_is_found_from_anywhere():
    scene = RayScene([shape("blob", 48)])
    around = Outlines(scene, {}, SILENT).around
    for seed, place in enumerate(([2.2, 1.5, 1.0], [-1.8, 0.9, -2.0])):
        pose = look_at(np.array(place), np.random.default_rng(seed).normal(0, 0.1, 3))
        camera = replace(LENS, world_from_camera=pose)
        found = pose_from_outline(scene, seen(scene, camera), around)
        assert found.camera is not None, found.why
        angle, away = apart(camera, found.camera, scene.centre)
        # A mask of whole pixels, of an object 150 of them large: a tenth of one is 0.04 degrees.
        assert angle < 0.5 and away < 0.01


def test_a_sphere_looks_the_same_from_everywhere():
    scene = RayScene([shape("sphere", 24)])
    camera = replace(LENS, world_from_camera=look_at(np.array([0.4, 3.2, 1.3])))
    found = pose_from_outline(scene, seen(scene, camera), Outlines(scene, {}, SILENT).around)
    assert found.camera is None and "fits several poses" in found.why


def test_what_the_frame_cuts_is_not_guessed():
    scene = RayScene([shape("blob", 24)])
    pose = look_at(np.array([2.2, 1.5, 1.0]), np.array([0.9, 0.0, 0.0]))
    found = pose_from_outline(
        scene, seen(scene, replace(LENS, world_from_camera=pose)), Outlines(scene, {}, SILENT).around
    )
    assert found.camera is None and found.why == "is cut by the frame"


def test_photographs_of_a_scan_by_another_renderer(shared: Path):
    capture = read_capture(shared / "captures" / "igea-merl")
    assert capture.mesh_path is not None
    scene = RayScene([read_mesh(capture.mesh_path)])
    frames = capture.frames[3:5]
    lens = replace(frames[0].camera, world_from_camera=np.eye(4))
    views, _ = read_views([f.image_path for f in frames], lens, None)
    found = Outlines(scene, views, SILENT).of(list(views))
    for frame in frames:
        angle, away = apart(frame.camera, found[frame.image_path.stem], scene.centre)
        # The goal of registration; a single silhouette.
        assert angle < 0.1 and away < 0.002


@pytest.mark.parametrize("size", [0, 3])
def test_a_mask_of_nothing_is_told(size: int):
    region = np.zeros((240, 320), bool)
    region[100 : 100 + size, 100 : 100 + size] = True
    view = View(Path("a.png"), LENS, np.zeros((240, 320), np.uint8), region)
    scene = RayScene([shape("blob", 24)])
    found = pose_from_outline(scene, view, Outlines(scene, {}, SILENT).around)
    assert found.camera is None and found.why

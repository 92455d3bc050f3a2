# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Contours of meshes, and poses refined by them, on rendered masks and pictures."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from registering_views import CAMERA, LENS, ORIGIN, clicked, disturbed, view_of
from swatchwork.prepare.registering import Pairs, apart, moved
from swatchwork.prepare.registering.contours import ImageEdges, contour_terms, depth_contours
from swatchwork.prepare.registering.refining import iou, refine_by_contours
from swatchwork.simulate import look_at, shape
from swatchwork.surface import Mesh, RayScene


@cache
def scene_of(name):
    if name == "vase":
        # A sphere pulled into a body of revolution about z, and cut by no plane.
        ball = shape("sphere", 40)
        z = ball.vertices[:, 2:]
        wide = 0.45 + 0.2 * np.sin(3 * z) + 0.1 * z
        return RayScene([Mesh(np.hstack([ball.vertices[:, :2] * wide, z]), ball.faces, ball.normals)])
    return RayScene([shape(name, 40)])


@cache
def view(name, masked=True):
    return view_of(scene_of(name), masked=masked)


def test_contours_of_a_sphere_are_its_tangent_cone():
    scene, camera = scene_of("sphere"), replace(CAMERA, k1=0.0, k2=0.0, p1=0.0, p2=0.0)
    found = depth_contours(scene, camera)
    assert found.outer.all() and len(found.uv_px) > 300
    # On the tangent circle x . d = 1 / D. Where a facet is seen edge on, the contour is anywhere on it: off
    # by half of the diagonal of faces that are 2 pi / 80 wide and high, 0.056.
    towards = camera.position / np.linalg.norm(camera.position)
    np.testing.assert_allclose(found.x_in_world @ towards, 1 / np.linalg.norm(camera.position), atol=0.056)
    # The contour's points are where their image is, within the thousandth of a pixel of the halving.
    np.testing.assert_allclose(camera.project(found.x_in_world)[0], found.uv_px, atol=0.01)
    outward = found.uv_px - camera.project(ORIGIN)[0]
    cosine = (found.normal * outward).sum(axis=1) / np.linalg.norm(outward, axis=1)
    # Polygons of 80 corners turn by 4 degrees, twice that where a corner is cut; the ellipse adds a degree.
    assert cosine.min() > np.cos(np.radians(10)) and np.median(cosine) > np.cos(np.radians(2))


def test_a_knot_has_inner_contours_with_something_behind():
    scene = scene_of("knot")
    found = depth_contours(scene, CAMERA)
    inner = found.uv_px[~found.outer]
    assert len(inner) > 100
    for side, hits in ((-1.0, True), (1.0, True)):
        direction = CAMERA.rays(inner + side * found.normal[~found.outer])
        hit = scene.first_hit(np.broadcast_to(CAMERA.position, direction.shape), direction)
        # A pixel beside a crossing of contours may be beside the object.
        assert ((hit.mesh == 0) == hits).mean() > 0.9
    np.testing.assert_allclose(CAMERA.project(found.x_in_world)[0], found.uv_px, atol=0.01)


def test_residuals_and_their_derivatives():
    scene, image = scene_of("blob"), ImageEdges.of(view("blob"))
    at_truth = contour_terms(scene, image, CAMERA, 4.0)
    # Pixels say yes or no: their border is off by up to half of one, evenly spread, and the blur averages.
    assert at_truth.rms_px < 0.2 and abs(at_truth.residual_px[at_truth.outer].mean()) < 0.03
    for i, size in enumerate([2e-3, 2e-3, 4e-3, 6e-3, 6e-3, 2e-2]):
        step = np.eye(6)[i] * size
        away = contour_terms(scene, image, moved(CAMERA, step), 12.0)
        expected = away.by_step[away.outer] @ step
        # Contours that slide on a curved rim, and pixels' stairs: a quarter of a pixel.
        assert np.median(np.abs(away.residual_px[away.outer] - expected)) < 0.25
        assert np.abs(expected).max() > 0.4


@pytest.mark.parametrize(("name", "degrees", "share"), [("blob", 0.1, 0.002), ("knot", 0.05, 0.001)])
@pytest.mark.parametrize("seed", [0, 1])
def test_poses_are_refined_from_three_degrees_off(name, degrees, share, seed):
    start = disturbed(CAMERA, seed)
    found = refine_by_contours(scene_of(name), view(name), start)
    off = apart(CAMERA, found.camera, ORIGIN)
    # Mask and mesh agree to a tenth of a pixel of 480; the knot's many contours know more than the blob's.
    assert off[0] < degrees and off[1] < share
    assert found.status == "refined" and found.unknown == 0
    assert found.iou_before < 0.9 and found.iou > 0.998 and found.rms_px < 0.25
    assert found.camera.k1 == LENS.k1 and found.history[-1].moved_px < 0.01


def test_the_truth_is_not_made_worse():
    found = refine_by_contours(scene_of("blob"), view("blob"), CAMERA)
    assert found.iou >= found.iou_before > 0.999
    assert apart(CAMERA, found.camera, ORIGIN)[0] < 0.1


def test_an_object_cut_by_the_frame():
    scene = scene_of("blob")
    camera = replace(CAMERA, cx=CAMERA.cx - 180, cy=CAMERA.cy - 50)
    cut = view_of(scene, camera)
    assert cut.region[:, 0].any()
    terms = contour_terms(scene, ImageEdges.of(cut), camera, 4.0)
    assert terms.rms_px < 0.2 and terms.share > 0.9
    found = refine_by_contours(scene, cut, disturbed(camera, 0, 1.5, 0.01))
    # Two thirds of the outline are left.
    assert found.iou > 0.997 and apart(camera, found.camera, ORIGIN)[0] < 0.3


def test_a_mask_with_specks_pinholes_and_a_bite():
    whole = view("blob")
    region = whole.region.copy()
    rng = np.random.default_rng(0)
    for row, column in rng.integers(0, 500, (300, 2)):
        region[row : row + 3, column : column + 3] ^= True
    rows, columns = np.nonzero(whole.region)
    region[: rows.min() + 60, columns[rows.argmin()] - 20 : columns[rows.argmin()] + 20] = False
    found = refine_by_contours(scene_of("blob"), replace(whole, region=region), disturbed(CAMERA, 0))
    # The bite is 60 px deep and a fifteenth of the outline long: robust weights leave a twentieth of it.
    assert apart(CAMERA, found.camera, ORIGIN)[0] < 0.5 and found.status == "refined"


def test_a_body_of_revolution_does_not_run_off():
    scene, seen = scene_of("vase"), view("vase")
    axis = np.array([0, 0, 1.0])
    start = disturbed(CAMERA, 3)
    found = refine_by_contours(scene, seen, start)
    assert found.iou > 0.995 and found.unknown >= 1
    # Whatever the turn about z: the axis and its distance are known.
    tilt = [c.world_from_camera[:3, :3].T @ axis for c in (CAMERA, found.camera)]
    assert np.degrees(np.arccos(np.clip(tilt[0] @ tilt[1], -1, 1))) < 0.3
    # The turn is left as the start had it, within 3 degrees of the truth.
    assert apart(CAMERA, found.camera, ORIGIN)[0] < 4


def test_pairs_hold_the_turn_of_a_body_of_revolution():
    scene = scene_of("vase")
    uv, x = clicked(scene.meshes[0], CAMERA, 10, noise_px=1.0)
    found = refine_by_contours(scene, view("vase"), disturbed(CAMERA, 3), Pairs("view.exr", uv, x))
    # A pixel of ten clicks at 0.45 of 3.8 away: 0.1 degrees, and the weights are no more than roughly right.
    assert found.unknown == 0 and apart(CAMERA, found.camera, ORIGIN)[0] < 0.6


def test_without_a_mask_edges_of_the_picture_do():
    found = refine_by_contours(scene_of("knot"), view("knot", masked=False), disturbed(CAMERA, 0, 0.3, 0.002))
    assert found.iou is None and found.iou_before is None
    # Some contours are as bright as what is behind them.
    assert apart(CAMERA, found.camera, ORIGIN)[0] < 0.1


def test_another_object_is_no_counterpart():
    elsewhere = replace(CAMERA, world_from_camera=look_at([2.6, 2.2, 1.6], [0.0, 0.0, 3.0]))
    found = refine_by_contours(scene_of("blob"), replace(view("blob"), region=None), elsewhere)
    assert found.camera is elsewhere and found.status in ("no contours", "start kept")


def test_iou_is_that_of_the_masks():
    scene, seen = scene_of("blob"), view("blob")
    other = disturbed(CAMERA, 0)
    there = view_of(scene, other).region
    expected = (there & seen.region).sum() / (there | seen.region).sum()
    # Every second pixel along both sides of an object of 480.
    assert iou(scene, seen, other) == pytest.approx(expected, abs=0.003)
    assert iou(scene, seen, CAMERA) > 0.999
    assert iou(scene, replace(seen, region=None), CAMERA) is None

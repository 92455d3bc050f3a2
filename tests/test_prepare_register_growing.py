# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From one photograph's pose to all others'; and what cannot be placed is told, not guessed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swatchwork.errors import InputError
from swatchwork.prepare.registering import Tracks, View, apart, find_tracks, grow, refine, rematched, resect
from swatchwork.prepare.registering.lifting import lifted, visible
from swatchwork.surface import points_in_sight, surface_points
from synthetic_photographs import (
    blob,
    photograph,
    photographs,
    shaken,
    true_camera,
    true_tracks,
    truth,
    worst,
)

ANGLE_DEG, AWAY = 0.1, 0.002
"""What poses are found to: features to 0.2 px and some hundreds a photograph of 600 x 450 pixels leave 0.05
degrees, as `refine` states; positions over the distance to the object's middle."""


@pytest.fixture(scope="module")
def all_views() -> list[View]:
    """Eight of the object, one of the same shape with another texture, one of it without any."""
    foreign = replace(photograph(2, 5), file=Path("foreign.png"))
    plain = replace(photograph(3, None), file=Path("plain.png"))
    return [*photographs(), foreign, plain]


@pytest.fixture(scope="module")
def tracks(all_views: list[View]) -> Tracks:
    return find_tracks(all_views)


def test_all_are_placed_from_the_first_and_strangers_are_told(all_views: list[View], tracks: Tracks) -> None:
    grown = grow(blob(), all_views, {"p0": true_camera(0)}, tracks)
    assert set(grown.cameras) == set(truth()) and list(grown.frames) == [v.name for v in all_views]
    assert grown.frames["p0"].status == "given" and grown.frames["p5"].status == "placed"
    assert all(grown.frames[n].inliers > 100 and grown.frames[n].rms_px < 1 for n in truth())
    # Before the last refinement: the last photographs hang on those before.
    assert worst(grown.cameras)[0] < 0.3
    assert set(grown.missing) == {"foreign", "plain"}
    for name in ("foreign", "plain"):
        told = grown.frames[name]
        assert told.status == "cannot be placed" and told.shared == 0
        count = len(tracks.features[tracks.names.index(name)])
        assert "placed photographs" in told.why
        assert f"({count} features, at most 0 of them matched with another photograph)" in told.why
    found = refine(blob(), all_views, grown.cameras, tracks)
    angle, away = worst(found.cameras)
    assert found.status == "converged" and angle < ANGLE_DEG and away < AWAY
    assert max(found.rms_px.values()) < 0.5


def test_a_first_pose_that_is_off_is_pulled_in(all_views: list[View], tracks: Tracks) -> None:
    first = shaken({"p4": true_camera(4)}, 0.5, 0.02)
    assert worst(first)[0] > 0.45
    grown = grow(blob(), all_views, first, tracks)
    found = refine(blob(), all_views, grown.cameras, tracks)
    angle, away = worst(found.cameras)
    assert set(grown.cameras) == set(truth()) and angle < ANGLE_DEG and away < AWAY


def test_names_and_order_do_not_matter(all_views: list[View], tracks: Tracks) -> None:
    """Photographs 2 and 6 have each other's names, in another order: each is found where it was taken."""
    swapped = {"p2": "p6", "p6": "p2"}
    views = [replace(v, file=Path(f"{swapped.get(v.name, v.name)}.png")) for v in all_views][::-1]
    renamed = replace(tracks, names=tuple(swapped.get(n, n) for n in tracks.names))
    grown = grow(blob(), views, {"p0": true_camera(0)}, renamed)
    for name, taken in (("p2", 6), ("p6", 2)):
        assert apart(grown.cameras[name], true_camera(taken), np.zeros(3))[0] < 0.3


def test_a_given_pose_of_another_photograph_is_told(all_views: list[View], tracks: Tracks) -> None:
    posed = {"p0": true_camera(0), "p1": true_camera(1), "p2": true_camera(2), "p3": true_camera(6)}
    grown = grow(blob(), all_views[:5], posed, tracks)
    assert grown.frames["p3"].status == "contradicts"
    # Three that agree move the fourth to where it was taken, 60 degrees off.
    why = grown.frames["p3"].why
    assert "the given pose is 6" in why and "is it another photograph's?" in why and not grown.missing
    assert [grown.frames[f"p{i}"].status for i in range(3)] == ["given"] * 3


def test_random_points_are_no_pose() -> None:
    rng = np.random.default_rng(1)
    view, camera = photograph(1), true_camera(1)
    on = surface_points(blob().meshes[0], 3000)
    x = on.position[points_in_sight(blob(), on, camera)]
    for count, times in ((12, 5), (40, 5), (150, 3), (500, 1)):
        for _ in range(times):
            mine = x[rng.choice(len(x), count)]
            found = resect(blob(), view, rng.permutation(camera.project(mine)[0]), mine)
            assert found.camera is None and ("agree on" in found.why)


@pytest.mark.parametrize("wrong", [0.0, 0.6])
def test_a_pose_is_found_among_wrong_points(wrong: float) -> None:
    rng = np.random.default_rng(2)
    view, camera = photograph(1), true_camera(1)
    on = surface_points(blob().meshes[0], 1000)
    x = on.position[points_in_sight(blob(), on, camera)]
    uv = camera.project(x)[0] + rng.normal(0, 0.3, (len(x), 2))
    off = rng.random(len(x)) < wrong
    uv[off] = rng.permutation(uv[off])
    found = resect(blob(), view, uv, x)
    assert found.camera is not None and found.why == ""
    angle, away = apart(camera, found.camera, np.zeros(3))
    # Some 400 points, or 170, known exactly, to 0.3 px.
    assert angle < 0.15 and away < 0.003
    assert (found.inlier & off).sum() < 0.03 * len(x) and (found.inlier | off).mean() > 0.97


def test_points_behind_the_object_or_in_one_place_are_no_pose() -> None:
    view, camera = photograph(1), true_camera(1)
    on = surface_points(blob().meshes[0], 2000)
    hidden = on.position[~visible(blob(), camera, on.position)][:200]
    behind = resect(blob(), view, camera.project(hidden)[0], hidden)
    assert behind.camera is None and "the rest behind the object" in behind.why
    seen = on.position[points_in_sight(blob(), on, camera)]
    near = seen[0] + 0.25 * (seen[np.argsort(np.linalg.norm(seen - seen[0], axis=1))[:15]] - seen[0])
    noisy = camera.project(near)[0] + np.random.default_rng(0).normal(0, 0.5, (15, 2))
    together = resect(blob(), view, noisy, near)
    assert together.camera is None and "too few or too close together" in together.why
    few = resect(blob(), view, noisy[:8], near[:8])
    assert few.why == "shares 8 points with placed photographs; 12 are needed"
    same = resect(blob(), view, np.repeat(noisy[:1], 20, axis=0), np.repeat(near[:1], 20, axis=0))
    assert same.camera is None


def test_lifts_are_sure_only_away_from_rims() -> None:
    camera = true_camera(1)
    region = photograph(1).region
    assert region is not None
    inside = camera.pixel_centres()[region.ravel()]
    lift = lifted(blob(), camera, inside)
    # Of what is sure, all points are on the mesh and are seen where they were lifted from.
    np.testing.assert_allclose(camera.project(lift.x[lift.sure])[0], inside[lift.sure], atol=2e-3)
    assert 0.85 < lift.sure.mean() < 0.99
    assert (lift.cosine[lift.sure] >= 0.15).all()
    assert not lifted(blob(), camera, np.array([[3.0, 3.0], [-1e6, 0.0]])).sure.any()
    assert visible(blob(), camera, lift.x[lift.sure]).mean() > 0.999


def test_wrong_sightings_do_not_stop_it() -> None:
    tracks = true_tracks(1500, 0.3, wrong=0.3)
    views = [replace(photograph(0), file=Path(f"{name}.png")) for name in truth()]
    grown = grow(blob(), views, {"p3": true_camera(3)}, tracks)
    assert set(grown.cameras) == set(truth()) and worst(grown.cameras)[0] < 0.5
    found = refine(blob(), views, grown.cameras, tracks)
    assert worst(found.cameras)[0] < 0.15


def test_the_mesh_vouches_for_matches_that_pictures_alone_do_not(
    all_views: list[View], tracks: Tracks
) -> None:
    """Photograph 5 without any of its tracks is placed by what looks alike; the mesh finds its matches."""
    keep = tracks.frame != 5
    without = replace(
        tracks,
        track=tracks.track[keep],
        frame=tracks.frame[keep],
        uv_px=tracks.uv_px[keep],
        deviation_px=tracks.deviation_px[keep],
    )
    grown = grow(blob(), all_views[:8], {"p4": true_camera(4)}, without)
    assert set(grown.cameras) == set(truth())
    assert apart(true_camera(5), grown.cameras["p5"], np.zeros(3))[0] < 0.5
    again = rematched(blob(), grown.cameras, without)
    # All that pictures alone have, photograph 5's too, and half as many again.
    assert len(again.track) > 1.5 * len(tracks.track) and (again.frame == 5).sum() > 300
    assert not (again.frame >= 8).any()
    found = refine(blob(), all_views, grown.cameras, again)
    angle, away = worst(found.cameras)
    # Weak features that follow highlights are among them.
    assert angle < 0.15 and away < 0.0025
    assert found.outliers.mean() < 0.02
    bare = replace(tracks, features=())
    assert rematched(blob(), grown.cameras, bare) is bare


def test_what_is_wrong_is_said(all_views: list[View], tracks: Tracks) -> None:
    with pytest.raises(InputError, match="no photograph's pose is known; expected one at least"):
        grow(blob(), all_views, {}, tracks)
    with pytest.raises(InputError, match="there is a pose for 'p9'"):
        grow(blob(), all_views, {"p9": true_camera(0)}, tracks)

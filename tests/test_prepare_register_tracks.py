# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Features where they are, matches of the same spot, and tracks that hold no contradiction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from swatchwork.prepare.registering import Features, View, features, find_tracks, matches
from swatchwork.prepare.registering.lifting import lifted
from swatchwork.prepare.registering.tracks import EDGE_PX, agreeing, joined
from synthetic_photographs import blob, lens, photograph, true_camera


def some(count: int, seed: int = 0) -> Features:
    rng = np.random.default_rng(seed)
    raw = np.abs(rng.normal(size=(count, 128)))
    raw /= np.linalg.norm(raw, axis=1, keepdims=True)
    return Features(
        rng.uniform(0, 400, (count, 2)),
        np.ones(count),
        raw.astype(np.float32),
        np.arange(count, dtype=np.int32),
    )


def test_a_spot_is_found_where_it_is_with_centres_at_a_half() -> None:
    v, u = np.mgrid[:450, :600] + 0.5
    centres = np.array([[100.3, 90.8], [300.0, 200.5], [410.75, 333.1], [222.2, 401.4]])
    gray = np.full((450, 600), 60.0)
    for x, y in centres:
        gray += 150 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 3.0**2))
    found = features(View(Path("a.png"), lens(), (gray + 0.5).astype(np.uint8)))
    for centre in centres:
        # 8 bits over 150 codes; a convention half a pixel or OpenCV's quarter off would show.
        assert np.linalg.norm(found.uv_px - centre, axis=1).min() < 0.05


def test_features_keep_away_from_the_silhouette_and_have_unit_descriptors() -> None:
    view = photograph(1)
    found = features(view)
    assert view.region is not None and len(found) > 800
    inside = distance_transform_edt(view.region)
    u, v = found.uv_px.astype(int).T
    assert inside[v, u].min() >= EDGE_PX - 1
    np.testing.assert_allclose(np.linalg.norm(found.descriptor, axis=1), 1, atol=1e-5)
    assert len(np.unique(found.uv_px, axis=0)) == len(found) and found.place.max() == len(found) - 1


def test_a_dark_object_shows_features_too() -> None:
    view = photograph(1)
    dark = replace(view, gray=(view.gray / 5).astype(np.uint8))
    # A fifth of the codes leaves steps of rounding, not contrast, to lose.
    assert len(features(dark)) > 0.6 * len(features(view))


def test_nothing_is_found_where_nothing_is() -> None:
    flat = View(Path("a.png"), lens(), np.full((450, 600), 90, np.uint8))
    empty = features(flat)
    assert len(empty) == 0 and len(matches(empty, some(5))[0]) == 0
    hidden = features(replace(photograph(1), region=np.zeros((450, 600), bool)))
    assert len(hidden) == 0


def test_matches_are_what_loops_say() -> None:
    a, b = some(40), some(50, 1)
    rng = np.random.default_rng(2)
    shared = a.descriptor[:15] + 0.03 * rng.normal(size=(15, 128)).astype(np.float32)
    b.descriptor[20:35] = shared / np.linalg.norm(shared, axis=1, keepdims=True)
    expected = []
    for i, d in enumerate(a.descriptor):
        away = np.linalg.norm(b.descriptor - d, axis=1)
        j = int(away.argmin())
        back = int(np.linalg.norm(a.descriptor - b.descriptor[j], axis=1).argmin())
        if back == i and away[j] < 0.8 * np.partition(away, 1)[1]:
            expected.append((i, j))
    pairs, ratio = matches(a, b, 0.8)
    assert sorted(map(tuple, pairs.tolist())) == expected and len(expected) >= 15
    assert (np.diff(ratio) >= 0).all()


def test_tracks_follow_the_surface_and_leave_a_foreign_photograph_out() -> None:
    foreign = replace(photograph(2, 5), file=Path("foreign.png"))
    views = [photograph(1), foreign, photograph(2), photograph(3)]
    tracks = find_tracks(views)
    assert tracks.names == ("p1", "foreign", "p2", "p3")
    assert tracks.agreeing[1].max() == 0 and not (tracks.frame == 1).any()
    assert tracks.agreeing[0, 2] > 300 and tracks.agreeing[2, 3] > 200 and len(tracks) > 500
    key = tracks.track.astype(np.int64) * 10 + tracks.frame
    assert (np.diff(key) > 0).all() or len(np.unique(key)) == len(key)
    assert np.bincount(tracks.track).min() >= 2
    # By the true poses, neighbours in a track show the same spot of the mesh.
    places = np.full((len(tracks.track), 3), np.nan)
    for f, number in ((0, 1), (2, 2), (3, 3)):
        rows = np.flatnonzero(tracks.frame == f)
        places[rows] = lifted(blob(), true_camera(number), tracks.uv_px[rows]).x
    same = np.flatnonzero(np.diff(tracks.track) == 0)
    # Two pixels at this distance.
    near = np.linalg.norm(places[same] - places[same + 1], axis=1) < 2 * 2.6 / 620
    assert near.mean() > 0.93


def test_random_matches_share_no_essential_matrix() -> None:
    rng = np.random.default_rng(0)
    view = photograph(1)
    for count in (10, 30, 100, 400):
        a, b = rng.uniform([150, 100], [450, 350], (2, count, 2))
        assert not agreeing(view, view, a, b).any()


def test_a_contradiction_splits_a_track() -> None:
    found = [some(3, i) for i in range(3)]
    links = [
        (0, 1, np.array([[0, 0], [1, 1]]), np.array([0.2, 0.3])),
        (1, 2, np.array([[0, 0]]), np.array([0.25])),
        # It would put places 0 and 1 of the first photograph into one track.
        (0, 2, np.array([[1, 0]]), np.array([0.7])),
    ]
    tracks = joined(("a", "b", "c"), found, links)
    members = {
        tuple(
            sorted(
                zip(tracks.frame[tracks.track == t].tolist(), tracks.uv_px[tracks.track == t, 0], strict=True)
            )
        )
        for t in range(len(tracks))
    }
    at = [f.uv_px[:, 0] for f in found]
    assert members == {((0, at[0][0]), (1, at[1][0]), (2, at[2][0])), ((0, at[0][1]), (1, at[1][1]))}
    assert tracks.agreeing.tolist() == [[0, 2, 1], [2, 0, 1], [1, 1, 0]]


@pytest.mark.parametrize("count", [0, 1])
def test_no_links_are_no_tracks(count: int) -> None:
    tracks = joined(("a",) * count, [some(4)] * count, [])
    assert len(tracks) == 0 and tracks.uv_px.shape == (0, 2)


def test_a_large_photograph_is_searched_at_a_smaller_size() -> None:
    v, u = np.mgrid[:2700, :3600] + 0.5
    centres = np.array([[700.3, 900.8], [2500.0, 1200.5]])
    gray = np.full((2700, 3600), 60.0)
    for x, y in centres:
        gray += 150 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 9.0**2))
    found = features(View(Path("a.png"), lens(6.0), (gray + 0.5).astype(np.uint8)))
    for centre in centres:
        away = np.linalg.norm(found.uv_px - centre, axis=1)
        # Half as large: a few hundredths of its pixel.
        assert away.min() < 0.1
        assert found.deviation_px[away.argmin()] > 0.3

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Poses refined on a fixed mesh: against another solver, from starts that are off, with wrong sightings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering import Tracks, View, apart, moved, refine
from swatchwork.prepare.registering.sighting import Sightings, first_points, pairs_of
from swatchwork.prepare.registering.sliding import Problem, State
from swatchwork.simulate.viewpoints import look_at
from swatchwork.surface import Mesh, RayScene
from synthetic_photographs import blob, lens, shaken, true_camera, true_tracks, truth, worst


def plain_views(names: object) -> list[View]:
    return [View(Path(f"{name}.png"), lens(), np.zeros((450, 600), np.uint8)) for name in names]


VIEWS = plain_views(truth())


@pytest.fixture(scope="module")
def corner() -> tuple[RayScene, dict[str, Camera], Tracks]:
    """Four walls seen by three cameras: each point stays on its wall, which makes a twin easy.

    Three meet in a corner. Were they all, they would look the same at any scale.
    """
    walls = (
        (0, 0.0, (0.0, 1.0), (0.0, 1.0)),
        (1, 0.0, (0.0, 1.5), (0.0, 1.5)),
        (2, 0.0, (0.0, 1.5), (0.0, 1.5)),
        (0, 0.3, (0.0, 1.5), (1.0, 1.8)),
    )
    vertices, normals, faces, x = [], [], [], []
    rng = np.random.default_rng(4)
    for axis, height, low_high, other in walls:
        (a, b), (c, d) = low_high, other
        start = len(vertices)
        vertices += [np.insert(np.array(p), axis, height) for p in ((a, c), (b, c), (b, d), (a, d))]
        normals += [np.eye(3)[axis]] * 4
        faces += [[start, start + 1, start + 2], [start, start + 2, start + 3]]
        inside = rng.uniform([a + 0.15, c + 0.15], [b - 0.15, d - 0.15], (3, 2))
        x.append(np.insert(inside, axis, height, axis=1))
    mesh = Mesh(np.array(vertices), np.array(faces, dtype=np.int32), np.array(normals))
    scene = RayScene([mesh])
    cameras = {}
    for i, position in enumerate(([4.0, 3.2, 2.6], [2.8, 4.1, 3.0], [3.1, 2.7, 4.2])):
        cameras[f"c{i}"] = replace(lens(), world_from_camera=look_at(np.array(position), np.full(3, 0.4)))
    uv = np.stack([c.project(np.concatenate(x))[0] for c in cameras.values()], axis=1) + rng.normal(
        0, 0.4, (12, 3, 2)
    )
    tracks = Tracks(
        tuple(cameras),
        12,
        np.repeat(np.arange(12, dtype=np.int32), 3),
        np.tile(np.arange(3, dtype=np.int32), 12),
        uv.reshape(-1, 2),
        rng.uniform(0.3, 0.6, 36),
        (),
        np.zeros((3, 3), np.int32),
    )
    return scene, cameras, tracks


def test_the_optimum_is_scipys(
    corner: tuple[RayScene, dict[str, Camera], Tracks], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, cameras, tracks = corner
    # To the very bottom, not to a hundredth of a variance.
    monkeypatch.setattr("swatchwork.prepare.registering.bundle.FALL", 1e-9)
    start = shaken(cameras, 0.2, 0.01)
    found = refine(scene, plain_views(cameras), start, tracks)
    assert found.status == "converged"
    names = list(cameras)
    free = np.ones((12, 3), dtype=bool)
    free[np.arange(12), np.repeat([0, 1, 2, 0], 3)] = False
    first = np.nan_to_num(found.points) + np.random.default_rng(1).normal(0, 0.01, (12, 3)) * free

    def residuals(p: np.ndarray) -> np.ndarray:
        x = first.copy()
        x[free] += p[18:]
        out = []
        for i, name in enumerate(names):
            error = (
                moved(start[name], p[6 * i : 6 * i + 6]).project(x)[0] - tracks.uv_px.reshape(12, 3, 2)[:, i]
            )
            size = np.linalg.norm(error, axis=1)
            deviation = tracks.deviation_px.reshape(12, 3)[:, i]
            loss = np.sqrt(np.log1p(size**2 / 1.5**2) * 1.5**2) / deviation
            out.append(error / size[:, None] * loss[:, None])
        return np.concatenate(out).ravel()

    twin = least_squares(residuals, np.zeros(18 + 24), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    # Points come back from Embree's single precision: 1e-7 of the scene, a ten-thousandth of a pixel.
    assert found.history[-1] == pytest.approx(2 * twin.cost, rel=1e-5)
    for i, name in enumerate(names):
        angle, away = apart(found.cameras[name], moved(start[name], twin.x[6 * i : 6 * i + 6]), np.zeros(3))
        assert angle < 0.002 and away < 3e-5


@pytest.mark.parametrize("scan_error", [0.0, 0.01])
def test_slopes_are_what_differences_say(
    corner: tuple[RayScene, dict[str, Camera], Tracks], scan_error: float
) -> None:
    scene, cameras, tracks = corner
    given = shaken(cameras, 0.1, 0.003)
    names = list(given)

    def pulled(_: str, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        return np.array([3.0 * camera.position[0]]), 3.0 * np.array(
            [[0, 0, 0, *camera.world_from_camera[0, :3]]]
        )

    seen = Sightings.of(tracks, names)
    x, normal, sure = first_points(scene, list(given.values()), seen, 1.5)
    assert sure.all()
    problem = Problem(scene, names, seen, (pulled,), scan_error, frozenset(), 1.5, np.ones(3))
    offset = np.full(12, 0.004 if scan_error else 0.0)
    state = State(list(given.values()), x, normal, offset)
    system = problem.linearised(state)
    h = 1e-6
    for f in range(3):
        for i in range(6):
            ends = []
            for sign in (h, -h):
                cameras_ = list(state.cameras)
                cameras_[f] = moved(cameras_[f], sign * np.eye(6)[i])
                ends.append(problem.objective(replace(state, cameras=cameras_)))
            # The objective is a sum of squares: its slope is twice the normal equations' right side.
            assert 2 * system.slope[f, i] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-4, abs=1e-2)
    for i in range(2):
        ends = []
        for sign in (h, -h):
            shifted = state.on_mesh.copy()
            shifted[5] += sign * system.axes[5, :, i]
            ends.append(problem.objective(replace(state, on_mesh=shifted)))
        assert 2 * system.point_slope[5, i] == pytest.approx(
            (ends[0] - ends[1]) / (2 * h), rel=1e-4, abs=1e-2
        )
    if scan_error:
        ends = []
        for sign in (h, -h):
            raised = state.offset.copy()
            raised[5] += sign
            ends.append(problem.objective(replace(state, offset=raised)))
        assert 2 * system.point_slope[5, 2] == pytest.approx(
            (ends[0] - ends[1]) / (2 * h), rel=1e-4, abs=1e-2
        )


def test_the_mesh_pulls_in_a_start_that_is_off() -> None:
    tracks = true_tracks(2000, 0.3)
    start = shaken(truth(), 0.5, 0.02)
    assert worst(start)[0] > 0.45
    found = refine(blob(), VIEWS, start, tracks)
    assert found.status == "converged"
    assert all(np.diff(found.history) < 0)
    angle, away = worst(found.cameras)
    assert angle < 0.1 and away < 0.002
    # 0.3 px along two axes, less what points and poses take up.
    assert 0.2 < np.median(list(found.rms_px.values())) < 0.42
    assert found.outliers.mean() < 0.005


def test_deviations_are_those_of_the_errors() -> None:
    """Errors of poses over the deviations stated: about 1 in the root mean square, over frames and seeds."""
    ratios = []
    for seed in range(4):
        found = refine(blob(), VIEWS, truth(), true_tracks(300, 0.3, seed))
        for name, camera in truth().items():
            error = np.linalg.inv(camera.world_from_camera) @ found.cameras[name].world_from_camera
            ratios.append(error[:3, 3] / found.deviation[name][3:])
    # 96 numbers, of which each capture's 24 move together.
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_thirty_per_cent_wrong_sightings_survive() -> None:
    tracks = true_tracks(2000, 0.3, wrong=0.3)
    found = refine(blob(), VIEWS, shaken(truth(), 0.2, 0.01), tracks)
    angle, away = worst(found.cameras)
    assert angle < 0.12 and away < 0.0025
    # 60 px each way: nine in ten of the wrong are farther than 4.5 px, where another sighting tells.
    assert 0.2 < found.outliers.mean() < 0.32


def test_an_error_of_the_scan_is_allowed_for() -> None:
    bump, off_deg = 0.004, {0.0: [], 0.004: []}
    for seed in range(4):
        tracks = true_tracks(2000, 0.2, seed, bump=bump)
        for scan_error, off in off_deg.items():
            found = refine(blob(), VIEWS, truth(), tracks, scan_error=scan_error)
            off += [apart(c, found.cameras[n], np.zeros(3))[0] for n, c in truth().items()]
            # Residuals and offsets, less what was solved for; a point on the hard mesh has two numbers.
            count, sightings = len(tracks), len(tracks.track)
            free = 2 * sightings - 2 * count - 6 * len(found.cameras)
            if scan_error:
                # 5 % are 2.5 deviations of a chi squared with 5,000 degrees of freedom.
                assert found.history[-1] == pytest.approx(free, rel=0.06)
            else:
                assert found.history[-1] > 5 * free
    assert np.mean(off_deg[bump]) < 0.9 * np.mean(off_deg[0.0])


def test_held_frames_stay_and_further_terms_pull() -> None:
    tracks = true_tracks(200, 0.3)
    start = shaken(truth(), 0.1, 0.005)
    target = true_camera(3).position + 0.1

    def pull(name: str, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        if name != "p3":
            return np.zeros(0), np.zeros((0, 6))
        step = np.zeros((3, 6))
        step[:, 3:] = 1e6 * camera.world_from_camera[:3, :3]
        return 1e6 * (camera.position - target), step

    found = refine(blob(), VIEWS, start, tracks, [pull], held=["p0"])
    np.testing.assert_array_equal(found.cameras["p0"].world_from_camera, start["p0"].world_from_camera)
    assert (found.deviation["p0"] == 0).all()
    np.testing.assert_allclose(found.cameras["p3"].position, target, atol=1e-4)


def test_a_frame_that_sees_nothing_keeps_its_pose() -> None:
    tracks = true_tracks(200, 0.3)
    keep = tracks.frame != 2
    less = replace(
        tracks,
        track=tracks.track[keep],
        frame=tracks.frame[keep],
        uv_px=tracks.uv_px[keep],
        deviation_px=tracks.deviation_px[keep],
    )
    found = refine(blob(), VIEWS, truth(), less)
    assert found.status == "converged"
    np.testing.assert_allclose(found.cameras["p2"].world_from_camera, true_camera(2).world_from_camera)
    assert np.isnan(found.rms_px["p2"]) and np.isinf(found.deviation["p2"]).all()
    assert np.isfinite(found.deviation["p1"]).all()


def test_limits_and_ends_are_said() -> None:
    tracks = true_tracks(200, 0.3)
    start = shaken(truth(), 0.5, 0.02)
    short = refine(blob(), VIEWS, start, tracks, steps=2)
    assert short.status == "iteration limit" and len(short.history) == 3
    good = refine(blob(), VIEWS, start, tracks)
    again = refine(blob(), VIEWS, good.cameras, tracks)
    assert again.status == "converged" and len(again.history) < 10
    empty = refine(blob(), VIEWS, {}, tracks)
    assert empty.status == "converged" and not empty.cameras


def test_a_slope_that_lies_is_no_progress() -> None:
    def lying(_: str, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        step = np.zeros((1, 6))
        step[0, 3:] = -1e5 * camera.world_from_camera[0, :3]
        return np.array([1e5 * (camera.position[0] + 10)]), step

    found = refine(blob(), VIEWS, truth(), true_tracks(50, 0.3), [lying])
    assert found.status == "no progress" and len(found.history) == 1
    assert worst(found.cameras) == (pytest.approx(0, abs=1e-6), 0)


def test_what_is_wrong_is_said() -> None:
    tracks = true_tracks(50, 0.3)
    with pytest.raises(InputError, match="there is a pose for 'x'; expected the name of one"):
        refine(blob(), VIEWS, {"x": true_camera(0)}, tracks)
    with pytest.raises(InputError, match="the scan's error is -1; expected zero or more"):
        refine(blob(), VIEWS, truth(), tracks, scan_error=-1.0)


def test_pairs_of_a_track() -> None:
    one, other = pairs_of(np.array([0, 0, 0, 1, 2, 2]))
    expected = [(i, j) for i in range(3) for j in range(3) if i != j] + [(4, 5), (5, 4)]
    assert sorted(zip(one.tolist(), other.tolist(), strict=True)) == expected

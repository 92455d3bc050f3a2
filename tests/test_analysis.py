# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Conditioning, next best views and confidence, each against a slow plain twin."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

from swatchwork.analysis import (
    Directions,
    Views,
    condition_numbers,
    conditioning,
    next_best_views,
    prior_of,
    uniform_views,
)
from swatchwork.analysis.confidence import HELD_OUT_TEXELS
from swatchwork.arrays import fibonacci_sphere
from swatchwork.capture import read_capture
from swatchwork.cli import main
from swatchwork.errors import InputError
from swatchwork.light import read_environment
from swatchwork.material import expected_error, material_maps, neighbourhood_of_windows, read_material
from swatchwork.material.trust import neighbourhood
from swatchwork.observe import Lights
from swatchwork.reconstruct import ReconstructOptions
from swatchwork.reflectance import paper
from swatchwork.response import generic_responses, representative_responses
from swatchwork.simulate import (
    SyntheticCapture,
    camera_towards,
    dense_weights,
    procedural_environment,
    random_directions,
    shape,
    simulate_capture,
)
from swatchwork.solve import SolveOptions
from swatchwork.surface import (
    RayScene,
    build_atlas,
    points_in_sight,
    sees,
    sky_masks,
    sky_of_points,
    surface_points,
)
from swatchwork.workflow.recovery import recover

LIGHT = procedural_environment("room", 0, height=32)


def views_of(name: str, directions: np.ndarray, count: int = 60) -> Views:
    mesh = shape(name, 24)
    radius = float(np.linalg.norm(mesh.vertices, axis=1).max())
    cameras = [camera_towards(d, 64, radius) for d in directions]
    return Views.of(RayScene([mesh]), surface_points(mesh, count), cameras, LIGHT)


def test_points_are_spread_by_area_and_seen_as_texels_are() -> None:
    mesh = shape("knot", 24)
    scene, points = RayScene([mesh]), surface_points(mesh, 4000)
    area = np.linalg.norm(mesh.crosses, axis=1)
    share = np.bincount(points.face, minlength=len(area)) / 4000
    # A random point of each equal share: no run of triangles is off by more than two points.
    assert np.abs(np.cumsum(share) - np.cumsum(area) / area.sum()).max() < 2 / 4000
    camera = camera_towards(np.array([1.0, 0.2, 0.3]), 128, 1.0)
    atlas = build_atlas(mesh, 96)
    by_texel, by_point = sees(scene, atlas, camera), points_in_sight(scene, points, camera)
    footprint = atlas.footprint(slice(None))
    # 4000 points: the share's standard deviation is below 0.8 %.
    assert by_point.mean() == pytest.approx((by_texel * footprint).sum() / footprint.sum(), abs=0.02)
    # The sky that a point sees is that of the texel beside it.
    masks, own = sky_masks(scene, atlas, 4000), sky_of_points(scene, points)
    shadowed = ((masks.of_texel >= 0) * footprint).sum() / footprint.sum()
    # Shared masks hide a little at more texels than own ones do.
    assert (own.of_texel >= 0).mean() == pytest.approx(shadowed, abs=0.05)


def test_conditioning_is_that_of_the_explicit_matrices() -> None:
    views = views_of("blob", random_directions(6, 1))
    found = conditioning(views, paper(), [2, 6], noise=0.01, blended=4)
    for c, k in enumerate((2, 6)):
        rows = []
        for m in range(len(views.points)):
            seen = np.flatnonzero(views.seen[m, :k])
            n = np.repeat(views.points.normal[m : m + 1], len(seen), axis=0)
            o = views.viewer[seen] - views.points.position[m]
            o /= np.linalg.norm(o, axis=1, keepdims=True)
            row = views.sky.of_texel[np.full(len(seen), m)]
            matrix = (
                generic_responses(
                    paper(), LIGHT.pyramid(), n, o.astype(np.float32), views.sky.words, row
                ).mean(axis=2)
                if len(seen)
                else np.zeros((0, paper().kernels))
            )
            rows.append(matrix)
            singular = np.zeros(6)
            singular[: len(seen)] = np.linalg.svd(matrix.astype(np.float64), compute_uv=False)[:6]
            # Gram matrices hold squares: 1e-7 of the largest is what is left of a double.
            np.testing.assert_allclose(found.blend[c, m], singular, atol=1e-6 * max(singular[0], 1e-30))
            assert found.ranks[c, m] == np.count_nonzero(
                singular > 0.01 * singular[0] / max(len(seen), 1) ** 0.5
            )
            expected = singular[0] / singular[2] if singular[2] > 1e-6 * singular[0] else np.inf
            assert found.conditions[c, m] == pytest.approx(expected, rel=1e-3)
        whole = np.linalg.svd(np.concatenate(rows).astype(np.float64), compute_uv=False)
        top = found.representative[c] / found.representative[c, 0]
        # Fewer rows than kernels leave the rest at zero.
        padded = np.zeros(len(top))
        padded[: len(whole)] = whole
        np.testing.assert_allclose(top, padded / whole[0], atol=1e-6)
        assert found.representative_ranks[c] == np.count_nonzero(
            whole > 0.01 * whole[0] / sum(map(len, rows)) ** 0.5
        )
        # With p times the root mean square of noise, least squares has this covariance.
        m = int(np.argmax(found.views[c]))
        matrix = rows[m].astype(np.float64)
        if len(matrix) >= 3:
            sigma = 0.01 * np.linalg.svd(matrix, compute_uv=False)[0] / len(matrix) ** 0.5
            third = np.sqrt(np.sort(np.linalg.eigvalsh(np.linalg.pinv(matrix.T @ matrix)))[-len(matrix) :])[
                ::-1
            ]
            assert found.weight_errors[c, m] == pytest.approx(sigma * third[len(matrix) - 3], rel=1e-2)


def test_condition_numbers_where_there_are_none() -> None:
    assert condition_numbers(np.array([[4.0, 2.0]]), 4)[0] == np.inf
    assert condition_numbers(np.array([[0.0, 0.0, 0.0]]), 4)[0] == np.inf
    np.testing.assert_allclose(condition_numbers(np.array([[4.0, 2.0, 1.0]]), 4), [4.0])
    np.testing.assert_allclose(condition_numbers(np.array([[4.0, 2.0, 1.0]]), 2), [1.0])


def test_directional_light_lights_what_faces_it() -> None:
    views = views_of("sphere", random_directions(3, 2))
    lights = Directions(random_directions(3, 5))
    views = replace(views, lights=lights)
    point, view = views.pairs(slice(0, len(views.points)))
    found = views.responses(paper(), point, view)
    cosine = np.einsum("px,px->p", views.points.normal[point], lights.of_view[view])
    assert (found[cosine <= 0.03] == 0).all()
    # Lambert: pi / pi times the cosine.
    np.testing.assert_allclose(found[cosine > 0.03, -1], cosine[cosine > 0.03], rtol=1e-5)


@pytest.mark.parametrize("criterion", ["A", "D"])
def test_next_best_view_is_the_best_of_all_by_brute_force(criterion: str) -> None:
    views = views_of("knot", fibonacci_sphere(12), 40)
    prior = prior_of(views, paper())
    plan = next_best_views(prior, 2, criterion=criterion, sigma=0.5)  # type: ignore[arg-type]

    def value(chosen: list[int]) -> float:
        """Variance left, or minus the log determinant, by dense inverses."""
        total = 0.0
        for m in range(len(prior.seen)):
            taken = [v for v in chosen if prior.seen[m, v]]
            K = prior.correlation[m].astype(np.float64)
            noise = np.diag(0.25 / prior.cosine[m, taken].astype(np.float64))
            known = K[np.ix_(taken, taken)] + noise
            if criterion == "D":
                ratio = np.linalg.solve(noise, K[np.ix_(taken, taken)])
                total -= np.linalg.slogdet(np.eye(len(taken)) + ratio)[1]
                continue
            left = K - K[:, taken] @ np.linalg.solve(known, K[taken]) if taken else K
            total += float((np.diag(left) * prior.cosine[m]).sum())
        return total

    first = min(range(12), key=lambda v: value([v]))
    assert plan.chosen[0] == first
    second = min((v for v in range(12) if v != first), key=lambda v: value([first, v]))
    assert plan.chosen[1] == second
    if criterion == "A":
        left = [value(list(plan.chosen[:i])) / value([]) for i in range(3)]
        np.testing.assert_allclose(plan.left, left, rtol=1e-4)


def test_a_plan_goes_on_from_views_at_hand_and_stops_when_told() -> None:
    views = views_of("blob", fibonacci_sphere(40), 80)
    prior = prior_of(views, paper())
    whole = next_best_views(prior, 6)
    after = next_best_views(prior, 3, have=whole.chosen[:3])
    assert after.chosen == whole.chosen[3:]
    np.testing.assert_allclose(after.left, whole.left[3:], rtol=1e-4)
    assert not set(next_best_views(prior, 4, candidates=range(10)).chosen) - set(range(10))
    assert whole.coverage[-1] >= whole.coverage[1] and (np.diff(whole.left) < 0).all()
    wanted = float(next_best_views(prior, 12).condition[-1])
    stopped = next_best_views(prior, 40, enough=wanted)
    # It stops long before all candidates are taken, and not before it is there.
    assert stopped.condition[-1] <= wanted < stopped.condition[-2] and len(stopped.chosen) <= 20
    assert (np.diff(stopped.left) < 0).all()
    # Planned views leave less unknown than the same number of random ones.
    rng = np.random.default_rng(0)
    left = [next_best_views(prior, 0, have=rng.permutation(40)[:6]).left[0] for _ in range(10)]
    assert next_best_views(prior, 0, have=whole.chosen).left[0] < min(left)


def test_uniform_views_are_far_apart() -> None:
    directions = fibonacci_sphere(200)
    chosen = directions[uniform_views(directions, 6)]
    nearest = (chosen @ chosen.T - 2 * np.eye(6)).max(axis=1)
    # Six directions along the axes are 90 degrees apart; greedily found ones nearly so.
    assert np.degrees(np.arccos(nearest)).min() > 60


def test_neighbourhoods_by_image_and_by_window_agree() -> None:
    rng = np.random.default_rng(3)
    look = rng.random((7, 9, 4)).astype(np.float32)
    residual = rng.random((7, 9)).astype(np.float32)
    coverage = rng.integers(-1, 4, (7, 9)).astype(np.int32)
    around, change = neighbourhood(look, residual, coverage)
    inner = [(y, x) for y in range(1, 6) for x in range(1, 8)]

    def windows(image: np.ndarray) -> np.ndarray:
        return np.stack([image[y - 1 : y + 2, x - 1 : x + 2] for y, x in inner])

    a, c = neighbourhood_of_windows(
        windows(look).astype(np.float64), windows(residual).astype(np.float64), windows(coverage)
    )
    np.testing.assert_allclose(a, [around[y, x] for y, x in inner], rtol=1e-6)
    np.testing.assert_allclose(c, [change[y, x] for y, x in inner], rtol=1e-5)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> SyntheticCapture:
    folder = tmp_path_factory.mktemp("confidence") / "capture"
    return simulate_capture(
        folder, object_shape="blob", rows=32, k=5, test_views=1, size=96, truth="ggx", noise_percent=2.0
    )


def test_expected_errors_rank_held_out_errors_and_are_kept(small: SyntheticCapture, tmp_path: Path) -> None:
    solve = SolveOptions(max_N=4, max_n=2)
    options = ReconstructOptions(resolution=64, texels=600, solve=solve)
    found = recover(small.folder, tmp_path / "material", options)
    trust = found.material.trust
    assert trust is not None and 0 < trust.held_out <= 2 * HELD_OUT_TEXELS
    # 2 % of noise on hundreds of texels: a representative is known to some percent.
    spread = found.material.spread
    assert spread is not None and (spread > 1e-4).all() and (spread < 0.3).all()
    back = read_material(tmp_path / "material")
    maps, again = material_maps(found.material), material_maps(back)
    np.testing.assert_array_equal(maps.expected_error, again.expected_error)
    np.testing.assert_array_equal(expected_error(back, 3), maps.expected_error[::3, ::3])
    coverage = found.material.coverage
    assert (maps.confidence[coverage <= 0] == 0).all() and (maps.expected_error[coverage > 0] > 0).all()
    assert (maps.expected_error[coverage == 0] == 1).all() and (maps.expected_error[coverage < 0] == 0).all()
    # Against the truth, which the learning never saw: responses under the novel light along the normals.
    atlas = found.reconstruction.observations.atlas
    texel = np.flatnonzero(found.reconstruction.observations.coverage)
    position, normal = atlas.points(texel)
    light = read_capture(small.folder / "test").environment
    assert light is not None
    pyramid = read_environment(light).pyramid()
    weights = dense_weights(*small.blend(position), len(small.representatives))
    true = np.einsum(
        "pnc,pn->pc",
        representative_responses(small.basis, small.representatives, pyramid, normal, normal),
        weights,
    )
    m = found.material
    pixel = atlas.pixel[texel]
    own = dense_weights(m.index.reshape(-1, m.n)[pixel], m.weight.reshape(-1, m.n)[pixel], m.N)
    made = representative_responses(found.reconstruction.basis, m.representatives, pyramid, normal, normal)
    error = np.linalg.norm(np.einsum("pnc,pn->pc", made, own) - true, axis=1) / np.linalg.norm(true, axis=1)
    views = found.reconstruction.observations.coverage[texel].astype(float)
    ours = spearmanr(maps.expected_error.ravel()[pixel], error).statistic
    # One direction and one light are a noisy judge; docs/validation.md has the correlation over many.
    assert ours > 0.15 and ours > spearmanr(1 / views, error).statistic


def test_one_photograph_has_no_error_model(small: SyntheticCapture, tmp_path: Path) -> None:
    options = ReconstructOptions(resolution=48, texels=300, solve=SolveOptions(max_N=2, max_n=1))
    material = recover(small.folder, tmp_path / "one", options, views=1).material
    assert material.trust is None and read_material(tmp_path / "one").trust is None
    # Nothing was held out, so nothing is known of the error; of the representatives something is.
    maps = material_maps(material)
    assert (maps.confidence == 0).all() and (maps.expected_error[material.coverage >= 0] == 1).all()
    assert material.spread is not None and (material.spread > 0).all()


def test_a_damaged_error_model_is_named(small: SyntheticCapture, tmp_path: Path) -> None:
    options = ReconstructOptions(resolution=48, texels=300, solve=SolveOptions(max_N=2, max_n=2))
    recover(small.folder, tmp_path / "m", options)
    file = tmp_path / "m" / "svbrdf.json"
    head = json.loads(file.read_text(encoding="utf-8"))
    head["trust"]["coefficients"].pop()
    file.write_text(json.dumps(head), encoding="utf-8")
    with pytest.raises(InputError, match="coefficients"):
        read_material(tmp_path / "m")


def test_plan_and_analyze_from_the_command_line(
    small: SyntheticCapture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at, page = tmp_path / "plan", tmp_path / "analysis.html"
    have = str(small.folder / "transforms.json")
    assert main(["plan", "--have", have, "--views", "2", "--candidates", "30", "-o", str(at), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["have"] == 5 and found["views"] == 2 and found["left"][-1] < found["left"][0]
    planned = read_capture(at / "transforms.json", require_images=False)
    taken = read_capture(small.folder).frames[0].camera
    assert len(planned.frames) == 2 and planned.frames[0].camera.fx == pytest.approx(taken.fx)
    distance = np.linalg.norm(planned.frames[0].camera.position)
    assert distance == pytest.approx(np.linalg.norm(taken.position), rel=0.1)
    assert "<svg" in (at / "plan.html").read_text(encoding="utf-8")
    # A plan can be analysed, and planned on into the same folder; photographs are never overwritten.
    assert main(["analyze", str(at), "--json"]) == 0
    capsys.readouterr()
    arguments = ["--views", "1", "--candidates", "30", "-q"]
    assert main(["plan", "--have", have, *arguments, "-o", str(at)]) == 0
    before = (small.folder / "transforms.json").read_bytes()
    assert main(["plan", "--have", have, *arguments, "-o", str(small.folder)]) == 2
    assert "not a plan" in capsys.readouterr().err
    assert (small.folder / "transforms.json").read_bytes() == before
    assert main(["analyze", str(small.folder), "-o", str(page), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [r["k"] for r in rows] == [1, 2, 3, 4, 5]
    assert rows[-1]["representative_rank"] >= rows[0]["representative_rank"]
    assert "Representatives" in page.read_text(encoding="utf-8")
    probe = str(small.folder / "env.exr")
    arguments = ["--shape", "cap", "--environment", probe, "--convention", "blender", "--rotations", "2"]
    assert main(["analyze", *arguments, "--views", "3", "--json"]) == 0
    lights = json.loads(capsys.readouterr().out)["lights"]
    assert len(lights) == 2 and lights[0]["light"] != lights[1]["light"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["plan", "-o", "OUT", "--views", "3"], "no object is given"),
        (["plan", "-o", "OUT", "--shape", "cube", "--views", "3"], "no shape 'cube'"),
        (["plan", "-o", "OUT", "--shape", "sphere", "--views", "3"], "no light is given"),
        (["plan", "-o", "OUT", "--shape", "sphere"], "--views COUNT"),
        (["plan", "-o", "OUT", "--shape", "sphere", "--views", "3", "--lowest", "95"], "--lowest is 95"),
        (["analyze", "--shape", "sphere"], "no light is given"),
        (["analyze", "--shape", "sphere", "--directional", "--noise", "2"], "--noise is 2"),
        (["analyze", "--shape", "sphere", "--directional", "--arrangement", "planned"], "planned views"),
        (["analyze"], "no object is given"),
        (["analyze", "--shape", "sphere", "--mesh", "a.obj"], "--mesh and --shape"),
        (["analyze", "--shape", "sphere", "--directional", "--rotations", "2"], "--rotations"),
        (["analyze", "a", "--shape", "sphere", "--directional"], "a capture and an object"),
    ],
)
def test_what_is_missing_is_said(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main([str(out) if a == "OUT" else a for a in arguments]) == 2
    assert said in capsys.readouterr().err and not out.exists()


def test_lights_turn_with_the_frames() -> None:
    """A light that is turned and a surface that is turned back are the same to every response."""
    views = views_of("sphere", random_directions(3, 4))
    angle = np.radians(50)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    lights = Lights((LIGHT,), np.zeros(3, np.int32), np.broadcast_to(turn, (3, 3, 3)).copy())
    turned = replace(views, lights=lights)
    rotated = replace(views, lights=Lights((LIGHT.rotated(turn),), np.zeros(3, np.int32), views.lights.turn))  # type: ignore[union-attr]
    pairs = views.pairs(slice(0, len(views.points)))
    a, b = turned.responses(paper(), *pairs), rotated.responses(paper(), *pairs)
    # The rotated light is resampled into its own pyramid: 2 % of the mean covers it.
    assert np.abs(a - b).mean() < 0.02 * np.abs(a).mean()

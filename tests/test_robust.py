# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Outliers are found and left out, noise is estimated and heeded, and clean data gives the plain answer."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.capture import Photograph, read_capture
from swatchwork.cli import main
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.material import read_material
from swatchwork.observe import NoiseModel, noise_shares
from swatchwork.observe.noise import fitted_noise, noise_levels
from swatchwork.simulate import SyntheticProblem, simulate_capture, spoil_capture, spoiled, two_of_four
from swatchwork.solve import (
    Outliers,
    Problem,
    Solution,
    SolveOptions,
    Trimmed,
    resume_robustly,
    robust,
    settled_blend,
    solve,
    solve_robustly,
    sparse_blend,
    trimmed_blend,
)
from swatchwork.solve.robust import FAR, MOST_OF_THEM, SOME_FAR, far_off
from swatchwork.solve.trimming import BOUND, expected, medians
from swatchwork.streaming import only
from swatchwork.workflow import ReconstructOptions, reconstruct_folder

FAST = SolveOptions(n=2, N=3, tolerance=0.02, max_alternations=40)


@pytest.fixture(scope="module")
def sphere() -> SyntheticProblem:
    return two_of_four(10, 1, texels=500, materials=3, noise_percent=1.0)


def with_outliers(made: SyntheticProblem, share: float) -> tuple[Problem, np.ndarray]:
    """A problem with a share of its measurements replaced, half by another colour, half by spikes."""
    rng = np.random.default_rng(5)
    out = rng.random(len(made.radiance)) < share
    colour = rng.dirichlet([0.5, 0.5, 0.5], len(out)) * 3 * np.median(made.radiance)
    spikes = np.repeat(rng.uniform(5, 15, (len(out), 1)) * np.median(made.radiance), 3, axis=1)
    wrong = np.where(rng.random((len(out), 1)) < 0.5, colour, spikes)
    radiance = np.where(out[:, None], wrong, made.radiance).astype(np.float32)
    return Problem(made.responses, radiance, made.offsets), out


def novel(made: SyntheticProblem, found: Solution) -> float:
    every = np.broadcast_to(np.arange(found.N, dtype=np.uint32), found.weights.shape)
    return made.novel(found.representatives, every, found.weights)


# ---- clean data ----------------------------------------------------------------------------------
@pytest.mark.parametrize("noise", [0.0, 4.0])
def test_clean_data_gives_the_plain_answer(noise: float) -> None:
    made = two_of_four(6, 2, texels=300, materials=3, noise_percent=noise)
    problem = Problem(made.responses, made.radiance, made.offsets)
    plain, robust = solve(problem, FAST), solve_robustly(problem, FAST)
    assert robust.outliers is None
    np.testing.assert_array_equal(robust.representatives, plain.representatives)
    np.testing.assert_array_equal(robust.weights, plain.weights)


def test_much_noise_is_looked_into_and_is_no_outliers() -> None:
    made = two_of_four(6, 2, texels=300, materials=3, noise_percent=12.0)
    problem = Problem(made.responses, made.radiance, made.offsets)
    plain = solve(problem, FAST)
    # Above what is taken for granted, so that the robust start runs; it finds nothing far off.
    assert plain.noise > 0.06
    robust = solve_robustly(problem, FAST)
    assert robust.outliers is None
    np.testing.assert_array_equal(robust.representatives, plain.representatives)


@pytest.mark.parametrize(("n", "N"), [(1, 1), (1, 2), (2, 2)])
def test_too_few_materials_are_no_outliers(n: int, N: int) -> None:
    made = two_of_four(12, 2, texels=200, materials=3, noise_percent=0.5, blended=1, sharp=True)
    problem = Problem(made.responses, made.radiance, made.offsets)
    options = replace(FAST, n=n, N=N)
    plain, found = solve(problem, options), solve_robustly(problem, options)
    assert found.outliers is None
    np.testing.assert_array_equal(found.representatives, plain.representatives)


def test_a_material_that_no_representative_explains_is_no_outlier() -> None:
    made = two_of_four(20, 2, texels=300, materials=2, noise_percent=0.5, blended=1, sharp=True)
    problem = Problem(made.responses, made.radiance, made.offsets)
    material = made.truth_index[:, 0]
    texels = material == 0
    texels[np.flatnonzero(~texels)[: texels.sum() // 4]] = True
    part, other = problem.part(np.ones(len(problem.radiance), dtype=bool), texels), material[texels] != 0
    one = part.fold(made.truth_representatives[:1])
    found = settled_blend(one, part.radiance, part.offsets, 1)
    far = found.deviation > FAR * found.settled
    # A fifth of the texels is far off, most of what is beyond the bound: but in all of their views.
    assert far.mean() > SOME_FAR and far.mean() > MOST_OF_THEM * (~found.kept).mean()
    assert not found.agreed[other].any()
    assert not far_off(found, part.offsets)
    # The same with one view in five of the first material replaced.
    radiance = part.radiance.copy()
    radiance[::5] = 20 * np.median(radiance)
    found = settled_blend(one, radiance, part.offsets, 1)
    assert far_off(found, part.offsets)


# ---- outliers ------------------------------------------------------------------------------------
def test_outliers_are_found_and_left_out(sphere: SyntheticProblem) -> None:
    clean = Problem(sphere.responses, sphere.radiance, sphere.offsets)
    problem, out = with_outliers(sphere, 0.2)
    best, plain, robust = solve(clean, FAST), solve(problem, FAST), solve_robustly(problem, FAST)
    assert robust.outliers is not None and plain.outliers is None
    assert robust.outliers.left_out == pytest.approx(out.mean(), abs=0.03)
    trimmed = trimmed_blend(
        problem.fold(robust.representatives), problem.radiance, problem.offsets, 2, robust.outliers.scale
    )
    # Where a majority agrees: of two views none can be outvoted. Colours may be near the truth by chance, and
    # fits of clean data have 2 to 5 % beyond the bound (trimming.py).
    told = np.repeat(trimmed.agreed, np.diff(problem.offsets))
    flagged, out = ~trimmed.kept & told, out & told
    assert (flagged & out).sum() > 0.9 * out.sum()
    assert (flagged & ~out).sum() < 0.05 * (told & ~out).sum()
    # Representatives and blends of texels that were decided; what undecided ones take is the atlas' matter.
    seen = ~np.isnan(robust.relative_error)
    # Of 3.6 views a texel, three have to agree.
    assert seen.mean() > 0.4
    weights = np.where(seen[:, None], robust.weights, robust.weights[seen].mean(axis=0))
    truth = np.where(seen[:, None], best.weights, best.weights[seen].mean(axis=0))
    assert novel(sphere, replace(robust, weights=weights)) < 1.5 * novel(sphere, replace(best, weights=truth))
    assert novel(sphere, plain) > 3 * novel(sphere, robust)


def test_trimmed_blend_is_the_best_of_all_pairs_of_views() -> None:
    """The obvious twin: every pair of views of a texel fitted by itself, the cut-off sums compared."""
    rng = np.random.default_rng(3)
    M, k, N, scale = 12, 5, 4, 0.02
    responses = rng.uniform(0.2, 1, (M * k, N, 3)).astype(np.float32)
    weights = rng.dirichlet([1, 1], M)
    radiance = np.einsum("pn,pnc->pc", np.repeat(weights, k, axis=0), responses[:, :2])
    radiance *= 1 + scale * rng.normal(size=radiance.shape)
    out = np.zeros((M, k), dtype=bool)
    out[:, :2] = rng.random((M, 2)) < 0.7
    radiance[out.ravel()] *= rng.uniform(2, 6, (int(out.sum()), 3))
    radiance = radiance.astype(np.float32)
    offsets = np.arange(M + 1) * k
    found = trimmed_blend(responses, radiance, offsets, 2, scale)
    size = expected(radiance, offsets)
    for x in range(M):
        rows = slice(offsets[x], offsets[x + 1])
        s, m = responses[rows], radiance[rows]
        best = np.inf
        for pair in combinations(range(k), 2):
            one = sparse_blend(s[list(pair)], m[list(pair)], np.array([0, 2]), 2).dense(N)[0]
            u = np.sqrt(((np.einsum("n,knc->kc", one, s) - m) ** 2).sum(axis=1)) / (scale * size[rows])
            cost = float(np.minimum(u, BOUND).__pow__(2).sum())
            if cost < best:
                best, kept = cost, u <= BOUND
        # Refits may bring back a view at the bound; none of these is near it.
        np.testing.assert_array_equal(found.kept[rows], kept)
        np.testing.assert_array_equal(found.kept[rows], ~out[x])
    np.testing.assert_allclose(found.blend.dense(N)[:, 0], weights[:, 0], atol=0.1)


def test_blends_do_not_depend_on_the_tiling() -> None:
    made = two_of_four(30, 4, texels=120, materials=3, noise_percent=1.0)
    problem, _ = with_outliers(made, 0.2)
    responses = problem.fold(made.truth_representatives)
    usual = float(np.median((problem.radiance.astype(np.float64) ** 2).sum(axis=1)))

    def blends(first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
        rows = slice(problem.offsets[first], problem.offsets[last])
        offsets = problem.offsets[first : last + 1] - problem.offsets[first]
        found = trimmed_blend(responses[rows], problem.radiance[rows], offsets, 2, 0.02, usual=usual)
        return found.kept, found.blend.dense(3)

    views = np.diff(problem.offsets)
    # More pairs of views than are tried, so that they are drawn, and of several counts.
    assert (views > 6).any() and len(np.unique(views)) > 2
    whole = blends(0, problem.texels)
    cuts = [0, 1, 2, 40, 97, problem.texels]
    parts = [blends(a, b) for a, b in pairwise(cuts)]
    for of_whole, of_parts in zip(whole, zip(*parts, strict=True), strict=True):
        np.testing.assert_array_equal(of_whole, np.concatenate(of_parts))


def test_a_texel_that_agrees_with_nothing_ends_the_robust_fit(
    sphere: SyntheticProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, _ = with_outliers(sphere, 0.2)
    options = replace(FAST, max_alternations=5)
    solution = solve_robustly(problem, options)
    assert solution.outliers is not None

    def nobody(*given: Any) -> Trimmed:
        found = decided(*given)
        return replace(found, agreed=np.zeros(problem.texels, dtype=bool))

    decided = robust._trimmed
    monkeypatch.setattr(robust, "_trimmed", nobody)
    kept = resume_robustly(problem, solution, options)
    np.testing.assert_array_equal(kept.representatives, solution.representatives)
    assert np.isnan(kept.relative_error).all()
    # The first vote is that on the start, those of the loop come after.
    votes = iter([decided, nobody])

    def voted(*given: Any) -> Trimmed:
        return next(votes)(*given)

    monkeypatch.setattr(robust, "_trimmed", voted)
    plain = solve_robustly(problem, options)
    assert plain.outliers is None
    np.testing.assert_array_equal(plain.representatives, solve(problem, options).representatives)


def test_medians_are_lower_medians() -> None:
    values = np.array([3.0, 1, 2, 9, 7, 5])
    np.testing.assert_array_equal(medians(values, np.array([0, 3, 5, 6])), [2, 7, 5])


def test_solution_keeps_what_was_left_out() -> None:
    class Kept:
        def __init__(self, arrays: dict) -> None:
            self.arrays = arrays

        def rows(self, name: str, first: int = 0, last: int | None = None) -> np.ndarray:
            return self.arrays[name][first:last]

    one = np.ones((1, 1))
    given = Solution(one[..., None], one, one[0], 1, 1, 0.1, 0.2, 0.0, 0.0, 0.01, "converged", [])
    assert Solution.of(Kept(given.arrays())).outliers is None
    outliers = Outliers(0.01, 0.2, 0.1)
    assert Solution.of(Kept(replace(given, outliers=outliers).arrays())).outliers == outliers


# ---- noise ---------------------------------------------------------------------------------------
def noisy_photograph(read: float, gain: float, seed: int) -> Photograph:
    """A smooth ball on nothing, with noise, an edge and a patch of texture."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-1:1:200j, -1:1:200j]
    height = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    radiance = (0.1 + height * (0.5 + 0.4 * x))[..., None] * [1.0, 0.7, 0.4]
    radiance[60:90] *= 0.5
    radiance[120:150, 60:120] *= rng.uniform(0.5, 1, (30, 60, 1))
    radiance += np.sqrt(read**2 + gain * radiance) * rng.normal(size=radiance.shape)
    on = x**2 + y**2 < 0.95
    return Photograph(radiance.astype(np.float32) * on[..., None], on.astype(np.float32), on)


@pytest.mark.parametrize(("read", "gain"), [(0.01, 0.0), (0.0, 2e-4), (0.01, 5e-4)])
def test_noise_is_estimated_from_photographs(read: float, gain: float) -> None:
    levels = [noise_levels(noisy_photograph(read, gain, seed)) for seed in range(4)]
    found = fitted_noise(levels)
    assert found is not None
    for radiance in (0.1, 0.3, 0.8):
        true = float(NoiseModel(read, gain).variance(np.array(radiance)))
        # 10 % of the deviation, from some hundred patches a level and the split of the variance into three.
        assert float(found.variance(np.array(radiance))) == pytest.approx(true, rel=0.25), radiance


def test_noise_of_nothing_is_unknown() -> None:
    black = Photograph(
        np.zeros((40, 40, 3), np.float32), np.ones((40, 40), np.float32), np.ones((40, 40), bool)
    )
    assert fitted_noise([noise_levels(black)]) is None
    tiny = Photograph(np.ones((5, 5, 3), np.float32), np.ones((5, 5), np.float32), np.ones((5, 5), bool))
    assert len(noise_levels(tiny)) == 0


def test_noisy_texels_count_less_and_clean_ones_in_full() -> None:
    radiance = np.repeat([[1.0] * 3, [0.1] * 3], 40, axis=0).astype(np.float32)
    offsets = np.arange(0, 81, 4)
    np.testing.assert_array_equal(noise_shares(NoiseModel(0.001, 0.0), radiance, offsets), 1.0)
    share = noise_shares(NoiseModel(0.03, 0.0), radiance, offsets)
    np.testing.assert_array_equal(share[:10], 1.0)
    # 30 % a pixel, 20 % a sample between four of them: 5 % over 20 %, squared.
    np.testing.assert_allclose(share[10:], 1 / 16, rtol=1e-5)


def test_noise_has_to_be_a_number() -> None:
    with pytest.raises(InputError, match="read = -1"):
        NoiseModel(-1.0, 0.0)
    with pytest.raises(InputError, match="gain = nan"):
        NoiseModel(0.0, float("nan"))


@pytest.mark.parametrize("off", [["--no-robust"], ["--search-order", "paper"]])
def test_noise_that_nobody_heeds_is_refused(
    off: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["reconstruct", str(tmp_path), "-o", str(tmp_path / "m"), "--noise", "0.01,0", *off]) == 2
    assert "--noise is '0.01,0'" in capsys.readouterr().err


def test_noise_that_nobody_heeds_is_refused_from_python_too() -> None:
    with pytest.raises(InputError, match=r"--noise is '0\.01,0' with --no-robust"):
        ReconstructOptions(solve=SolveOptions(robust=False), noise=NoiseModel(0.01, 0.0))


# ---- captures ------------------------------------------------------------------------------------
def test_spoiled_replaces_the_share_asked_for() -> None:
    image = np.zeros((60, 60, 4), np.float32)
    image[10:50, 10:50] = [0.2, 0.3, 0.4, 1.0]
    spoilt, replaced = spoiled(image, 0.2, seed=3)
    assert replaced.sum() == 0.2 * 1600 and not replaced[image[..., 3] == 0].any()
    np.testing.assert_array_equal(spoilt[~replaced], image[~replaced])
    np.testing.assert_array_equal(spoilt[..., 3], image[..., 3])
    np.testing.assert_array_equal(spoilt, spoiled(image, 0.2, seed=3)[0])
    assert (np.abs(spoilt - image).max(axis=-1)[replaced] > 0).all()
    with pytest.raises(ValueError, match="share is 1"):
        spoiled(image, 1.0)
    with pytest.raises(ValueError, match="no object"):
        spoiled(np.zeros((4, 4, 4), np.float32))


def test_a_spoilt_capture_says_what_was_left_out(tmp_path: Path) -> None:
    simulate_capture(
        tmp_path / "capture", rows=24, k=8, test_views=1, size=64, materials=2, lights=("atelier", "overcast")
    )
    options = ReconstructOptions(32, "paper", texels=300, solve=FAST)
    clean = reconstruct_folder(tmp_path / "capture", tmp_path / "clean", options, viewer=False)
    assert clean.left_out == 0 and clean.undecided == 0
    plain = replace(options, solve=replace(FAST, robust=False))
    reconstruct_folder(tmp_path / "capture", tmp_path / "plain", plain, viewer=False)
    for name in ("blend.exr", "mesh.obj"):
        assert (tmp_path / "clean" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()
    masks = spoil_capture(tmp_path / "capture", 0.2)
    assert len(masks) == len(read_capture(tmp_path / "capture").frames)
    with pytest.warns(CaptureWarning, match="left out: images/0001.exr"):
        spoilt = reconstruct_folder(tmp_path / "capture", tmp_path / "spoilt", options, viewer=False)
    # A fifth of the pixels, and the samples that a spike or a blob's edge has a part in.
    assert 0.15 < spoilt.left_out < 0.45
    assert "measurements left out as outliers" in spoilt.in_words()
    solver = json.loads((tmp_path / "spoilt" / "svbrdf.json").read_text())["solver"]
    assert solver["outliers"]["scale"] > 0
    assert np.mean(solver["left_out_by_frame"]) == pytest.approx(spoilt.left_out, abs=0.02)
    page = (tmp_path / "spoilt" / "report.html").read_text(encoding="utf-8")
    assert "contradict" in page and "no two photographs agree" in page
    assert "% undecided" in spoilt.in_words() and spoilt.undecided > 0
    # Over the texels that have a residual: the undecided ones have none, and do not make it smaller.
    found = read_material(tmp_path / "spoilt")
    error = found.residual[found.residual > 0]
    assert spoilt.misfit == pytest.approx(float(np.sqrt((error.astype(np.float64) ** 2).mean())), rel=1e-4)
    assert found.spread is not None and 0 < found.spread.max() < 0.2


def test_only_drops_measurements_and_empty_texels(tmp_path: Path) -> None:
    from swatchwork.observe import Pairs
    from swatchwork.observe.observations import SeenPairs

    direction = np.zeros((5, 3), np.float32)
    seen = SeenPairs(
        np.array([4, 7]),
        np.array([0, 3, 5]),
        np.array([4, 4, 4, 7, 7]),
        np.array([0, 1, 2, 0, 2], np.int32),
        np.arange(15, dtype=np.float32).reshape(5, 3),
        direction,
        direction,
        np.ones(5, np.float32),
    )
    pairs = Pairs(seen, seen.radiance, np.ones(5, np.float32))
    left = only(pairs, np.array([True, False, True, False, False]))
    np.testing.assert_array_equal(left.offsets, [0, 2])
    np.testing.assert_array_equal(left.seen.texels, [4])
    np.testing.assert_array_equal(left.seen.frame, [0, 2])
    np.testing.assert_array_equal(left.radiance, seen.radiance[[0, 2]])

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Texels of which outliers leave too few views to vote take what a neighbour has and a view agrees with."""

from __future__ import annotations

import numpy as np
import pytest

from swatchwork.arrays import F64
from swatchwork.capture import read_capture
from swatchwork.reconstruct import Reconstruction, ReconstructOptions, reconstruct
from swatchwork.simulate import simulate_capture, spoil_capture, two_of_four
from swatchwork.solve import Problem, SolveOptions, seconded
from swatchwork.solve.trimming import BOUND, expected
from swatchwork.streaming import Agreement, Budget, agreement, blend_every_texel
from swatchwork.streaming.neighbours import CANDIDATES, take_neighbours_blends

FAST = SolveOptions(n=2, N=3, tolerance=0.02, max_alternations=40)
pytestmark = pytest.mark.filterwarnings("ignore::swatchwork.errors.CaptureWarning")


class Small(Budget):
    """So little that every few texels are a tile of their own."""

    def tile(self, representatives: int) -> int:
        return 97


def test_seconded_is_the_plain_search() -> None:
    made = two_of_four(4, 7, texels=40, materials=3, noise_percent=5.0)
    radiance = made.radiance.copy()
    radiance[::3] *= 4
    responses = Problem(made.responses, radiance, made.offsets).fold(made.truth_representatives)
    rng, texels = np.random.default_rng(2), len(made.offsets) - 1
    index = rng.integers(0, 3, (texels, 6, 2))
    weight = rng.dirichlet([1, 1], (texels, 6)).astype(np.float32)
    scale = 0.05
    best, agreeing = seconded(responses, radiance, made.offsets, index, weight, scale)
    size = expected(radiance, made.offsets)
    for m in range(texels):
        rows = range(made.offsets[m], made.offsets[m + 1])
        costs, counts = [], []
        for k in range(6):
            off = []
            for p in rows:
                fitted = sum(float(weight[m, k, s]) * responses[p, index[m, k, s]] for s in range(2))
                off.append(float(np.linalg.norm(fitted - radiance[p])) / size[p] / (BOUND * scale))
            costs.append(sum(min(d, 1.0) ** 2 for d in off))
            counts.append(sum(d <= 1 for d in off))
        # The blends' sums are in another order than here: equal but for rounding.
        assert costs[best[m]] == pytest.approx(min(costs), abs=1e-6)
        assert agreeing[m] == counts[best[m]]
    assert 0 < (agreeing > 0).sum() < texels


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    """A reconstruction of photographs a fifth of which are outliers."""
    folder = tmp_path_factory.mktemp("neighbours") / "capture"
    simulate_capture(folder, rows=24, k=8, test_views=1, size=64, materials=2, lights=("atelier", "overcast"))
    spoil_capture(folder, 0.2)
    options = ReconstructOptions(32, "paper", texels=300, solve=FAST)
    found = reconstruct(read_capture(folder), options)
    assert found.solution.outliers is not None
    return found


def test_they_do_not_depend_on_the_tiles(spoilt: Reconstruction) -> None:
    small = blend_every_texel(
        spoilt.rendering, spoilt.basis, spoilt.solution, FAST.search, FAST.seed, Small()
    )
    assert len(small.undecided) > 97
    for name in ("index", "weight", "residual", "undecided"):
        np.testing.assert_array_equal(getattr(small, name), getattr(spoilt.blend, name))


def test_undecided_texels_take_the_neighbours_blend_that_agrees_best(spoilt: Reconstruction) -> None:
    """Each texel's 32 nearest decided ones by all distances, and their costs one after the other."""
    blend, atlas, texels = spoilt.blend, spoilt.observations.atlas, spoilt.blend.undecided
    index, weight = blend.index.reshape(-1, 2), blend.weight.reshape(-1, 2)
    decided = np.setdiff1d(spoilt.observations.seen, texels)
    assert spoilt.solution.outliers is not None
    vote = agreement(
        spoilt.rendering, spoilt.basis, spoilt.solution, texels.astype(np.int64), FAST.search, FAST.seed
    )
    size: F64 = expected(vote.pairs.radiance, vote.pairs.offsets, spoilt.observations.typical)
    bound = BOUND * spoilt.solution.outliers.scale
    kinds = {"taken": 0, "own": 0, "nearest": 0}
    for m, texel in enumerate(texels):
        apart = np.linalg.norm(atlas.position(decided) - atlas.position(np.array([texel])), axis=1)
        near = decided[np.argsort(apart, kind="stable")[:CANDIDATES]]
        rows = slice(vote.pairs.offsets[m], vote.pairs.offsets[m + 1])
        off = np.array([off_by(vote, rows, index[p], weight[p]) for p in atlas.pixel[near]]) / size[rows]
        cost = (np.minimum(off / bound, 1) ** 2).sum(axis=1)
        has = index[atlas.pixel[texel]], weight[atlas.pixel[texel]]
        if (off <= bound).any():
            kinds["taken"] += 1
            # Of equals any: what the tree gives first of two texels as near is its own matter.
            best = atlas.pixel[near[cost <= cost.min() + 1e-6]]
            assert any((index[p] == has[0]).all() and (weight[p] == has[1]).all() for p in best)
        elif vote.agreeing[m]:
            kinds["own"] += 1
            np.testing.assert_array_equal(has[0], vote.trimmed.blend.index[m])
            np.testing.assert_array_equal(has[1], vote.trimmed.blend.weight[m])
        else:
            kinds["nearest"] += 1
    assert min(kinds["taken"], kinds["nearest"]) > 30
    assert not blend.residual.reshape(-1)[atlas.pixel[texels]].any()


def off_by(vote: Agreement, rows: slice, index: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Lengths of the residuals of a texel's views, one blend for all."""
    fitted = np.einsum("n,pnc->pc", weight.astype(np.float64), vote.responses[rows][:, index])
    return np.linalg.norm(fitted - vote.pairs.radiance[rows], axis=1)


def test_one_decided_texel_is_every_neighbour(spoilt: Reconstruction) -> None:
    atlas, blend = spoilt.observations.atlas, spoilt.blend
    decided = np.setdiff1d(spoilt.observations.seen, blend.undecided)[:1]
    images = blend.index.reshape(-1, 2).copy(), blend.weight.reshape(-1, 2).copy()
    given = take_neighbours_blends(
        spoilt.rendering, spoilt.basis, spoilt.solution, blend.undecided, decided, images, 1000
    )
    assert given.any()
    for image in images:
        taken = image[atlas.pixel[blend.undecided[given]]]
        np.testing.assert_array_equal(taken, np.broadcast_to(image[atlas.pixel[decided]], taken.shape))


def test_where_nothing_is_decided_texels_keep_what_a_view_agrees_with(
    spoilt: Reconstruction, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("swatchwork.streaming.tiles.LEAST", 255)
    blend = blend_every_texel(spoilt.rendering, spoilt.basis, spoilt.solution, FAST.search, FAST.seed)
    seen = spoilt.observations.seen.astype(np.int64)
    np.testing.assert_array_equal(blend.undecided, seen)
    vote = agreement(spoilt.rendering, spoilt.basis, spoilt.solution, seen, FAST.search, FAST.seed)
    kept = vote.agreeing > 0
    assert kept.any()
    at = spoilt.observations.atlas.pixel[seen[kept]]
    np.testing.assert_array_equal(blend.weight.reshape(-1, 2)[at], vote.trimmed.blend.weight[kept])

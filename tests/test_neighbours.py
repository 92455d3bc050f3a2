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
from swatchwork.streaming import Budget, TexelBlend, blend_every_texel

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


def test_an_undecided_texel_has_a_blend_that_a_view_agrees_with(spoilt: Reconstruction) -> None:
    texels = spoilt.blend.undecided
    agrees = views_agreeing(spoilt, spoilt.blend, texels)
    decided = np.setdiff1d(spoilt.observations.seen, texels)
    # Those of which no view agrees with anything are few, and have a decided or settled texel's blend.
    assert 0.5 < (agrees > 0).mean() < 1
    pixel = spoilt.observations.atlas.pixel
    of = spoilt.blend.weight.reshape(-1, 2)
    others = np.concatenate([decided, texels[agrees > 0]])
    everywhere = {row.tobytes() for row in of[pixel[others]]}
    assert all(of[pixel[t]].tobytes() in everywhere for t in texels[agrees == 0])
    assert not spoilt.blend.residual.reshape(-1)[pixel[texels]].any()


def views_agreeing(found: Reconstruction, blend: TexelBlend, texels: np.ndarray) -> np.ndarray:
    """How many views of each texel agree with its blend, one texel after the other."""
    outliers = found.solution.outliers
    assert outliers is not None
    pairs = found.rendering.pairs(texels)
    responses = found.rendering.representatives(found.basis, found.solution.representatives, pairs)
    size: F64 = expected(pairs.radiance, pairs.offsets, found.observations.typical)
    pixel, n = found.observations.atlas.pixel, blend.index.shape[-1]
    index, weight = blend.index.reshape(-1, n), blend.weight.reshape(-1, n)
    counts = []
    for m, texel in enumerate(texels):
        rows = slice(pairs.offsets[m], pairs.offsets[m + 1])
        fitted = sum(
            float(weight[pixel[texel], s]) * responses[rows, index[pixel[texel], s]] for s in range(n)
        )
        off = np.linalg.norm(fitted - pairs.radiance[rows], axis=1) / size[rows]
        counts.append(int((off <= BOUND * outliers.scale).sum()))
    return np.array(counts)

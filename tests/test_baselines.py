# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The compared methods, each against truth it can represent, or a slow twin where it has an optimum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from swatchwork.baselines import (
    Clustering,
    GlobalLinear,
    Goldman,
    Measurements,
    PerTexel,
    PerTexelLobe,
    Recovered,
    SparseAsPossible,
    fit_reflectance,
    single_lobe,
    single_lobe_basis,
)
from swatchwork.baselines.lobes import BRIGHTEST
from swatchwork.errors import InputError
from swatchwork.reflectance import GenericBasis, extended
from swatchwork.reproduce.data import KernelBrdf
from swatchwork.solve import SolveOptions

SMALL = GenericBasis("small", sigmas=np.geomspace(0.02, 0.4, 6))
"""13 kernels: 6 roughnesses by two Fresnel terms, and Lambert."""


def lobe(
    sigma: int, tau: float, diffuse: float, specular: float, tint: tuple[float, ...] = (1, 1, 1)
) -> np.ndarray:
    found = np.zeros((SMALL.kernels, 3))
    found[sigma] = (1 - tau) * specular
    found[6 + sigma] = tau * specular
    found[-1] = diffuse * np.array(tint)
    return found


THREE = np.stack(
    [lobe(1, 0.06, 0.5, 0.8, (1, 0.2, 0.1)), lobe(3, 0.5, 0.02, 0.9), lobe(4, 0.1, 0.4, 0.5, (0.1, 0.3, 1))]
)


def measured(weights: np.ndarray, k: int = 8, seed: int = 0, noise: float = 0.0) -> Measurements:
    """Texels with random responses of lively scale, measured exactly or with noise."""
    rng = np.random.default_rng(seed)
    M = len(weights)
    responses = rng.gamma(0.7, 1.0, (M * k, SMALL.kernels, 3)).astype(np.float32)
    full = np.repeat(weights, k, axis=0)
    radiance = np.einsum("pn,pjc,njc->pc", full, responses, THREE[: weights.shape[1]], optimize=True)
    radiance *= 1 + noise * rng.normal(size=radiance.shape)
    return Measurements(SMALL, responses, radiance.astype(np.float32), np.arange(M + 1) * k)


def relative_error(found: Recovered, m: Measurements) -> float:
    full = found.weights[m.texel]
    folded = np.einsum("pjc,njc->pnc", m.responses, found.representatives, optimize=True)
    made = np.einsum("pn,pnc->pc", full, folded, optimize=True)
    return float(np.sqrt(((made - m.radiance) ** 2).sum() / (m.radiance**2).sum()))


def test_single_lobe_is_the_best_of_all_grid_points() -> None:
    """Against bounded least squares of each roughness and tau, channel by channel."""
    rng = np.random.default_rng(1)
    for seed in range(4):
        responses = rng.gamma(0.7, 1.0, (20, SMALL.kernels, 3))
        target = rng.gamma(0.7, 1.0, (20, 3)) * (3.0 if seed == 3 else 0.3)
        weight = rng.uniform(0.5, 2, 20)
        taus = (0.0, 0.3, 1.0)
        found = single_lobe(SMALL, responses, target, weight, taus)
        made = np.einsum("rjc,jc->rc", responses, found)
        error = (weight[:, None] * (made - target) ** 2).sum()
        root = np.sqrt(weight)
        least = np.inf
        for s in range(6):
            for tau in taus:
                of = 0.0
                for c in range(3):
                    column = (1 - tau) * responses[:, s, c] + tau * responses[:, 6 + s, c]
                    a = root[:, None] * np.stack([responses[:, -1, c], column], axis=1)
                    of += 2 * lsq_linear(a, root * target[:, c], (0, BRIGHTEST), tol=1e-14).cost
                least = min(least, of)
        # lsq_linear's own tolerance.
        assert error == pytest.approx(least, rel=1e-8)


def test_single_lobe_needs_its_kernels() -> None:
    bare = GenericBasis("bare", sigmas=np.array([0.1]), fresnel=(0,))
    with pytest.raises(InputError, match="Fresnel exponents 5 and 0"):
        single_lobe(bare, np.ones((2, 2, 3)), np.ones((2, 3)), np.ones(2))
    # The extended basis has them among others.
    responses = np.random.default_rng(0).gamma(1.0, 1.0, (30, extended().kernels, 3))
    assert single_lobe(extended(), responses, responses[:, 5], np.ones(30)).shape == (extended().kernels, 3)


def test_a_reflectance_of_one_lobe_is_found() -> None:
    basis = single_lobe_basis()
    truth = np.zeros((basis.kernels, 3))
    truth[60], truth[90 + 60] = 0.9 * np.array([0.3, 0.4, 0.5]), 0.1 * np.array([0.3, 0.4, 0.5])
    truth[-1] = [0.2, 0.1, 0.05]
    found = fit_reflectance(KernelBrdf("truth", basis, truth))
    # The truth is on the grid: sigma by index, tau = 0.1 among those tried.
    np.testing.assert_allclose(found, truth, atol=1e-9)


def test_every_texel_by_itself_fits_what_it_saw() -> None:
    m = measured(np.eye(3)[np.arange(30) % 3], k=20)
    # 60 measurements a texel determine its 39 weights; the ridge leaves a thousandth.
    assert relative_error(PerTexel().recover(m), m) < 3e-3
    lobes = PerTexelLobe().recover(m)
    # tau = 0.06, 0.5 and 0.1 are among those tried.
    assert relative_error(lobes, m) < 1e-5 and lobes.materials == 30


def test_global_linear_lowers_its_objective_below_the_truths() -> None:
    """A convex problem: whatever is feasible, the truth above all, costs at least as much as the optimum."""
    rng = np.random.default_rng(3)
    weights = rng.dirichlet(np.ones(3), 60)
    m = measured(weights, k=6)
    method = GlobalLinear(0.01, iterations=3000, tolerance=1e-6)
    found = method.recover(m)
    assert found.status == "converged" and (found.weights >= 0).all()
    scale = np.sqrt(
        (m.problem.gamma[m.texel][:, None, None] * m.responses.astype(float) ** 2).sum(axis=(0, 2)) / 180
    )

    def objective(w: np.ndarray) -> float:
        """w [M, 3 J] in the method's order."""
        of = w.reshape(60, SMALL.kernels, 3)
        made = np.einsum("pjc,pjc->pc", m.responses, of[m.texel], optimize=True)
        misfit = (m.problem.gamma[m.texel] * ((made - m.radiance) ** 2).sum(axis=1)).sum()
        nuclear = np.linalg.svd((of * scale[:, None]).reshape(60, -1), compute_uv=False).sum()
        return float(misfit + found.found["penalty"] * nuclear)

    truth = np.einsum("mn,njc->mjc", weights, THREE).reshape(60, -1)
    assert objective(found.weights) < objective(truth)
    for _ in range(5):
        near = np.maximum(found.weights * (1 + 0.02 * rng.normal(size=found.weights.shape)), 0)
        assert objective(found.weights) < objective(near)
    # From the penalty of full strength on, nothing at all is best.
    assert np.abs(GlobalLinear(1.05).recover(m).weights).max() < 1e-3 * np.abs(truth).max()


def test_clusters_find_patches_of_single_materials() -> None:
    of_texel = np.arange(60) % 3
    m = measured(np.eye(3)[of_texel], noise=0.01)
    found = Clustering(3).recover(m)
    chosen = found.weights.argmax(axis=1)
    for material in range(3):
        assert len(set(chosen[of_texel == material])) == 1
    assert len(set(chosen)) == 3 and relative_error(found, m) < 0.02


def test_goldman_blends_two_of_its_materials() -> None:
    rng = np.random.default_rng(5)
    pairs = rng.permuted(np.tile([0, 1, 2], (80, 1)), axis=1)[:, :2]
    weights = np.zeros((80, 3))
    weights[np.arange(80)[:, None], pairs] = rng.dirichlet(np.ones(2), 80)
    m = measured(weights, k=10)
    found = Goldman((3, 4), rounds=60).recover(m)
    assert (np.count_nonzero(found.weights, axis=1) <= 2).all()
    np.testing.assert_allclose(found.weights.sum(axis=1), 1, atol=1e-9)
    # Ordinary descent from clusters need not reach the truth; it must beat patches of single materials.
    assert (
        relative_error(found, m) < 0.5 * relative_error(Clustering(3).recover(m), m)
        or relative_error(found, m) < 0.05
    )


def test_ours_is_one_of_them() -> None:
    found = SparseAsPossible(SolveOptions(max_N=4, max_n=2)).recover(measured(np.eye(3)[np.arange(60) % 3]))
    assert (found.found["n"], found.materials) == (1, 3)

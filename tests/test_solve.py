# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The sparse solver against plain twins, an outside solver, and blends of known truth."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.optimize import minimize, nnls

from swatchwork import _native
from swatchwork.errors import InputError
from swatchwork.simulate import SyntheticProblem, two_of_four
from swatchwork.solve import Problem, SolveOptions, alternate, blend, solve, sparse_blend


def best_by_enumeration(s: np.ndarray, s_hat: np.ndarray, n: int) -> float:
    """Eq. 12 as it stands: every support of at most n, the sum eliminated, infeasible ones passed over."""
    N = s.shape[1]
    best = np.inf
    for size in range(1, min(n, N) + 1):
        for support in combinations(range(N), size):
            chosen = s[:, support]
            difference = chosen[:, :-1] - chosen[:, -1:]
            w, *_ = np.linalg.lstsq(difference, s_hat - chosen[:, -1], rcond=None)
            w = np.append(w, 1 - w.sum())
            # A rank-deficient support has a feasible point on a smaller one, which is looked at too.
            if (w >= -1e-12).all():
                best = min(best, float(((chosen @ w - s_hat) ** 2).sum()))
    return best


def random_texels(rng: np.random.Generator, kind: str, M: int, k: int, N: int) -> tuple:
    """Responses [P, N, 3], radiance [P, 3] and offsets of texels with k views."""
    P = M * k
    responses = rng.uniform(0, 1, (P, N, 3))
    if kind == "correlated":
        # As in real runs: representatives are nearly multiples of one another.
        responses = rng.uniform(0.2, 1, (P, 1, 3)) * (1 + 0.02 * rng.normal(size=(P, N, 3)))
    if kind == "twins" and N > 1:
        responses[:, -1] = responses[:, 0]
    if kind == "zero" and N > 1:
        responses[:, 0] = 0
    radiance = rng.uniform(0, 1, (P, 3))
    if kind == "inside":
        radiance = np.einsum("pn,pnc->pc", np.repeat(rng.dirichlet(np.ones(N), M), k, axis=0), responses)
    offsets = np.arange(M + 1, dtype=np.int64) * k
    return responses.astype(np.float32), radiance.astype(np.float32), offsets


@pytest.mark.parametrize("kind", ["random", "correlated", "twins", "zero", "inside"])
@pytest.mark.parametrize("k", [1, 2, 5])
def test_blend_finds_the_best_of_all_supports(kind: str, k: int) -> None:
    rng = np.random.default_rng([7, k])
    for N, n in [(1, 1), (4, 2), (6, 3), (7, 5)]:
        responses, radiance, offsets = random_texels(rng, kind, 6, k, N)
        for search in ("exact", "brute"):
            found = blend(responses, radiance, offsets, n, search=search)
            assert np.all(found.weights >= 0)
            assert np.all((found.weights > 0).sum(axis=1) <= n)
            np.testing.assert_allclose(found.weights.sum(axis=1), 1, atol=1e-12)
            for x in range(6):
                rows = slice(x * k, (x + 1) * k)
                s = responses[rows].transpose(0, 2, 1).reshape(-1, N).astype(np.float64)
                s_hat = radiance[rows].reshape(-1).astype(np.float64)
                twin = best_by_enumeration(s, s_hat, n)
                # lstsq and Cholesky on nearly dependent columns agree to about half the digits.
                assert found.squared_error[x] == pytest.approx(twin, rel=1e-6, abs=1e-9)


def test_pruned_search_is_feasible_and_no_better_than_the_exact_one() -> None:
    rng = np.random.default_rng(3)
    responses, radiance, offsets = random_texels(rng, "random", 200, 4, 8)
    exact = blend(responses, radiance, offsets, 3)
    pruned = blend(responses, radiance, offsets, 3, search="pruned", previous=exact.weights)
    assert np.all(pruned.squared_error >= exact.squared_error - 1e-10)
    # The previous choice is always tried: the exact weights can only be met, not lost.
    np.testing.assert_allclose(pruned.squared_error, exact.squared_error, rtol=1e-9)
    without = blend(responses, radiance, offsets, 3, search="pruned")
    assert without.squared_error.mean() > exact.squared_error.mean()
    assert exact.visited < blend(responses, radiance, offsets, 3, search="brute").visited


def in_slots(weights: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Index and weight [M, n], the largest first; an unused slot repeats the first with weight 0."""
    padded = np.pad(weights, ((0, 0), (0, max(0, n - weights.shape[1]))))
    index = np.argsort(-padded, axis=1, kind="stable")[:, :n]
    weight = np.take_along_axis(padded, index, axis=1)
    return np.where(weight > 0, index, index[:, :1]), weight.astype(np.float32)


@pytest.mark.parametrize("search", ["exact", "brute", "pruned"])
def test_slots_hold_the_same_blends(search: str) -> None:
    rng = np.random.default_rng(4)
    responses, radiance, offsets = random_texels(rng, "random", 5000, 2, 6)
    for n in (1, 3, 8):  # 8: more than the 6 there are
        whole = blend(responses, radiance, offsets, n, search=search)
        slots = sparse_blend(responses, radiance, offsets, n, search=search)
        index, weight = in_slots(whole.weights, n)
        np.testing.assert_array_equal(slots.index, index)
        np.testing.assert_array_equal(slots.weight, weight)
        np.testing.assert_array_equal(slots.squared_error, whole.squared_error)
        assert slots.visited == whole.visited


@pytest.fixture(scope="module")
def small() -> SyntheticProblem:
    return two_of_four(k=4, seed=1, texels=300)


def dense(problem: SyntheticProblem) -> np.ndarray:
    weights = np.zeros((len(problem.offsets) - 1, 4))
    np.put_along_axis(weights, problem.truth_index.astype(np.int64), problem.truth_weight, axis=1)
    return weights


def test_normal_equations_are_the_sums_they_stand_for(small: SyntheticProblem) -> None:
    problem, weights = Problem(small.responses, small.radiance, small.offsets), dense(small)
    texel = np.repeat(np.arange(problem.texels), np.diff(small.offsets))
    scale = np.sqrt(problem.gamma)[texel]
    for c in range(3):
        rows = np.einsum("p,pn,pj->pnj", scale, weights[texel], small.responses[:, :, c].astype(np.float64))
        X = rows.reshape(len(texel), -1)
        s_hat = scale * small.radiance[:, c].astype(np.float64)
        h, b, energy = problem._native.normal_equations(weights, c)
        # The same sums in 64 bits, in another order.
        np.testing.assert_allclose(h, X.T @ X, rtol=1e-10, atol=1e-12 * np.abs(h).max())
        np.testing.assert_allclose(b, X.T @ s_hat, rtol=1e-10, atol=1e-12 * np.abs(b).max())
        assert energy == pytest.approx(s_hat @ s_hat, rel=1e-12)


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_representatives_match_an_independent_solver(noise: float) -> None:
    truth = two_of_four(k=4, seed=2, texels=150, noise_percent=100 * noise)
    problem, weights = Problem(truth.responses, truth.radiance, truth.offsets), dense(truth)
    representatives, value, _ = problem.representatives(weights)
    assert representatives.min() >= 0
    texel = np.repeat(np.arange(problem.texels), np.diff(truth.offsets))
    scale = np.sqrt(problem.gamma)[texel]
    total = 0.0
    for c in range(3):
        X = np.einsum("p,pn,pj->pnj", scale, weights[texel], truth.responses[:, :, c].astype(np.float64))
        X, s_hat = X.reshape(len(texel), -1), scale * truth.radiance[:, c].astype(np.float64)
        # scipy's Lawson-Hanson works on the rows, not on the Gram matrix.
        total += nnls(X, s_hat, maxiter=100_000)[1] ** 2
    # The 1e-6 relative; the floor is what rounding of s_hat to 32 bits leaves.
    assert value == pytest.approx(total / problem.texels, rel=1e-6, abs=1e-13)


def test_nnls_matches_a_general_optimiser() -> None:
    rng = np.random.default_rng(11)
    for _ in range(5):
        X, s = rng.normal(size=(30, 8)), rng.normal(size=30)
        h, b = X.T @ X, X.T @ s
        x, converged = _native.nnls(h, b, np.zeros(8), 1e-12)
        other = minimize(
            lambda v, h=h, b=b: 0.5 * v @ h @ v - b @ v,
            np.ones(8),
            jac=lambda v, h=h, b=b: h @ v - b,
            bounds=[(0, None)] * 8,
            options={"ftol": 1e-15, "gtol": 1e-10},
        )
        assert converged
        assert 0.5 * x @ h @ x - b @ x <= other.fun + 1e-9


def joint_system(
    problem: Problem, truth: SyntheticProblem, weights: np.ndarray, representatives: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """H, g and the places of the free kernels, texel by texel with dense projections."""
    free = np.argwhere(representatives > 0)
    number = {tuple(place): at for at, place in enumerate(free)}
    h, g = np.zeros((len(free), len(free))), np.zeros(len(free))
    for x in range(problem.texels):
        rows = slice(*truth.offsets[x : x + 2])
        s, s_hat = truth.responses[rows].astype(np.float64), truth.radiance[rows].astype(np.float64)
        support = np.flatnonzero(weights[x])
        blended = np.einsum("vjc,njc->vcn", s, representatives[support]).reshape(-1, len(support))
        jacobian, places = [], []
        for i in support:
            for j, c in np.argwhere(representatives[i] > 0):
                column = np.zeros_like(s_hat)
                column[:, c] = weights[x, i] * s[:, j, c]
                jacobian.append(column.reshape(-1))
                places.append(number[i, j, c])
        J = np.array(jacobian).T
        differences = blended[:, 1:] - blended[:, :1]
        seen = differences @ np.linalg.pinv(differences) if len(support) > 1 else 0.0
        h[np.ix_(places, places)] += problem.gamma[x] * (J.T @ (np.eye(len(J)) - seen) @ J)
        g[places] += problem.gamma[x] * J.T @ (s_hat.reshape(-1) - blended @ weights[x, support])
    return h, g, free


@pytest.fixture(scope="module")
def noisy() -> tuple[SyntheticProblem, Problem, np.ndarray, np.ndarray]:
    """Weights and representatives after one alternation from random ones, three of five at a texel."""
    truth = two_of_four(k=5, seed=6, texels=250, noise_percent=3.0)
    problem = Problem(truth.responses, truth.radiance, truth.offsets)
    weights = np.random.default_rng(9).dirichlet(np.ones(5), problem.texels)
    step = alternate(problem, 3, weights=weights, most=1, joint=False)
    return truth, problem, step.weights, step.representatives


@pytest.mark.parametrize("damping", [1e-5, 1.0])
def test_the_joint_step_minimises_the_projected_model(noisy: tuple, damping: float) -> None:
    truth, problem, weights, now = noisy
    assert {2, 3} <= set((weights > 0).sum(axis=1))
    h, g, free = joint_system(problem, truth, weights, now)
    h[np.diag_indices(len(h))] *= 1 + damping
    moved = problem.joint_step(weights, now, damping)
    place = tuple(free.T)
    assert not np.any(moved[now == 0]) and moved.min() >= 0

    def slopes(x: np.ndarray) -> np.ndarray:
        """In units of each kernel's own gain."""
        return (g - h @ (x - now[place])) / np.sqrt(np.diag(h))

    scale = np.abs(slopes(now[place])).max()
    left = slopes(moved[place])
    kept = moved[place] > 0
    # The core folds in 32 bits, so that its residuals are off by 1e-7 of the radiance.
    assert np.abs(left[kept]).max() < 1e-4 * scale and left[~kept].max() < 1e-4 * scale
    assert kept.sum() > len(kept) / 2


def test_the_joint_step_leaves_idle_representatives_alone(noisy: tuple) -> None:
    _, problem, weights, now = noisy
    idle = np.concatenate([now, now[:1] + 0.5])
    unused = np.concatenate([weights, np.zeros((problem.texels, 1))], axis=1)
    moved = problem.joint_step(unused, idle, 1e-3)
    np.testing.assert_array_equal(moved[-1], idle[-1])
    np.testing.assert_array_equal(moved[:-1], problem.joint_step(weights, now, 1e-3))
    with pytest.raises(ValueError, match="damping: -1"):
        problem.joint_step(weights, now, -1.0)
    with pytest.raises(ValueError, match="6 of them"):
        problem.joint_step(unused, now, 1e-3)


def test_joint_steps_take_a_fraction_of_the_alternations() -> None:
    """Representatives that start as two equal mixtures of the truth: alternation creeps apart."""
    truth = two_of_four(k=6, seed=4, texels=400, materials=2, noise_percent=1.0)
    problem = Problem(truth.responses, truth.radiance, truth.offsets)
    rng = np.random.default_rng(8)
    weights = 0.45 + 0.1 * rng.random(problem.texels)
    weights = np.stack([weights, 1 - weights], axis=1)
    plain, fast = (
        alternate(problem, 2, weights=weights, tolerance=1e-4, most=300, joint=joint)
        for joint in (False, True)
    )
    assert fast.converged and fast.count < plain.count / 3
    assert fast.data <= plain.data * (1 + 1e-3)
    assert fast.data == problem.mean(fast.squared_error)
    folded = problem.fold(fast.representatives)
    again = blend(folded, problem.radiance, problem.offsets, 2)
    np.testing.assert_allclose(again.squared_error, fast.squared_error, rtol=1e-6)


def test_no_representative_reflects_far_more_than_it_receives(noisy: tuple) -> None:
    """A few texels in the dark, lit by what their surroundings reflect."""
    truth, free, *_ = noisy
    albedo = np.stack([truth.basis.albedo(n_o) for n_o in (1.0, 0.25)])
    dark = np.arange(0, free.texels, 20)
    responses = truth.responses.copy()
    for x in dark:
        responses[slice(*truth.offsets[x : x + 2])] *= 1e-3
    options = SolveOptions(n=2, N=5)

    def highest(bound: np.ndarray | None) -> float:
        problem = Problem(responses, truth.radiance, truth.offsets, albedo=bound)
        found = solve(problem, options).representatives
        return float(np.einsum("aj,njc->nac", albedo, found).max())

    assert highest(None) > 100
    assert highest(albedo) <= 10


def test_the_typical_representative_is_that_of_the_surface(noisy: tuple) -> None:
    """Many texels of a subset that stand for little: what they look like is not typical."""
    truth, free, *_ = noisy
    albedo = truth.basis.albedo(1.0)[None]
    share = np.where(np.arange(free.texels) < 40, 1.0, 0.01)
    problem = Problem(truth.responses, truth.radiance, truth.offsets, share, albedo)
    weights = np.stack([share == 1, share < 1], axis=1).astype(np.float64)
    plain = np.zeros((2, truth.basis.kernels, 3))
    plain[:, -1] = [[0.5], [1000]]  # Lambertian albedo
    held = problem.possible(plain, weights)
    np.testing.assert_array_equal(held[0], plain[0])
    np.testing.assert_allclose(held[1, -1], 5, rtol=1e-2)


def test_alternation_never_raises_the_data_term(small: SyntheticProblem) -> None:
    problem = Problem(small.responses, small.radiance, small.offsets)
    rng = np.random.default_rng(5)
    weights = rng.dirichlet(np.ones(3), problem.texels)
    last = np.inf
    for _ in range(12):
        step = alternate(problem, 2, weights=weights, most=1)
        assert step.data <= last * (1 + 1e-9)
        weights, last = step.weights, step.data


def test_finds_two_of_four_from_nothing() -> None:
    truth = two_of_four(k=6, seed=0, texels=1000)
    solution = solve(Problem(truth.responses, truth.radiance, truth.offsets))
    assert (solution.n, solution.N) == (2, 4)
    assert solution.status == "converged"
    index = np.argsort(-solution.weights, axis=1)[:, :2].astype(np.uint32)
    weight = np.take_along_axis(solution.weights, index.astype(np.int64), axis=1)
    # The bound; runs end near 1e-6.
    assert truth.novel(solution.representatives, index, weight) < 1e-3
    assert {(step.n, step.N) for step in solution.history} >= {(1, 1), (2, 4), (2, 5)}


def test_the_history_is_judged_by_the_same_penalties(noisy: tuple) -> None:
    _, problem, *_ = noisy
    solution = solve(problem, SolveOptions(explore_texels=100))
    alone = [step for step in solution.history if step.N == 1]
    data = [step.objective - solution.lambda0 * step.n - solution.lambda1 for step in alone]
    # One representative is one model, whatever n, found at whatever time.
    assert {step.n for step in alone} >= {1, 2}
    assert data == pytest.approx([data[0]] * len(data), rel=1e-6)


def test_papers_order_follows_section_4() -> None:
    truth = two_of_four(k=6, seed=0, texels=400)
    options = SolveOptions(search_order="paper", lambda0=0.005**2, lambda1=0.002**2, max_n=2, max_N=5)
    solution = solve(Problem(truth.responses, truth.radiance, truth.offsets), options)
    visited = [(step.n, step.N) for step in solution.history]
    assert visited[0] == (1, 1)
    # N restarts at 1 for every n and rises by one.
    for (n0, N0), (n1, N1) in pairwise(visited):
        assert (n1, N1) == (n0, N0 + 1) or (n1, N1) == (n0 + 1, 1)
    assert (solution.lambda0, solution.lambda1) == (0.005**2, 0.002**2)


def test_fixed_numbers_are_kept() -> None:
    truth = two_of_four(k=4, seed=3, texels=300)
    problem = Problem(truth.responses, truth.radiance, truth.offsets)
    solution = solve(problem, SolveOptions(n=2, N=3))
    assert (solution.n, solution.N) == (2, 3)
    assert solution.weights.shape == (problem.texels, 3)
    assert (solution.weights > 0).sum(axis=1).max() <= 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"n": 0}, "n = 0"),
        ({"n": 3, "N": 2}, "n = 3 is more than N = 2"),
        ({"N": 65}, "at most 64"),
        ({"lambda0": -1.0}, "lambda0 = -1.0"),
        ({"lambda1": float("nan")}, "lambda1 = nan"),
    ],
)
def test_options_that_make_no_sense_are_refused(options: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        SolveOptions(**options)


def test_problems_that_say_nothing_are_refused() -> None:
    responses = np.ones((4, 5, 3), np.float32)
    with pytest.raises(InputError, match="1 of 3 texels are seen by no view"):
        Problem(responses, np.ones((4, 3), np.float32), np.array([0, 2, 2, 4]))
    with pytest.raises(InputError, match="black"):
        Problem(responses, np.zeros((4, 3), np.float32), np.array([0, 2, 4]))
    responses[1, 2, 0] = np.nan
    with pytest.raises(ValueError, match="responses: value NaN"):
        Problem(responses, np.ones((4, 3), np.float32), np.array([0, 2, 4]))


@pytest.mark.parametrize("order", ["default", "paper"])
def test_a_fixed_n_never_exceeds_the_representatives_found(order: str) -> None:
    truth = two_of_four(k=4, seed=5, texels=120, materials=2, blended=1)
    problem = Problem(truth.responses, truth.radiance, truth.offsets)
    solution = solve(problem, SolveOptions(n=3, max_N=4, search_order=order))
    assert solution.n <= solution.N
    folded = problem.fold(solution.representatives)
    slots = sparse_blend(folded, problem.radiance, problem.offsets, 4)
    assert slots.index.shape == slots.weight.shape == (problem.texels, 4)
    assert slots.index.max() < solution.N
    np.testing.assert_allclose(slots.weight.sum(axis=1), 1, atol=1e-6)
    with pytest.raises(InputError, match="n = 3 is more than max_N = 2"):
        SolveOptions(n=3, max_N=2)

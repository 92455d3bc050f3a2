# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Are the solver's two steps exact? Compare them with independent solvers on many problems.

The blend step (Eq. 12) is compared with enumeration of every support in NumPy (enumeration.py), and with the
core's own brute force, whose visited supports are the measure of the work. The representative step (Eqs. 6
and 7) is compared with scipy's Lawson-Hanson NNLS on the stacked rows and, where it is quick enough, with
its bounded-variable least squares.

    python scripts/measure/exactness.py --captures ../shared/captures --json exactness.json

The strongly correlated problems come from real runs: representatives recovered from a synthetic sphere and,
with --captures, from sphere-merl at low resolution, with those texels' measurements.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import results
from enumeration import best_blends
from scipy.optimize import lsq_linear, nnls

from swatchwork.capture import read_capture
from swatchwork.reconstruct import ReconstructOptions, reconstruct
from swatchwork.simulate import two_of_four
from swatchwork.solve import Problem, SolveOptions, blend, solve

MOST_N, MOST_BLENDED = 12, 5
BATCH = 500
ENERGY_FLOOR = 1e-9
"""Objectives are compared relative to the optimum, or to this share of ||s_hat||^2 where that is larger:
below it lies what rounding to 32 bits puts into the measurements."""
Texels = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Responses [P, N, 3], radiance [P, 3], offsets [M + 1]."""


@dataclass
class Family:
    """What the problems of one kind gave."""

    name: str
    problems: int = 0
    worst: float = 0.0
    """Largest relative excess of the blend step's objective over enumeration's."""
    worst_below: float = 0.0
    """The same the other way round: what enumeration in floating point missed."""
    worst_brute: float = 0.0
    """Largest relative difference between the blend step and the core's brute force, either way."""
    determined: int = 0
    """Problems that leave a residual; where it is zero, the best support is often not the only one."""
    same_support: int = 0
    """Of those, the ones whose support is enumeration's (twin columns make it ambiguous all the same)."""
    visited: int = 0
    brute_visited: int = 0
    infeasible: int = 0
    seconds: float = 0.0


# ---- problems ------------------------------------------------------------------------------------
def made(rng: np.random.Generator, name: str, M: int, N: int) -> Texels:
    """M made-up texels over N columns, each with the same few views."""
    k = 1 if name == "K < N (one view)" else int(rng.choice([1, 2, 3, 6]))
    responses = rng.uniform(0, 1, (M * k, N, 3))
    radiance = rng.uniform(0, 1, (M * k, 3))
    if name == "duplicate columns":
        twins = rng.choice(N, max(2, N // 2), replace=False)
        responses[:, twins] = responses[:, twins[:1]]
    if name == "zero columns":
        responses[:, rng.choice(N, max(1, N // 3), replace=False)] = 0
    if name == "inside the hull":
        weights = np.repeat(rng.dirichlet(np.full(N, 0.5), M), k, axis=0)
        radiance = np.einsum("pn,pnc->pc", weights, responses.astype(np.float32).astype(np.float64))
    return responses.astype(np.float32), radiance.astype(np.float32), np.arange(M + 1, dtype=np.int64) * k


MADE = ("random", "K < N (one view)", "duplicate columns", "zero columns", "inside the hull")
LEAST_N = {"K < N (one view)": 4, "duplicate columns": 2, "zero columns": 2}


def synthetic_run(seed: int) -> Texels:
    """Texels of a GGX sphere with 3 % noise, and the responses of 12 recovered representatives."""
    truth = two_of_four(6, seed, "ggx", noise_percent=3.0, texels=1200)
    problem = Problem(truth.responses, truth.radiance, truth.offsets)
    found = solve(problem, SolveOptions(n=3, N=MOST_N, explore_texels=400, tolerance=0.02))
    return problem.fold(found.representatives), problem.radiance, problem.offsets


def captured_run(captures: Path) -> Texels:
    """Texels of sphere-merl at 96 x 96, and the responses of 12 recovered representatives."""
    options = ReconstructOptions(96, texels=800, solve=SolveOptions(n=3, N=MOST_N, tolerance=0.02))
    found = reconstruct(read_capture(captures / "sphere-merl").first(6), options)
    seen = found.observations.seen
    pairs = found.rendering.pairs(seen)
    responses = found.rendering.representatives(found.basis, found.solution.representatives, pairs)
    return responses, pairs.radiance, pairs.offsets


def drawn(rng: np.random.Generator, run: Texels, M: int, N: int) -> Texels:
    """M texels of a run, over a random choice of N of its representatives."""
    responses, radiance, offsets = run
    views = np.diff(offsets)
    texel = rng.choice(np.flatnonzero(views > 0), M)
    pair = np.concatenate([np.arange(offsets[x], offsets[x + 1]) for x in texel])
    columns = rng.choice(responses.shape[1], N, replace=False)
    return responses[pair][:, columns], radiance[pair], np.concatenate([[0], np.cumsum(views[texel])])


# ---- the blend step ------------------------------------------------------------------------------
def stacked(texels: Texels) -> tuple[np.ndarray, np.ndarray]:
    """S [M, K, N] and s [M, K] in 64 bits; texels with fewer views are filled up with rows of zeros."""
    responses, radiance, offsets = texels
    views = np.diff(offsets)
    M, k = len(views), int(views.max())
    texel = np.repeat(np.arange(M), views)
    place = np.arange(len(texel)) - np.repeat(offsets[:-1], views)
    S, s = np.zeros((M, k, 3, responses.shape[1])), np.zeros((M, k, 3))
    S[texel, place], s[texel, place] = responses.transpose(0, 2, 1), radiance
    return S.reshape(M, 3 * k, -1), s.reshape(M, 3 * k)


def compare(family: Family, texels: Texels, n: int) -> None:
    """Add a batch of problems to a family."""
    S, s = stacked(texels)
    twin, twin_weights = best_blends(S, s, n)
    start = time.perf_counter()
    exact = blend(*texels, n, search="exact")
    family.seconds += time.perf_counter() - start
    brute = blend(*texels, n, search="brute")
    scale = np.maximum(twin, ENERGY_FLOOR * (s**2).sum(axis=1))

    # Evaluate the weights here: the core's own account of its error takes no part.
    def objective(weights: np.ndarray) -> np.ndarray:
        return ((np.einsum("bkn,bn->bk", S, weights) - s) ** 2).sum(axis=1)

    excess = (objective(exact.weights) - twin) / scale
    against_brute = np.abs(objective(exact.weights) - objective(brute.weights)) / scale
    feasible = (exact.weights >= 0).all(axis=1) & ((exact.weights > 0).sum(axis=1) <= n)
    feasible &= np.abs(exact.weights.sum(axis=1) - 1) < 1e-9
    family.problems += len(s)
    family.worst = max(family.worst, float(excess.max()))
    family.worst_below = max(family.worst_below, float(-excess.min()))
    family.worst_brute = max(family.worst_brute, float(against_brute.max()))
    same = ((exact.weights > 1e-9) == (twin_weights > 1e-9)).all(axis=1)
    determined = twin > ENERGY_FLOOR * (s**2).sum(axis=1)
    family.determined += int(determined.sum())
    family.same_support += int((same & determined).sum())
    family.infeasible += int((~feasible).sum())
    family.visited += exact.visited
    family.brute_visited += brute.visited


def families(captures: Path | None, problems: int, seed: int) -> Iterator[tuple[str, int, Texels | None]]:
    """Name, number of problems, and the run they are drawn from."""
    runs = {"correlated, synthetic run": synthetic_run(seed)}
    if captures is not None:
        runs["correlated, sphere-merl"] = captured_run(captures)
    # Half of the problems are correlated, as real ones are.
    for name, run in runs.items():
        yield name, problems // (2 * len(runs)), run
    for name in MADE:
        yield name, problems // (2 * len(MADE)), None


def blend_step(captures: Path | None, problems: int, seed: int) -> list[Family]:
    found = []
    for number, (name, count, run) in enumerate(families(captures, problems, seed)):
        rng = np.random.default_rng([seed, number])
        family = Family(name)
        while family.problems < count:
            N = int(rng.integers(LEAST_N.get(name, 1), MOST_N + 1))
            n = int(rng.integers(1, MOST_BLENDED + 1))
            # The largest problems, whatever was drawn.
            if family.problems == 0:
                N, n = MOST_N, MOST_BLENDED
            M = min(BATCH, count - family.problems)
            compare(family, made(rng, name, M, N) if run is None else drawn(rng, run, M, N), n)
        found.append(family)
        print(f"{name}: {family.problems}, worst {family.worst:.1e}", flush=True)
    return found


# ---- the representative step ---------------------------------------------------------------------
@dataclass
class Representatives:
    """A problem of the representative step; objectives are means over texels of relative squared errors."""

    N: int
    noise_percent: float
    weights: str
    objective: float
    nnls: float
    bvls: float | None

    @property
    def difference(self) -> float:
        """Largest relative difference to the others, relative to no less than ENERGY_FLOOR."""
        others = [self.nnls] if self.bvls is None else [self.nnls, self.bvls]
        return max(abs(self.objective - other) / max(other, ENERGY_FLOOR) for other in others)


def representative_problem(N: int, noise_percent: float, kind: str, seed: int) -> Representatives:
    """Random or patchy weights over N representatives, on a synthetic sphere of GGX materials."""
    k = 4
    truth = two_of_four(k, seed, "ggx", noise_percent=noise_percent, texels=120 + 60 * N)
    problem = Problem(truth.responses, truth.radiance, truth.offsets)
    rng = np.random.default_rng([seed, N])
    weights = np.zeros((problem.texels, N))
    chosen = np.argsort(rng.random((problem.texels, N)), axis=1)[:, : min(2, N)]
    share = rng.dirichlet(np.full(chosen.shape[1], 1.0 if kind == "random" else 0.1), problem.texels)
    np.put_along_axis(weights, chosen, share, axis=1)
    value = problem.representatives(weights).data
    texel = np.repeat(np.arange(problem.texels), np.diff(truth.offsets))
    scale = np.sqrt(problem.gamma)[texel]
    by_nnls, by_bvls = 0.0, 0.0
    for c in range(3):
        responses = truth.responses[:, :, c].astype(np.float64)
        X = np.einsum("p,pn,pj->pnj", scale, weights[texel], responses).reshape(len(texel), -1)
        s_hat = scale * truth.radiance[:, c].astype(np.float64)
        by_nnls += nnls(X, s_hat, maxiter=100 * X.shape[1])[1] ** 2 / problem.texels
        if N == 1:
            by_bvls += 2 * lsq_linear(X, s_hat, (0, np.inf), method="bvls").cost / problem.texels
    return Representatives(N, noise_percent, kind, value, by_nnls, by_bvls if N == 1 else None)


def representative_step(seed: int) -> list[Representatives]:
    found = []
    for N, seeds in ((1, 4), (2, 4), (4, 3), (6, 2), (9, 1)):
        for noise in (0.0, 1.0, 3.0):
            for kind in ("random", "patchy"):
                for i in range(seeds):
                    found.append(representative_problem(N, noise, kind, seed + i))
    return found


# ---- tables --------------------------------------------------------------------------------------
def blend_rows(found: list[Family]) -> list[list[str]]:
    total = Family("all")
    for family in found:
        for key in ("problems", "determined", "same_support", "visited", "brute_visited", "infeasible"):
            setattr(total, key, getattr(total, key) + getattr(family, key))
        for key in ("worst", "worst_below", "worst_brute"):
            setattr(total, key, max(getattr(total, key), getattr(family, key)))
    return [
        [
            f.name,
            f"{f.problems:,}",
            f"{f.worst:.1e}",
            f"{f.worst_below:.1e}",
            f"{f.worst_brute:.1e}",
            f"{100 * f.same_support / f.determined:.2f}" if f.determined else "-",
            f"{f.visited / f.problems:.1f}",
            f"{f.brute_visited / f.problems:.1f}",
            str(f.infeasible),
        ]
        for f in [*found, total]
    ]


BLEND_HEAD = ["problems of the kind", "count", "worse by", "better by", "off brute", "same support %"]
BLEND_HEAD += ["visited", "brute visited", "infeasible"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, help="folder with sphere-merl; left out without it")
    parser.add_argument("--problems", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="write the figures here")
    args = parser.parse_args()
    start = time.perf_counter()
    blends = blend_step(args.captures, args.problems, args.seed)
    print("\n" + results.table(BLEND_HEAD, blend_rows(blends)))
    middle = time.perf_counter()
    fits = representative_step(args.seed)
    worst = max(fits, key=lambda fit: fit.difference)
    print(
        f"\nrepresentative step: {len(fits)} problems, N up to {max(fit.N for fit in fits)}; worst relative "
        f"difference {worst.difference:.1e} (N = {worst.N}, {worst.noise_percent:g} % noise, {worst.weights})"
    )
    print(f"{middle - start:.0f} s and {time.perf_counter() - middle:.0f} s")
    figures = {
        "energy_floor": ENERGY_FLOOR,
        "blend": [asdict(family) for family in blends],
        "representatives": [asdict(fit) | {"difference": fit.difference} for fit in fits],
    }
    results.write(args.json, figures)


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Does the solver find two blended of four materials, and how well does that predict a new light?

A sphere blends two of four known materials at every point (swatchwork.simulate.two_of_four); measurements
are exact responses, with or without noise, so what is left is the solver's. Prints each run's n, N and
novel-light NRMS (design 7), beside the floor: representatives fitted with the true weights.

    python scripts/measure/two_of_four.py --data ../shared/data --json two_of_four.json

With --data the sphere is captured under the Grace probe and tested under Uffizi, as in the paper, otherwise
under a procedural room and sky. A run takes some 10 to 60 seconds of a core.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import results

from swatchwork.capture import EnvironmentSource
from swatchwork.light import Environment, read_environment
from swatchwork.reflectance import basis_by_name
from swatchwork.simulate import SyntheticProblem, dense_weights, two_of_four
from swatchwork.solve import Problem, SolveOptions, solve


@dataclass(frozen=True)
class Case:
    """A row of the issue's table."""

    name: str
    truth: str
    k: int
    noise_percent: float = 0.0


CASES = (
    Case("noise-free, k=6", "basis", 6),
    Case("GGX truth, k=3", "ggx", 3),
    Case("GGX truth, k=6", "ggx", 6),
    Case("3 % noise, k=6", "basis", 6, 3.0),
    Case("GGX truth, 3 % noise, k=6", "ggx", 6, 3.0),
)


@dataclass(frozen=True)
class Run:
    """What one problem gave; NRMS are fractions."""

    case: str
    seed: int
    n: int
    N: int
    nrms: float
    floor: float
    status: str
    seconds: float


def lights(data: Path | None) -> dict[str, Environment]:
    """Training and novel light: Grace and Uffizi, or none, which means the procedural ones."""
    if data is None:
        return {}
    folder = data / "envmaps" / "latlong"

    def probe(name: str) -> Environment:
        return read_environment(EnvironmentSource(folder / f"{name}_1024x512.hdr", "mitsuba", np.eye(3)))

    return {"environment": probe("grace"), "novel_environment": probe("uffizi")}


def floor(truth: SyntheticProblem, problem: Problem) -> float:
    """Novel-light NRMS of the representatives fitted with the true weights."""
    weights = dense_weights(truth.truth_index, truth.truth_weight, len(truth.truth_representatives))
    representatives = problem.representatives(weights).representatives
    return truth.novel(representatives, truth.truth_index, truth.truth_weight)


def measure(
    case: Case, seed: int, basis: str, options: SolveOptions, texels: int, light: dict[str, Environment]
) -> Run:
    truth = two_of_four(
        case.k,
        seed,
        case.truth,
        noise_percent=case.noise_percent,
        texels=texels,
        basis=basis_by_name(basis),
        **light,
    )
    start = time.perf_counter()
    problem = Problem(truth.responses, truth.radiance, truth.offsets)
    found = solve(problem, options)
    seconds = time.perf_counter() - start
    every = np.broadcast_to(np.arange(found.N, dtype=np.uint32), found.weights.shape)
    nrms = truth.novel(found.representatives, every, found.weights)
    return Run(case.name, seed, found.n, found.N, nrms, floor(truth, problem), found.status, seconds)


def row(run: Run) -> list[str]:
    return [
        run.case,
        str(run.seed),
        str(run.n),
        str(run.N),
        f"{100 * run.nrms:.4f}",
        f"{100 * run.floor:.4f}",
        run.status,
        f"{run.seconds:.1f}",
    ]


HEAD = ["case", "seed", "n", "N", "NRMS %", "floor %", "status", "seconds"]


def mean_rows(runs: list[Run]) -> list[list[str]]:
    """Each case's mean; n and N say how many runs found 2 and 4."""
    out = []
    for name in dict.fromkeys(run.case for run in runs):
        of = [run for run in runs if run.case == name]
        nrms, least = (float(np.mean([getattr(run, key) for run in of])) for key in ("nrms", "floor"))
        right = sum((run.n, run.N) == (2, 4) for run in of)
        seconds = float(np.mean([run.seconds for run in of]))
        head = [name, f"mean of {len(of)}", f"{right} of {len(of)}", "are 2, 4"]
        out.append([*head, f"{100 * nrms:.4f}", f"{100 * least:.4f}", "", f"{seconds:.1f}"])
    return out


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, help="folder with envmaps/latlong; procedural lights without it")
    parser.add_argument("--basis", choices=["paper", "extended"], default="paper")
    parser.add_argument("--search-order", choices=["default", "paper"], default="default")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--texels", type=int, default=4000)
    parser.add_argument("--only", type=int, nargs="+", choices=range(len(CASES)), help="cases by number")
    parser.add_argument("--json", type=Path, help="write the figures here")
    args = parser.parse_args()
    light, options = lights(args.data), SolveOptions(search_order=args.search_order)
    settings = {key: getattr(args, key) for key in ("basis", "search_order", "texels")}
    settings["lights"] = "Grace, Uffizi" if args.data else "procedural room, sky"
    runs = []
    for i in args.only or range(len(CASES)):
        for seed in range(args.first_seed, args.first_seed + args.seeds):
            runs.append(measure(CASES[i], seed, args.basis, options, args.texels, light))
            print("  ".join(row(runs[-1])), flush=True)
            results.write(args.json, settings | {"runs": [asdict(run) for run in runs]})
    print("\n" + results.table(HEAD, [row(run) for run in runs] + mean_rows(runs)))


if __name__ == "__main__":
    main()

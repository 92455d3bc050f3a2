# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Noise and outliers: what the solver finds, and what the robust fit costs where neither is there.

    python scripts/measure/robust.py --data ../shared/data --json target/validation/robust.json
    python scripts/measure/robust.py --only outliers cost --json target/validation/robust.json

noise     two blended of four materials, 0 to 5 % of noise times, and half as many per cent of the median
          measurement added: n, N, novel-light NRMS (design 7), --seeds seeds, both truths
weighed   the same at its most noise, every point counted alike and by its noise as the pipeline does
          (swatchwork.observe.noise_shares, from the noise that was added): novel-light NRMS of both
outliers  whole captures, a fifth of the object's pixels replaced by blobs of another colour and by spikes
          (swatchwork.simulate.spoil_capture): NRMS of the clean ones, of the clean with representatives
          from texels of three views and more, of the spoilt, and of the spoilt with every measurement counted
cost      a clean capture with and without --robust, by turns, a process each: CPU seconds, peak memory, and
          whether the materials are the same, bit for bit

Parts that are not asked for stay as they are in --json.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import results
import two_of_four as tables

from swatchwork.capture import read_capture, read_image, read_photograph
from swatchwork.evaluate import nrms
from swatchwork.observe import NoiseModel, Rendering, noise_shares, stratified
from swatchwork.observe.noise import INTERPOLATED
from swatchwork.reconstruct import ReconstructOptions
from swatchwork.reflectance import GenericBasis, basis_by_name
from swatchwork.simulate import (
    SyntheticProblem,
    satin_materials,
    simulate_capture,
    spoil_capture,
    two_of_four,
)
from swatchwork.solve import Problem, Solution, SolveOptions, solve, solve_robustly
from swatchwork.solve.trimming import VOTES
from swatchwork.streaming import VIEWED, solve_on_subset
from swatchwork.workflow import reconstruct_folder, relight_folder

PARTS = ("noise", "weighed", "outliers", "cost")
LEVELS = (0.0, 1.0, 2.0, 3.0, 5.0)
READ = 0.5
"""Read noise, in % of the median measurement, for each % of multiplicative noise."""
SHARE = 0.2
THRICE = "clean, without texels of one or two views"
CASES = ("clean", THRICE, "spoilt", "spoilt, all counted")
RESOLUTION, TEXELS, SIZE, VIEWS = 96, 1500, 128, 12
REPEATS = 2


def made_with(args: argparse.Namespace, truth: str, seed: int, level: float) -> SyntheticProblem:
    return two_of_four(
        6,
        seed,
        truth,
        noise_percent=level,
        read_percent=READ * level,
        texels=args.texels,
        basis=basis_by_name("paper"),
        **tables.lights(args.data),
    )


def novel_light(made: SyntheticProblem, found: Solution) -> float:
    every = np.broadcast_to(np.arange(found.N, dtype=np.uint32), found.weights.shape)
    return made.novel(found.representatives, every, found.weights)


def noise(args: argparse.Namespace) -> list[dict[str, Any]]:
    rows = []
    for level in LEVELS:
        for truth in ("basis", "ggx"):
            for seed in range(args.seeds):
                made = made_with(args, truth, seed, level)
                problem = Problem(made.responses, made.radiance, made.offsets)
                found = solve_robustly(problem, SolveOptions())
                rows.append(
                    {
                        "noise": level,
                        "truth": truth,
                        "seed": seed,
                        "n": found.n,
                        "N": found.N,
                        "nrms": novel_light(made, found),
                        "floor": tables.floor(made, problem),
                        "outliers": found.outliers and asdict(found.outliers),
                    }
                )
                print(rows[-1], flush=True)
    return rows


def weighed(args: argparse.Namespace) -> list[dict[str, Any]]:
    level, rows = LEVELS[-1], []
    for truth in ("basis", "ggx"):
        for seed in range(args.seeds):
            made = made_with(args, truth, seed, level)
            # What is added here is the sample's noise; the model is of pixels, between which samples lie.
            read = READ * level / 100 * float(np.median(made.radiance)) / np.sqrt(INTERPOLATED)
            share = noise_shares(NoiseModel(read, 0.0), made.radiance, made.offsets)
            row: dict[str, Any] = {"noise": level, "truth": truth, "seed": seed}
            row["noisy"] = float((share < 1).mean())
            for name, of in (("alike", None), ("weighed", share / share.max())):
                problem = Problem(made.responses, made.radiance, made.offsets, of)
                found = solve_robustly(problem, SolveOptions())
                row[name] = {"n": found.n, "N": found.N, "nrms": novel_light(made, found)}
            rows.append(row)
            print(row, flush=True)
    return rows


def capture(folder: Path, shape: str, seed: int) -> None:
    simulate_capture(
        folder,
        object_shape=shape,
        k=VIEWS,
        test_views=3,
        size=SIZE,
        seed=seed,
        truth="ggx",
        recipes=satin_materials(seed),
        lights=("atelier", "overcast"),
        noise_percent=1.0,
        read_noise=0.005,
    )


def options(robust: bool) -> ReconstructOptions:
    return ReconstructOptions(resolution=RESOLUTION, texels=TEXELS, solve=SolveOptions(robust=robust))


def outliers(args: argparse.Namespace) -> list[dict[str, Any]]:
    rows = []
    for seed in range(3):
        for shape in args.shapes:
            with tempfile.TemporaryDirectory() as place:
                work = Path(place)
                capture(work / "clean", shape, seed)
                shutil.copytree(work / "clean", work / "spoilt")
                spoil_capture(work / "spoilt", SHARE, seed)
                for case in CASES:
                    start = time.process_time()
                    solver = seen_thrice if case == THRICE else solve_on_subset
                    with mock.patch("swatchwork.reconstruct.solve_on_subset", solver):
                        summary = reconstruct_folder(
                            work / case.split(",")[0],
                            work / "material",
                            options(robust=not case.endswith("counted")),
                            viewer=False,
                        )
                    seconds = time.process_time() - start
                    error = novel(work / "material", work / "clean" / "test", work / "renders")
                    kept = ("n", "N", "misfit", "left_out", "undecided", "texels")
                    found = {key: getattr(summary, key) for key in kept}
                    row = {"shape": shape, "seed": seed, "case": case, "nrms": error, "cpu_seconds": seconds}
                    rows.append(row | found)
                    print(rows[-1], flush=True)
    return rows


def seen_thrice(
    rendering: Rendering, basis: GenericBasis, texels: int, options: SolveOptions, *_: object
) -> Solution:
    """Representatives from the drawn texels that enough views see to outvote one; all are blended.

    Without the noise weights and the survey of `solve_on_subset`.
    """
    chosen = stratified(rendering.observations, texels, options.seed)
    pairs = rendering.pairs(chosen[rendering.observations.coverage[chosen] >= VOTES])
    albedo = np.stack([basis.albedo(n_o) for n_o in VIEWED])
    problem = Problem(rendering.generic(basis, pairs), pairs.radiance, pairs.offsets, albedo=albedo)
    return solve(problem, options)


def novel(material: Path, test: Path, renders: Path) -> float:
    """NRMS over all test frames' foregrounds."""
    relight_folder(material, test / "transforms.json", renders)
    ours, truth = [], []
    for frame in read_capture(test).frames:
        photograph = read_photograph(frame)
        on = (photograph.alpha > 0.5) & photograph.valid
        ours.append(read_image(renders / Path(frame.name).name).linear[on])
        truth.append(photograph.radiance[on])
    a, b = np.concatenate(ours)[None], np.concatenate(truth)[None]
    return nrms(a, b, np.ones(a.shape[:2], dtype=bool))


def cost(args: argparse.Namespace) -> dict[str, Any]:
    """Runs in processes of their own, by turns."""
    with tempfile.TemporaryDirectory() as place:
        work = Path(place)
        capture(work / "clean", "peanut", 0)
        runs = []
        for _ in range(REPEATS):
            for robust in (True, False):
                command = [sys.executable, __file__, "--one", str(work), "--robust" if robust else "--plain"]
                done = subprocess.run(command, capture_output=True, text=True, check=True)
                runs.append({"robust": robust} | json.loads(done.stdout))
                print(runs[-1], flush=True)
        same = all(
            (work / "robust" / name).read_bytes() == (work / "plain" / name).read_bytes()
            for name in ("blend.exr", "mesh.obj")
        )
        both = [json.loads((work / name / "svbrdf.json").read_text()) for name in ("robust", "plain")]
        same &= both[0]["representatives"] == both[1]["representatives"]

    def ratio(key: str) -> float:
        on, off = ([run[key] for run in runs if run["robust"] is robust] for robust in (True, False))
        return float(np.min(on) / np.min(off))

    return {"runs": runs, "time": ratio("cpu_seconds"), "memory": ratio("peak_mb"), "same": same}


def one(work: Path, robust: bool) -> None:
    """A run of `cost`: its figures as JSON on standard output."""
    start = time.process_time()
    reconstruct_folder(
        work / "clean", work / ("robust" if robust else "plain"), options(robust), viewer=False
    )
    seconds = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"cpu_seconds": seconds, "peak_mb": peak}))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, help="folder with envmaps/latlong; procedural lights without it")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--shapes", nargs="+", default=["peanut", "sphere"], help="of the spoilt captures")
    parser.add_argument("--texels", type=int, default=2000, help="of the noise table's sphere")
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--robust", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--plain", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        one(args.one, args.robust)
        return
    figures: dict[str, Any] = {}
    if args.json and args.json.exists():
        figures = json.loads(args.json.read_text())
    figures["sources"] = figures.get("sources", {})
    for part in args.only:
        figures[part] = {"noise": noise, "weighed": weighed, "outliers": outliers, "cost": cost}[part](args)
        figures["sources"][part] = {
            "command": results.command(),
            "commit": results.COMMIT,
            "date": time.strftime("%Y-%m-%d"),
            "lights": "Grace, Uffizi" if args.data else "procedural room, sky",
            "texels": args.texels,
        }
        results.write(args.json, figures)


if __name__ == "__main__":
    main()

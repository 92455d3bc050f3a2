# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What each stage does a second beside what limits it, through the Python API.

    python scripts/bench/stages.py --json target/bench/stages.json
    python scripts/bench/stages.py --only respond gram --threads 1

read     photographs, in bytes of their EXR files a second; limit: reading the same bytes from the page cache
respond  generic responses of the extended basis, in environment lookups a second; limit: bare lookups (the
         criterion bench of bare lookups, on one thread, times the threads; absent until `cargo bench` ran)
gram     normal equations of blends of n=3, in GFLOP/s of the block products that occur; limit: one dense
         product of single precision by NumPy's BLAS
blend    exact blends with the n, N and k of Table 1's rows, in texels a second; supports visited beside brute
         force's count, and relaxations a texel
hard     the same at n=5, N=18, ten views or so a texel, --texels texels in all: seconds

Blends: texels of a sphere seen by random views; GGX truth with a Smith masking and 1 % noise, representatives
of Beckmann lobes, so that no blend fits exactly. Rates are the best of --repeats, but `blend` and `hard` run
once. Finished parts stay in target/bench/stages; delete a file to repeat it.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from math import comb
from pathlib import Path
from typing import Any

import scenes
import shared
from shared import results

from swatchwork.reproduce import objects

PARTS = ("read", "respond", "gram", "blend", "hard")
CRITERION = results.ROOT / "target" / "criterion"
TILE = 40_000
"""Texels blended at a time: the package blends by tiles, too."""
PRICED_TEXELS = 20_000
"""In `blend`, for each row."""


def best(repeats: int, work: Callable[[], Any]) -> float:
    """Seconds of the fastest run."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


# ---- limits --------------------------------------------------------------------------------------
def criterion_rates(folder: Path = CRITERION) -> dict[str, float]:
    """Elements (or bytes) a second of each criterion bench that states a throughput, by its id."""
    found = {}
    for file in sorted(folder.glob("**/new/benchmark.json")):
        described = json.loads(file.read_text(encoding="utf-8"))
        throughput = described.get("throughput") or {}
        amount = next((v for v in throughput.values() if isinstance(v, int | float)), None)
        if amount:
            estimates = json.loads(file.with_name("estimates.json").read_text(encoding="utf-8"))
            seconds = (estimates.get("slope") or estimates["mean"])["point_estimate"] * 1e-9
            found[described["full_id"]] = amount / seconds
    return found


def bare_lookups_per_second() -> float | None:
    """The limit of `respond` on one thread: the fastest criterion bench of bare lookups; None if not run."""
    rates = [rate for name, rate in criterion_rates().items() if "bare" in name and "lookup" in name]
    return max(rates, default=None)


def blas_gflops(columns: int, repeats: int) -> float:
    """The better of one tall product and one by blocks that stay in cache."""
    import numpy as np

    rows, block = 200_000, 4096
    x = np.random.default_rng(0).random((rows, columns), dtype=np.float32)
    y = x.copy()

    # Of an array with itself NumPy computes half of the product only: so two.
    def blocked() -> None:
        total = np.zeros((columns, columns), np.float32)
        for start in range(0, rows, block):
            total += x[start : start + block].T @ y[start : start + block]

    seconds = min(best(repeats, lambda: x.T @ y), best(repeats, blocked))
    return 2 * rows * columns**2 / seconds / 1e9


# ---- parts ---------------------------------------------------------------------------------------
def read(args: argparse.Namespace) -> dict[str, Any]:
    from swatchwork.capture import read_capture, read_photograph

    frames = read_capture(scenes.capture_of("DustSph", args.size)).frames
    count = sum(frame.image_path.stat().st_size for frame in frames)
    seconds = best(args.repeats, lambda: [read_photograph(frame) for frame in frames])
    plain = best(args.repeats, lambda: [frame.image_path.read_bytes() for frame in frames])
    pixels = sum(frame.camera.width * frame.camera.height for frame in frames)
    return {
        "rate": count / seconds,
        "limit": count / plain,
        "pixel_rate": pixels / seconds,
        "seconds": seconds,
    }


def pairs_on_a_sphere(texels: int, k: int, seed: int) -> tuple[Any, Any, Any, Any]:
    """Points [M, 3] that a view sees; of their pairs normals and directions to the viewer [P, 3]; offsets."""
    import numpy as np

    from swatchwork.arrays import fibonacci_sphere
    from swatchwork.simulate import random_directions

    point = fibonacci_sphere(texels)
    to_viewer = 4 * random_directions(k, seed)[None] - point[:, None]
    to_viewer /= np.linalg.norm(to_viewer, axis=-1, keepdims=True)
    seen = np.einsum("mkx,mx->mk", to_viewer, point) > 0.05
    point, to_viewer, seen = (array[seen.any(axis=1)] for array in (point, to_viewer, seen))
    offsets = np.concatenate([[0], np.cumsum(seen.sum(axis=1))]).astype(np.int64)
    texel, view = np.nonzero(seen)
    return point, point[texel], to_viewer[texel, view], offsets


def respond(args: argparse.Namespace) -> dict[str, Any]:
    from swatchwork.reflectance import basis_by_name
    from swatchwork.response import compiled, generic_responses
    from swatchwork.simulate import procedural_environment

    basis = basis_by_name("extended")
    pyramid = procedural_environment("room", 0, 512).pyramid()
    _, normal, to_viewer, _ = pairs_on_a_sphere(4000, 12, 0)
    seconds = best(args.repeats, lambda: generic_responses(basis, pyramid, normal, to_viewer))
    lookups = compiled(basis).lookups
    bare = bare_lookups_per_second()
    limit = None if bare is None else bare * args.threads
    return {"rate": len(normal) * lookups / seconds, "limit": limit, "lookups": lookups} | {
        "pair_rate": len(normal) / seconds
    }


def gram(args: argparse.Namespace) -> dict[str, Any]:
    import numpy as np

    from swatchwork._native import SolverProblem
    from swatchwork.reflectance import basis_by_name
    from swatchwork.simulate import blend_pattern, dense_weights

    n, N, J = 3, 9, basis_by_name("extended").kernels
    point, normal, _, offsets = pairs_on_a_sphere(4000, 26, 0)
    rng = np.random.default_rng(0)
    responses = rng.random((len(normal), J, 3), dtype=np.float32)
    radiance = rng.random((len(normal), 3), dtype=np.float32)
    problem = SolverProblem(responses, radiance, offsets, np.full(len(point), 1e-3))
    weights = dense_weights(*blend_pattern(point, materials=N, blended=n, patches=5.0), N)
    seconds = best(args.repeats, lambda: problem.normal_equations(weights, 0))
    # Equivalent work: blocks of the pairs of representatives that share a texel, in three channels. The
    # kernel does less (a texel's views once for all pairs, upper tiles), so this can pass the limit.
    flops = 2 * len(normal) * J**2 * n * (n + 1) / 2 * 3
    return {"rate": flops / seconds, "limit": blas_gflops(J, args.repeats) * 1e9, "J": J}


def mixed(n: int, N: int, k: int, texels: int) -> tuple[Any, Any, Any]:
    """Responses [P, N, 3] of representatives, noise-free radiance [P, 3] of other lobes' blends; offsets."""
    import numpy as np

    from swatchwork.reflectance import paper
    from swatchwork.response import representative_responses
    from swatchwork.simulate import (
        blend_pattern,
        dense_weights,
        ggx_basis,
        in_basis,
        in_ggx,
        many_materials,
        procedural_environment,
    )

    point, normal, to_viewer, offsets = pairs_on_a_sphere(texels, k, 0)
    recipes, light = many_materials(N, 0), procedural_environment("room", 0).pyramid()

    def responses(basis: Any, representatives: Any) -> Any:
        return representative_responses(basis, representatives, light, normal, to_viewer)

    truth = responses(ggx_basis(objects.MASKING), in_ggx(recipes, objects.MASKING))
    full = dense_weights(*blend_pattern(point, materials=N, blended=n, patches=5.0), N)
    weights = np.repeat(full, np.diff(offsets), axis=0)
    return responses(paper(), in_basis(recipes, paper())), np.einsum("pn,pnc->pc", weights, truth), offsets


def noisy(radiance: Any, seed: int) -> Any:
    import numpy as np

    noise = 1 + objects.NOISE_PERCENT / 100 * np.random.default_rng(seed).normal(size=radiance.shape)
    return (radiance * noise).astype(np.float32)


def brute_force(n: int, N: int) -> int:
    """Supports a texel that brute force visits."""
    return sum(comb(N, i) for i in range(1, n + 1))


def blend(args: argparse.Namespace) -> dict[str, Any]:
    from swatchwork.solve import blend as blended

    found = []
    for row in objects.TABLE:
        responses, radiance, offsets = mixed(row.n, row.N, row.k, PRICED_TEXELS)
        radiance = noisy(radiance, 0)
        start = time.perf_counter()
        answer = blended(responses, radiance, offsets, row.n)
        seconds, texels = time.perf_counter() - start, len(offsets) - 1
        each = answer.visited / texels
        of = {"name": row.name, "k": row.k, "n": row.n, "N": row.N, "rate": texels / seconds}
        found.append(of | {"relaxations": each, "share": each / brute_force(row.n, row.N)})
    return {"rows": found}


def hard(args: argparse.Namespace) -> dict[str, Any]:
    """Tiles differ in their noise; only the blends are timed."""
    from swatchwork.solve import blend as blended

    n, N = 5, 18
    tile = min(TILE, args.texels)
    responses, radiance, offsets = mixed(n, N, 21, tile)
    seconds, visited, texels = 0.0, 0, 0
    for number in range(-(-args.texels // tile)):
        measured = noisy(radiance, number)
        start = time.perf_counter()
        answer = blended(responses, measured, offsets, n)
        seconds += time.perf_counter() - start
        visited, texels = visited + answer.visited, texels + len(offsets) - 1
    each = visited / texels
    found = {
        "n": n,
        "N": N,
        "texels": texels,
        "views": len(radiance) / (len(offsets) - 1),
        "seconds": seconds,
    }
    found |= {"rate": texels / seconds, "relaxations": each, "share": each / brute_force(n, N)}
    return found | {"seconds_a_million": 1e6 * seconds / texels}


# ---- report --------------------------------------------------------------------------------------
def limit_rows(parts: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Rates beside limits, of the parts that have one."""
    units = {"read": ("MB/s", 1e6), "respond": ("M lookups/s", 1e6), "gram": ("GFLOP/s", 1e9)}
    rows = []
    for name, (unit, scale) in units.items():
        if name not in parts:
            continue
        rate, limit = parts[name]["rate"], parts[name]["limit"]
        share = f"{100 * rate / limit:.0f} %" if rate and limit else "-"
        rows.append(
            [name, unit, *(f"{x / scale:.1f}" if x else "not measured" for x in (rate, limit)), share]
        )
    return rows


def blend_rows(parts: dict[str, dict[str, Any]]) -> list[list[str]]:
    rows = list(parts.get("blend", {}).get("rows", ()))
    if "hard" in parts:
        rows.append({"name": f"{parts['hard']['texels']:,} texels", "k": "-"} | parts["hard"])
    return [
        [
            row["name"],
            str(row["k"]),
            f"{row['n']}, {row['N']}",
            f"{row['rate']:.0f}",
            f"{row['relaxations']:.1f}",
            f"{100 * row['share']:.2f}",
        ]
        for row in rows
    ]


LIMIT_HEAD = ["stage", "unit", "here", "limit", "share"]
BLEND_HEAD = ["blend", "k", "n, N", "texels/s", "relaxations a texel", "% of brute force's"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--threads", type=int, default=shared.cores(), help="of the Rust core")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--texels", type=int, default=1_000_000, help="of `hard`")
    parser.add_argument("--size", type=int, default=1024, help="pixels along an image's side, of `read`")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--part", choices=PARTS, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.part:
        print(json.dumps(globals()[args.part](args)))
        return
    parts: dict[str, dict[str, Any]] = {}
    options = [f"--{name}={getattr(args, name)}" for name in ("threads", "repeats", "texels", "size")]
    for part in args.only:
        amount = {"hard": f"-{args.texels}", "read": f"-{args.size}"}.get(part, "")
        file = shared.BENCH / "stages" / f"{part}{amount}-{args.threads}.json"

        def measure(part: str = part) -> dict[str, Any]:
            # In a process of its own: the core makes its threads once.
            command = [sys.executable, __file__, "--part", part, *options]
            found, cost = shared.run(command, {"RAYON_NUM_THREADS": str(args.threads)})
            return found | {"commit": results.commit(), "peak_mb": cost.peak_mb}

        parts[part] = shared.kept(file, measure)
    print(results.table(LIMIT_HEAD, limit_rows(parts)), end="\n\n")
    print(results.table(BLEND_HEAD, blend_rows(parts)))
    if "hard" in parts:
        print(f"\nhard: {parts['hard']['seconds']:.1f} s for {parts['hard']['texels']:,} texels")
    shared.write(args.json, {"threads": args.threads, "parts": parts, "criterion": criterion_rates()})


if __name__ == "__main__":
    main()

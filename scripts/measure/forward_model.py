# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Measure the rendering operator against brute-force quadrature, kernel by kernel.

Real probes (latitude-longitude, from --data) light random (normal, viewer) pairs with n.o > 0.1. The
reference looks the original raster up bilinearly, so that the octahedral resampling counts as error
too. Lobes with sigma < 0.09 are sampled at the quantiles of their own distribution, 384 x 384
half-vectors a pair and roughness. That grid is coarser than a texel in wider lobes, and then misses
the texels that matter; those and the diffuse kernels are summed over every texel instead. Prints the
NRMS of each kernel and probe, and the lookups that a pair costs.

    python scripts/measure/forward_model.py --data FOLDER [--seeds 7 8 9] [--cache FOLDER] [--alternatives]

A few grazing views of a bright spot hold most of the energy of a sharp kernel, so that 400 pairs are too
few to judge by: their worst kernel differs two- to fourfold from seed to seed. The reference takes about 15
minutes of one core for 400 pairs; --cache keeps it.
"""

from __future__ import annotations

import argparse
import hashlib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import results

from swatchwork._native import Pyramid
from swatchwork.arrays import F32, F64, Float, unit
from swatchwork.light import Environment
from swatchwork.reflectance import DIFFUSE_KERNELS, GenericBasis, masking_value
from swatchwork.response import DEFAULT_QUADRATURE, Quadrature, generic_responses, log_rings

MASKINGS, POWERS = ("vgroove", "smith:0.2", "smith:1"), (5, 2, 0)
BASIS = GenericBasis("every kernel", maskings=MASKINGS, diffuse=tuple(DIFFUSE_KERNELS), fresnel=POWERS)
SIGMAS = BASIS.sigmas
SIDE, BROAD, CHUNK = 384, 0.09, 1 << 14


def probes(folder: Path) -> dict[str, F32]:
    """Linear RGB rasters by name."""
    files = sorted(folder.glob("*.hdr"))
    return {f.stem.split("_")[0]: cv2.imread(str(f), cv2.IMREAD_UNCHANGED)[..., ::-1].copy() for f in files}


def random_pairs(count: int, seed: int) -> tuple[F64, F64]:
    """Normals and viewers, uniform on the sphere with n.o > 0.1."""
    rng = np.random.default_rng(seed)
    n, o = unit(rng.normal(size=(20 * count, 3))), unit(rng.normal(size=(20 * count, 3)))
    keep = np.flatnonzero(np.sum(n * o, axis=1) > 0.1)[:count]
    return n[keep], o[keep]


def corners(d: Float, height: int, width: int) -> tuple[F64, F64]:
    """Four texel numbers and bilinear weights [4, K] of directions [K, 3], texel centres at +0.5."""
    column = (np.arctan2(d[:, 0], -d[:, 2]) / (2 * np.pi) + 0.5) * width - 0.5
    row = np.clip(np.arccos(np.clip(d[:, 1], -1, 1)) / np.pi * height - 0.5, 0, height - 1)
    j = np.minimum(row.astype(np.int64), height - 2)
    i = np.floor(column).astype(np.int64)
    q, p = row - j, column - i
    left, right = i % width, (i + 1) % width
    texel = np.stack([j * width + left, j * width + right, (j + 1) * width + left, (j + 1) * width + right])
    return texel, np.stack([(1 - p) * (1 - q), p * (1 - q), (1 - p) * q, p * q])


def gather(raster: F32, height: int, d: F64, weights: F64) -> F64:
    """Sums [W, C] over directions [K, 3] of weights [W, K] times the raster [H * W, C] looked up."""
    total = np.zeros((len(weights), raster.shape[1]))
    for start in range(0, len(d), CHUNK):
        part = slice(start, start + CHUNK)
        texel, bilinear = corners(d[part], height, len(raster) // height)
        for k in range(4):
            total += (weights[:, part] * bilinear[k]).astype(np.float32) @ raster[texel[k]]
    return total


def frame(n: F64, o: F64) -> tuple[F64, F64]:
    """Rows x, y, n of the local frame in the world, and the viewer in it."""
    cosine = float(n @ o)
    x = unit(o - cosine * n)
    return np.stack([x, np.cross(n, x), n]), np.array([np.sqrt(max(0.0, 1 - cosine**2)), 0.0, cosine])


def sharp_lobe(raster: F32, height: int, sigma: float, axes: F64, viewer: F64) -> F64:
    """Responses [masking and Fresnel power, C] of one roughness, by quantiles of its distribution."""
    quantile = (np.arange(SIDE) + 0.5) / SIDE
    t, phi = (sigma * np.sqrt(-np.log1p(-quantile)))[:, None], 2 * np.pi * quantile
    n_h = 1 / np.sqrt(1 + t * t)
    h = np.stack(np.broadcast_arrays(t * n_h * np.cos(phi), t * n_h * np.sin(phi), n_h), -1).reshape(-1, 3)
    o_h = h @ viewer
    i = 2 * o_h[:, None] * h - viewer
    lit = (o_h > 0) & (i[:, 2] > 0)
    h, o_h, i = h[lit], o_h[lit], i[lit]
    value = o_h / (viewer[2] * h[:, 2]) / SIDE**2
    shadowed = [masking_value(m, i[:, 2], viewer[2], o_h, h[:, 2]) * value for m in MASKINGS]
    weights = np.stack([g * (1 - o_h) ** power for g in shadowed for power in POWERS])
    return gather(raster, height, i @ axes, weights)


def every_texel(raster: F32, texels: tuple[F64, F64], kernels: list[int], axes: F64, viewer: F64) -> F64:
    """Responses [kernels, C] of broad kernels, as sums over all texels above the horizon."""
    direction, solid_angle = texels
    above = np.flatnonzero(direction @ axes[2] > 0)
    total = np.zeros((len(kernels), raster.shape[1]))
    for start in range(0, len(above), CHUNK):
        part = above[start : start + CHUNK]
        i = direction[part] @ axes.T
        values = BASIS.evaluate(i, viewer, kernels)
        total += (values * (i[:, 2] * solid_angle[part])[:, None]).T @ raster[part]
    return total


def pair_reference(raster: F32, height: int, texels: tuple[F64, F64], n: F64, o: F64, every: int) -> F64:
    """Responses [J, C] of BASIS for one pair (Eqs. 1, 8 to 11)."""
    axes, viewer = frame(n, o)
    out = np.zeros((BASIS.kernels, raster.shape[1]))
    count = len(SIGMAS)
    rows = np.arange(len(POWERS) * len(MASKINGS)) * count
    measured = list(range(count))[::-every]
    for s in measured:
        if SIGMAS[s] < BROAD:
            out[rows + s] = sharp_lobe(raster, height, float(SIGMAS[s]), axes, viewer)
    broad = [int(row + s) for s in measured if SIGMAS[s] >= BROAD for row in rows]
    broad += range(len(BASIS.lobes), BASIS.kernels)
    out[broad] = every_texel(raster, texels, broad, axes, viewer)
    return out


def texel_directions(height: int, width: int) -> tuple[F64, F64]:
    """Directions [H * W, 3] and solid angles [H * W] of a raster's texels."""
    theta = ((np.arange(height) + 0.5) / height * np.pi)[:, None]
    phi = ((np.arange(width) + 0.5) / width * 2 - 1) * np.pi
    d = np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi))
    area = 4 * np.pi / width * np.sin(np.pi / height / 2) * np.sin(theta)
    return np.stack(d, -1).reshape(-1, 3), np.broadcast_to(area, (height, width)).reshape(-1)


def _task(args: tuple[F32, int, F64, F64, int]) -> F64:
    raster, height, normals, viewers, every = args
    texels = texel_directions(height, len(raster) // height)
    pairs = zip(normals, viewers, strict=True)
    return np.stack([pair_reference(raster, height, texels, n, o, every) for n, o in pairs])


def reference(rasters: list[F32], n: F64, o: F64, processes: int, every: int) -> F64:
    """Responses [P, J, probe, 3], computed in parallel."""
    height = len(rasters[0])
    stacked = np.concatenate([r.reshape(-1, 3) for r in rasters], axis=1)
    parts = np.array_split(np.arange(len(n)), processes)
    with ProcessPoolExecutor(processes) as pool:
        done = pool.map(_task, [(stacked, height, n[p], o[p], every) for p in parts])
        return np.concatenate(list(done)).reshape(len(n), BASIS.kernels, len(rasters), 3)


def errors(pyramids: list[Pyramid], quadrature: Quadrature, n: F64, o: F64, truth: F64) -> F64:
    """NRMS [J, probe] over pairs and channels."""
    found = [generic_responses(BASIS, pyramid, n, o, quadrature=quadrature) for pyramid in pyramids]
    difference = np.stack(found, axis=2) - truth
    scale = np.sum(truth**2, axis=(0, 3))
    error = np.sqrt(np.sum(difference**2, axis=(0, 3)) / np.where(scale > 0, scale, 1.0))
    return np.where(scale > 0, error, np.nan)


def worst(error: F64) -> list[float]:
    """NRMS of the worst kernels: sigma below 0.1, other specular ones, diffuse ones."""
    count = len(BASIS.lobes)
    sharp = np.array([lobe.sigma < 0.1 for lobe in BASIS.lobes])
    return [float(np.nanmax(e)) for e in (error[:count][sharp], error[:count][~sharp], error[count:])]


def summary(error: F64) -> str:
    """The worst kernels in percent."""
    return "  ".join(f"{100 * e:6.2f}" for e in worst(error))


def print_table(names: list[str], error: F64) -> None:
    """NRMS in percent of each kernel and probe, and the worst ones."""
    print(f"{'kernel':32}" + "".join(f"{name:>11}" for name in names))
    labels = [f"{m} power={p} sigma={s:.4f}" for m, p, s in BASIS.lobes] + list(BASIS.diffuse)
    for label, row in zip(labels, error, strict=True):
        print(f"{label:32}" + "".join(f"{100 * e:11.3f}" for e in row))
    print(f"worst (sigma < 0.1, rest, diffuse): {summary(error)} %")


def alternatives() -> dict[str, Quadrature]:
    """Other quadratures; the first ones look up the whole environment at every roughness."""
    bins, never = DEFAULT_QUADRATURE.bins, (9.0, 9.0)
    idle = log_rings(0.1, 0.2, 2, 2)
    found = {}
    for count, azimuths in ((32, 8), (48, 12), (48, 16), (64, 24), (64, 48), (96, 32), (96, 72)):
        rings = log_rings(4e-4, 1.6, count, azimuths)
        found[f"one layer, {count} x {azimuths}"] = Quadrature((rings, idle, idle), never, bins)
    sharp, middle, broad = DEFAULT_QUADRATURE.layers
    bounds = DEFAULT_QUADRATURE.bounds
    found["three layers, the default"] = DEFAULT_QUADRATURE
    fewer = log_rings(0.007, 0.32, 18, 32), log_rings(0.025, 1.5, 18, 32, blur=3.0)
    found["three layers, fewer in the broader two"] = Quadrature((sharp, *fewer), bounds, bins)
    even = log_rings(4e-4, 0.12, 34, 24)
    found["three layers, 24 on every sharp ring"] = Quadrature((even, middle, broad), bounds, bins)
    more = (
        log_rings(4e-4, 0.12, 48, 48),
        log_rings(0.005, 0.35, 32, 64),
        log_rings(0.016, 1.8, 32, 72, blur=2.0),
    )
    found["three layers, more in each"] = Quadrature(more, bounds, bins)
    return found


def print_alternatives(pyramids: list[Pyramid], n: F64, o: F64, truth: F64) -> None:
    """Worst NRMS in percent (sigma < 0.1, broader, diffuse) over probes and kernels, beside the lookups."""
    print(f"{'quadrature':42}{'lookups':>8}  worst: sharp, broad, diffuse")
    for name, quadrature in alternatives().items():
        found = summary(errors(pyramids, quadrature, n, o, truth))
        lookups = sum(r.azimuths.sum() for r in quadrature.layers if r.azimuths.size > 2)
        print(f"{name:42}{lookups:8}  {found}", flush=True)


def pairs_and_truth(args: argparse.Namespace, seed: int, rasters: list[F32]) -> tuple[F64, F64, F64]:
    """Normals, viewers and reference responses of one seed's pairs."""
    n, o = random_pairs(args.pairs, seed)
    # The reference depends on the rasters and on everything above, of which the basis is the rest.
    made_from = [r.tobytes() for r in rasters] + [repr((BASIS, SIDE, BROAD, args.every)).encode()]
    digest = hashlib.sha256(b"".join(made_from)).hexdigest()[:12]
    file = args.cache / f"forward-{seed}-{args.pairs}-{digest}.npz" if args.cache else None
    if file and file.exists():
        return n, o, np.load(file)["truth"]
    truth = reference(rasters, n, o, args.processes, args.every)
    if file:
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(file, truth=truth)
    return n, o, truth


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of latitude-longitude .hdr probes")
    parser.add_argument("--seeds", type=int, nargs="+", default=[7, 8, 9], help="of the pairs")
    parser.add_argument("--pairs", type=int, default=400, help="for each seed")
    parser.add_argument("--cache", type=Path, help="keep the references in this folder")
    parser.add_argument("--every", type=int, default=1, help="measure only every so manieth roughness")
    parser.add_argument("--alternatives", action="store_true", help="measure other quadratures too")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", type=Path, help="write the figures here")
    args = parser.parse_args()
    rasters = probes(args.data)
    # The folder's convention is Mitsuba's, turned by half a turn about y.
    turn = np.diag([-1.0, 1.0, -1.0])
    pyramids = [Environment(raster, "mitsuba", turn).pyramid() for raster in rasters.values()]
    of_seeds = [pairs_and_truth(args, seed, list(rasters.values())) for seed in args.seeds]
    n, o, truth = (np.concatenate(parts) for parts in zip(*of_seeds, strict=True))
    error = errors(pyramids, DEFAULT_QUADRATURE, n, o, truth)
    print_table(list(rasters), error)
    each = [errors(pyramids, DEFAULT_QUADRATURE, *part) for part in of_seeds]
    for seed, part in zip(args.seeds, each, strict=True):
        print(f"seed {seed} alone: {summary(part)} %")
    lights = [p.lights for p in pyramids]
    print(f"lookups a pair: {DEFAULT_QUADRATURE.lookups}; point lights: {lights}")
    figures = {
        "probes": list(rasters),
        "pairs": len(n),
        "worst": {name: worst(error[:, [k]]) for k, name in enumerate(rasters)},
        "seeds": {seed: worst(part) for seed, part in zip(args.seeds, each, strict=True)},
        "lookups": DEFAULT_QUADRATURE.lookups,
        "lights": [int(np.sum(count)) for count in lights],
    }
    results.write(args.json, figures)
    if args.alternatives:
        print_alternatives(pyramids, n, o, truth)


if __name__ == "__main__":
    main()

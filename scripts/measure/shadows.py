# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What sharing self-shadow masks costs in error, and what finer ones cost in time.

    python scripts/measure/shadows.py --captures ../shared/captures --json target/validation/shadows.json

Irradiance under the capture's own light at 1000 texels of a 512 x 512 atlas, from the masks of so many shared
samples, against masks of their own with every cell traced. Columns: NRMS in %, of all texels and of the 950
nearest the truth; seconds of wall and CPU time; megabytes of masks.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import results

from swatchwork.capture import read_capture
from swatchwork.observe import Lights
from swatchwork.octahedral import pixel_directions
from swatchwork.reconstruct import surface_of
from swatchwork.surface import Atlas, RayScene, SkyMasks, build_atlas, sky, sky_masks

NAMES = ("igea-merl", "spot-merl-interreflect")
RESOLUTION, TEXELS = 512, 1000
SAMPLES = (0, 8_000, 32_000, 64_000, 128_000)


def irradiance(masks: SkyMasks, texel: np.ndarray, cosine: np.ndarray, light: np.ndarray) -> np.ndarray:
    """[T, 3] of texels whose cosines to the cells are [T, 4096]."""
    row = masks.of_texel[texel]
    octets = masks.words.astype("<u8").view(np.uint8).reshape(len(masks.words), 512)
    free = np.unpackbits(octets[np.maximum(row, 0)], axis=1, bitorder="little").astype(bool)
    return (cosine * (free | (row < 0)[:, None])) @ light


def truth(scene: RayScene, atlas: Atlas, texel: np.ndarray) -> SkyMasks:
    """Masks of these texels alone, every cell traced."""
    picked = {name: getattr(atlas, name)[texel] for name in ("pixel", "face")}
    first, sky.FIRST_LEVEL = sky.FIRST_LEVEL, len(texel)
    try:
        return sky_masks(scene, replace(atlas, **picked), len(texel))
    finally:
        sky.FIRST_LEVEL = first


def measure(folder: Path) -> list[dict[str, Any]]:
    """A row for each number of samples."""
    capture = read_capture(folder)
    mesh, scene, _ = surface_of(capture, RESOLUTION)
    atlas = build_atlas(mesh, RESOLUTION)
    environment, turn, _ = next(iter(Lights.of_capture(capture).groups()))
    directions = pixel_directions(64).reshape(-1, 3)
    light = environment.rotated(turn).lookup(directions).astype(np.float64)
    texel = np.random.default_rng(0).choice(len(atlas), TEXELS, replace=False)
    cosine = np.maximum(atlas.normal(texel) @ directions.T, 0)
    wanted = irradiance(truth(scene, atlas, texel), np.arange(TEXELS), cosine, light)
    rows = []
    for samples in SAMPLES:
        wall, cpu = time.perf_counter(), time.process_time()
        if samples:
            masks = sky_masks(scene, atlas, samples)
        else:
            masks = SkyMasks(np.zeros((1, 64), np.uint64), np.full(len(atlas), -1, np.int32))
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        off = ((irradiance(masks, texel, cosine, light) - wanted) ** 2).sum(axis=1)
        most = np.sort(off)[: int(0.95 * TEXELS)].sum()
        nrms, nearest = (float(np.sqrt(o / (wanted**2).sum())) for o in (off.sum(), most))
        cost = {"wall_s": wall, "cpu_s": cpu, "mb": masks.words.nbytes / 1e6}
        rows.append({"capture": folder.name, "samples": samples, "nrms": nrms, "nearest": nearest} | cost)
    return rows


HEAD = ["capture", "samples", "NRMS", "nearest 95 %", "wall", "cpu", "MB"]


def row(r: dict[str, Any]) -> list[str]:
    percent = (f"{100 * r['nrms']:.2f}", f"{100 * r['nearest']:.3f}")
    return [
        r["capture"],
        str(r["samples"]),
        *percent,
        f"{r['wall_s']:.1f}",
        f"{r['cpu_s']:.1f}",
        f"{r['mb']:.0f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, required=True, help="folder of capture folders")
    parser.add_argument("--json", type=Path, help="write the figures here")
    args = parser.parse_args()
    rows = [row for name in NAMES for row in measure(args.captures / name)]
    print(results.table(HEAD, [row(r) for r in rows]))
    results.write(args.json, {"rows": rows})


if __name__ == "__main__":
    main()

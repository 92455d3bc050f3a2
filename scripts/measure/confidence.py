# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whether the error that is expected of a texel ranks its actual one, under light that was not measured.

    python scripts/measure/confidence.py --data ../shared/data --captures ../shared/captures \\
        --json target/validation/confidence.json

Three simulated captures (six GGX materials beyond the basis, two blended at a point, 2 % noise) and
igea-merl. Actual: the relative error of a texel's response under the novel light towards random viewers about
its normal, from the true materials and weights, without self-shadowing. Texels that at least one view sees;
Spearman's rank correlation, texel by texel, and over neighbourhoods of nine texels (root mean square of
both), beside that of the number of views and of the residual. How far a ranking can go that knows neither
viewers nor light: the correlation of the actual error with itself, between one half of the viewers and the
other ("halves"), and between the novel light and the capture's, towards the same viewers ("own light").
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import results
from scipy.spatial import cKDTree
from scipy.stats import spearmanr

from swatchwork.capture import read_capture
from swatchwork.light import Environment
from swatchwork.material import dense, material_maps
from swatchwork.observe import Lights
from swatchwork.reconstruct import ReconstructOptions
from swatchwork.response import representative_responses
from swatchwork.simulate import (
    blend_pattern,
    dense_weights,
    ggx_basis,
    in_ggx,
    many_materials,
    measured_responses,
    read_neural_brdf,
    simulate_capture,
)
from swatchwork.surface import Atlas
from swatchwork.workflow.recovery import recover

Figures = dict[str, Any]
Truth = Callable[[Atlas, np.ndarray, Environment, np.ndarray, np.ndarray], np.ndarray]
"""Radiance [P, 3] of texels [P] of an atlas under a light, from normals and directions to viewers [P, 3]."""
SEED, MATERIALS, BLENDED, PATCHES, NOISE = 3, 6, 2, 5.0, 2.0
MASKING = "smith:0.3"
SCENES = {"blob": (48, 5), "sphere": (64, 6), "knot": (40, 10)}
"""Rows of the shape's grid, and photographs."""
TEXELS, VIEWERS = 6000, 6
RADIANCE_AT_ONCE = 1 << 13
FLOOR = 0.05
"""Of the typical response: darker ones count as that bright."""
NINE = 9
HEAD = (
    "capture",
    "k",
    "n, N",
    "texels",
    "expected",
    "views",
    "residual",
    "expected, nine",
    "views, nine",
    "halves",
    "own light",
    "rms expected",
    "rms actual",
)


@dataclass(frozen=True)
class Case:
    name: str
    folder: Path
    resolution: int
    truth: Truth


def simulated(name: str, folder: Path) -> Case:
    """A capture of one of the scenes, and its truth."""
    rows, k = SCENES[name]
    recipes = many_materials(MATERIALS, SEED)
    simulate_capture(
        folder,
        object_shape=name,
        rows=rows,
        k=k,
        test_views=1,
        size=256,
        seed=SEED,
        truth="ggx",
        masking=MASKING,
        recipes=recipes,
        materials=MATERIALS,
        blended=BLENDED,
        patches=PATCHES,
        noise_percent=NOISE,
    )
    representatives = in_ggx(recipes, MASKING)

    def truth(
        atlas: Atlas, texel: np.ndarray, light: Environment, normal: np.ndarray, to_viewer: np.ndarray
    ) -> np.ndarray:
        pattern = blend_pattern(
            atlas.position(texel), materials=MATERIALS, blended=BLENDED, seed=SEED, patches=PATCHES
        )
        made = representative_responses(
            ggx_basis(MASKING), representatives, light.pyramid(), normal, to_viewer
        )
        return np.einsum("pnc,pn->pc", made, dense_weights(*pattern, MATERIALS))

    return Case(name, folder, 128, truth)


def igea(captures: Path, data: Path) -> Case:
    """The scan, with its measured materials."""
    folder = captures / "igea-merl"
    known = np.load(folder / "truth" / "weights.npz", allow_pickle=False)
    brdfs = [read_neural_brdf(data / "merl" / "merl_nbrdf.npz", str(m)) for m in known["materials"]]

    def truth(
        atlas: Atlas, texel: np.ndarray, light: Environment, normal: np.ndarray, to_viewer: np.ndarray
    ) -> np.ndarray:
        scale = len(known["index"]) / atlas.resolution
        at = tuple(((x[texel] + 0.5) * scale).astype(int) for x in (atlas.row, atlas.col))
        weights = dense(known["index"][at], known["weight_255"][at] / 255.0, len(brdfs))
        made = measured_responses(brdfs, light, normal, to_viewer)
        return np.einsum("pbc,pb->pc", made, weights)

    return Case("igea-merl", folder, 256, truth)


def measure(case: Case, work: Path) -> Figures:
    """Reconstruct, and rank."""
    found = recover(case.folder, work / "material", ReconstructOptions(resolution=case.resolution))
    atlas, coverage = found.reconstruction.observations.atlas, found.reconstruction.observations.coverage
    light, own_light = (
        Lights.of_capture(read_capture(case.folder / x)).environments[0] for x in ("test", "")
    )
    rng = np.random.default_rng(0)
    seen = np.flatnonzero(coverage)
    texel = np.sort(rng.choice(seen, min(TEXELS, len(seen)), replace=False))
    position, normal = atlas.points(texel)
    # About the normal, by its cosine.
    d = rng.normal(size=(len(texel), VIEWERS, 3))
    viewer = normal[:, None] + 0.97 * d / np.linalg.norm(d, axis=2, keepdims=True)
    viewer = (viewer / np.linalg.norm(viewer, axis=2, keepdims=True)).reshape(-1, 3).astype(np.float32)
    each, normals = np.repeat(texel, VIEWERS), np.repeat(normal, VIEWERS, axis=0)
    m = found.material
    pixel = atlas.pixel[each]
    weights = dense(m.index.reshape(-1, m.n)[pixel], m.weight.reshape(-1, m.n)[pixel], m.N)
    actual = {}
    for name, lit in (("novel", light), ("own", own_light)):
        ours, true = np.empty((len(each), 3)), np.empty((len(each), 3))
        for start in range(0, len(each), RADIANCE_AT_ONCE):
            part = slice(start, start + RADIANCE_AT_ONCE)
            made = representative_responses(
                found.reconstruction.basis, m.representatives, lit.pyramid(), normals[part], viewer[part]
            )
            ours[part] = np.einsum("pnc,pn->pc", made, weights[part])
            true[part] = case.truth(atlas, each[part], lit, normals[part], viewer[part])
        ours, true = (x.reshape(len(texel), VIEWERS, 3) for x in (ours, true))
        actual[name] = relative_error(ours, true)
        if name == "novel":
            halves = [relative_error(ours[:, i::2], true[:, i::2]) for i in range(2)]
    novel = actual["novel"]
    expected = material_maps(m).expected_error.ravel()[atlas.pixel[texel]].astype(np.float64)
    nearest = cKDTree(position).query(position, k=NINE)[1]

    def nine(values: np.ndarray) -> np.ndarray:
        return np.sqrt((values[nearest] ** 2).mean(axis=1))

    few = 1 / coverage[texel].astype(np.float64)
    residual = m.residual.ravel()[atlas.pixel[texel]].astype(np.float64)
    return {
        "capture": case.name,
        "k": len(found.capture.frames),
        "n": m.n,
        "N": m.N,
        "texels": len(texel),
        "expected": rank(expected, novel),
        "views": rank(few, novel),
        "residual": rank(residual, novel),
        "expected_nine": rank(nine(expected), nine(novel)),
        "views_nine": rank(nine(few), nine(novel)),
        "halves": rank(*halves),
        "own_light": rank(actual["own"], novel),
        # Without the hundredth that is largest: highlights at the rim.
        "rms_expected": float(np.sqrt((expected**2).mean())),
        "rms_actual": float(np.sqrt((novel[novel <= np.quantile(novel, 0.99)] ** 2).mean())),
        "seconds": {stage.name: stage.seconds for stage in found.summary.stages},
    }


def relative_error(ours: np.ndarray, true: np.ndarray) -> np.ndarray:
    """[T] of responses [T, V, 3]; dark texels count as a little brighter."""
    squared = ((ours - true) ** 2).sum(axis=(1, 2))
    energy = (true**2).sum(axis=(1, 2))
    return np.asarray(np.sqrt(squared / np.maximum(energy, FLOOR**2 * np.median(energy))))


def rank(a: np.ndarray, b: np.ndarray) -> float:
    return float(spearmanr(a, b).statistic)


def cells(row: Figures) -> list[str]:
    numbers = [
        row[x]
        for x in ("expected", "views", "residual", "expected_nine", "views_nine", "halves", "own_light")
    ]
    return [
        row["capture"],
        str(row["k"]),
        f"{row['n']}, {row['N']}",
        str(row["texels"]),
        *(f"{x:.2f}" for x in numbers),
        f"{100 * row['rms_expected']:.1f} %",
        f"{100 * row['rms_actual']:.1f} %",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, help="folder with merl/, for igea-merl")
    parser.add_argument("--captures", type=Path, help="folder with igea-merl/; simulated ones only without")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        for name in SCENES:
            rows.append(measure(simulated(name, work / name), work / f"of-{name}"))
        if args.data and args.captures:
            rows.append(measure(igea(args.captures, args.data), work / "of-igea"))
    print(results.table(list(HEAD), [cells(row) for row in rows]))
    results.write(args.json, {"rows": rows})


if __name__ == "__main__":
    main()

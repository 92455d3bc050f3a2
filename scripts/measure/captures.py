# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Novel-light error on captures of measured materials, beside its floor, and where the error sits.

Each capture, basis and number of views is reconstructed, relit from test/'s cameras and evaluated, each
by the command line in a process of its own; so is its floor (floor.py). Finished runs are kept in --runs as
JSON and not done again; delete a file to repeat its run.

    python scripts/measure/captures.py --captures ../shared/captures --json captures.json
    python scripts/measure/captures.py --captures ../shared/captures --only sphere-merl --views 12

Columns: NRMS in % over the foreground; inner and rim, n.o above and below 0.2, and the rim's share of the
squared error; unseen, the share of texels that no view sees and of the squared error at them; shut in,
the share of test pixels from which the object hides more than a twentieth of the hemisphere, and of the
error there, where interreflections are.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import results

from swatchwork.capture import Frame, read_capture, read_image, read_photograph
from swatchwork.material import read_material
from swatchwork.octahedral import direction_from_square
from swatchwork.relight import RelitScene
from swatchwork.surface import build_atlas

NAMES = ("sphere-merl", "igea-merl", "spot-merl-interreflect")
BASES = ("paper", "extended")
SHUT_IN = 0.05
"""Share of the cosine-weighted hemisphere that the object hides, above which a texel counts as shut in."""
HERE = Path(__file__).resolve().parent


def run(command: list[str]) -> dict[str, Any]:
    """The JSON that a command of swatchwork prints."""
    tool = str(Path(sys.executable).with_name("swatchwork"))
    done = subprocess.run([tool, *command, "--json", "-q"], stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


# ---- where the error sits ------------------------------------------------------------------------
def hidden_share(scene: RelitScene, normal: np.ndarray) -> np.ndarray:
    """Share [M] of the cosine-weighted hemisphere that the object hides from texels of normals [M, 3]."""
    found = np.zeros(len(normal))
    masked = np.flatnonzero(scene.sky.of_texel >= 0)
    if not len(masked):
        return found
    centre = (np.arange(64) + 0.5) / 64
    cell = direction_from_square(np.stack(np.meshgrid(centre, centre), axis=-1)).reshape(-1, 3)
    octets = scene.sky.words.astype("<u8").view(np.uint8)
    free = np.unpackbits(octets.reshape(len(octets), -1), axis=1, bitorder="little").astype(bool)
    for part in np.array_split(masked, max(1, len(masked) // 4096)):
        cosine = np.maximum(normal[part] @ cell.T, 0)
        blocked = (cosine * ~free[scene.sky.of_texel[part]]).sum(axis=1)
        found[part] = blocked / cosine.sum(axis=1)
    return found


def texels_of(scene: RelitScene, frame: Frame) -> np.ndarray:
    """Texel [H * W] at the pixel centres of a frame; -1 off the object."""
    direction = frame.camera.rays(frame.camera.pixel_centres())
    hit = scene.rays.first_hit(np.broadcast_to(frame.camera.position, direction.shape), direction)
    texel = np.full(len(direction), -1)
    on = np.flatnonzero(hit.mesh == 0)
    uv = scene.mesh.uv[scene.mesh.faces[hit.face[on]]]
    texel[on] = scene.texel_at(np.einsum("pc,pcx->px", hit.bary[on], uv))
    return texel


def breakdown(material_folder: Path, renders: Path, test: Path) -> dict[str, float]:
    """Shares of the pixels and of the squared error at unseen and at shut-in texels; NRMS of each part."""
    material = read_material(material_folder)
    scene = RelitScene.of(material)
    atlas = build_atlas(scene.mesh, material.coverage.shape[0])
    unseen_texel = material.coverage[atlas.row, atlas.col] == 0
    shut_in_texel = hidden_share(scene, atlas.normal(slice(None))) > SHUT_IN
    sums = {name: np.zeros(3) for name in ("all", "unseen", "seen", "shut_in", "open")}
    for frame in read_capture(test).frames:
        photograph = read_photograph(frame)
        b = photograph.radiance.reshape(-1, 3).astype(np.float64)
        a = read_image(renders / Path(frame.name).name).linear.reshape(-1, 3).astype(np.float64)
        used = ((photograph.alpha > 0.5) & photograph.valid).ravel()
        texel = texels_of(scene, frame)
        unseen, shut_in = (of[texel] & (texel >= 0) for of in (unseen_texel, shut_in_texel))
        parts = (np.ones_like(used), unseen, ~unseen, shut_in, ~shut_in)
        for name, part in zip(sums, parts, strict=True):
            here = used & part
            sums[name] += [((a - b)[here] ** 2).sum(), (b[here] ** 2).sum(), here.sum()]
    found: dict[str, float] = {}
    for name, (difference, reference, pixels) in sums.items():
        found[f"{name}_nrms"] = float(np.sqrt(difference / reference)) if reference > 0 else 0.0
        found[f"{name}_error_share"] = float(difference / sums["all"][0])
        found[f"{name}_pixel_share"] = float(pixels / sums["all"][2])
    return found


# ---- runs ----------------------------------------------------------------------------------------
def measure(capture: Path, basis: str, views: int, work: Path) -> dict[str, Any]:
    """Reconstruct, relight, evaluate; then the floor and the breakdown."""
    material, renders, test = work / "material", work / "renders", capture / "test"
    reconstruct = ["reconstruct", str(capture), "-o", str(material), "--basis", basis, "--views", str(views)]
    commit, start = results.commit(), time.perf_counter()
    found = run(reconstruct)
    seconds = time.perf_counter() - start
    relit = run(["relight", str(material), "--cameras", str(test / "transforms.json"), "-o", str(renders)])
    evaluation = run(["evaluate", str(renders), str(test), "--capture"])
    floor_json = work / "floor.json"
    floor = [sys.executable, str(HERE / "floor.py"), "--capture", str(capture), "--basis", basis]
    floor += ["--views", str(views), "--renders", str(work / "floor"), "--json", str(floor_json)]
    subprocess.run(floor, check=True)
    return {
        "capture": capture.name,
        "basis": basis,
        "views": views,
        "commit": commit,
        "seconds": seconds,
        "reconstruct": found,
        "relight": relit,
        "evaluation": evaluation,
        "floor": json.loads(floor_json.read_text()),
        "breakdown": breakdown(material, renders, test),
    }


def row(found: dict[str, Any]) -> list[str]:
    r, e, f, b = (found[key] for key in ("reconstruct", "evaluation", "floor", "breakdown"))

    def percent(*fractions: float) -> str:
        return ", ".join(f"{100 * fraction:.2f}" for fraction in fractions)

    return [
        f"{found['capture']}, {found['basis']}",
        str(found["views"]),
        percent(e["nrms"]),
        percent(f["nrms"]),
        f"{e['nrms'] / f['nrms']:.2f}",
        percent(e["nrms_inner"]),
        percent(f["nrms_inner"]),
        percent(e["nrms_rim"], e["rim_share"]),
        percent(r["unseen"] / r["texels"], b["unseen_error_share"]),
        percent(b["shut_in_pixel_share"], b["shut_in_error_share"]),
        f"{r['n']}, {r['N']}",
        str(r["resolution"]),
        f"{found['seconds']:.0f}",
        f"{r['peak_mb']:.0f}",
    ]


HEAD = ["capture", "k", "NRMS", "floor", "ratio", "inner", "floor inner", "rim, share", "unseen, share"]
HEAD += ["shut in, share", "n, N", "atlas", "s", "MB"]


def finished(runs: Path) -> list[dict[str, Any]]:
    """All runs that are done, in the order of captures, bases, and falling numbers of views."""
    found = [json.loads(file.read_text()) for file in sorted(runs.glob("*.json"))]
    return sorted(found, key=lambda r: (NAMES.index(r["capture"]), BASES.index(r["basis"]), -r["views"]))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, required=True, help="folder of capture folders")
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--basis", nargs="+", choices=BASES, default=BASES)
    parser.add_argument("--views", nargs="+", default=["all", "6", "3", "1"], help="numbers, or all")
    parser.add_argument("--runs", type=Path, default=results.ROOT / "target" / "validation" / "runs")
    parser.add_argument("--json", type=Path, help="write the figures of all finished runs here")
    args = parser.parse_args()
    args.runs.mkdir(parents=True, exist_ok=True)
    for name in args.only:
        capture = (args.captures / name).resolve()
        frames = len(read_capture(capture).frames)
        for basis in args.basis:
            for views in (frames if v == "all" else int(v) for v in args.views):
                key = f"{name}-{basis}-{views}"
                file = args.runs / f"{key}.json"
                if file.exists():
                    continue
                print(f"{key} ...", flush=True)
                figures = measure(capture, basis, views, args.runs / key)
                file.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    done = finished(args.runs)
    print(results.table(HEAD, [row(found) for found in done]))
    results.write(args.json, {"runs": done})


if __name__ == "__main__":
    main()

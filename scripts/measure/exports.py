# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What exports render, against relight, under a light and from cameras that were not captured.

    python scripts/measure/exports.py --captures ../shared/captures --json target/validation/exports.json

Mitsuba renders its export, and the .glb (8-bit textures, the BRDF written anew in gltf_bsdf.py), twice with
different seeds. With a and b the two and r relight's pictures, pooled over A > 0.5: *NRMS* has
sum (a - r)(b - r) / sum r^2, which the renderer's noise does not add to; *noise* is that of one. *fine*
is the NRMS against `relight --samples 8`, which like Mitsuba shades a pixel in many places. A material folder
made before (--material) saves its reconstruction.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import results

from swatchwork import reconstruct_folder, relight_folder
from swatchwork.capture import read_image
from swatchwork.simulate import simulate_capture
from swatchwork.workflow import export_material

HERE = Path(__file__).resolve().parent
HEAD = ["capture", "export", "frames", "NRMS", "fine", "noise", "stated loss"]
FINE = 8


def compared(first: Path, second: Path, reference: Path) -> dict[str, float]:
    """Noise-free NRMS of renders against the reference, and the noise of one of them."""
    cross = noise = total = 0.0
    files = sorted(reference.glob("*.exr"))
    for file in files:
        r, a, b = (read_image(folder / file.name) for folder in (reference, first, second))
        assert r.alpha is not None
        on = r.alpha > 0.5
        x, y, z = (image.linear[on].astype(np.float64) for image in (r, a, b))
        cross += ((y - x) * (z - x)).sum()
        noise += ((y - z) ** 2).sum() / 2
        total += (x**2).sum()
    return {
        "frames": len(files),
        "nrms": float(np.sqrt(max(cross, 0) / total)),
        "noise": float(np.sqrt(noise / total)),
    }


def measure(name: str, material: Path, cameras: Path, work: Path, spp: int) -> list[dict[str, Any]]:
    """A row for the Mitsuba export, and one for the .glb."""
    for name_of, samples in (("relit", 2), ("fine", FINE)):
        if not (work / name_of).is_dir():
            relight_folder(material, cameras, work / name_of, samples=samples)
    export_material(material, work / "scene", "mitsuba", cameras=cameras)
    summary = export_material(material, work / "object.glb", "gltf")
    rows = []
    for kind in ("mitsuba", "gltf"):
        for seed in (1, 2):
            script = [str(work / "scene" / "render.py"), "--frame", "all"]
            if kind == "gltf":
                script = [str(HERE / "gltf_bsdf.py"), str(work / "scene"), str(work / "object.glb")]
            output = ["--output", str(work / f"{kind}-{seed}")]
            command = [sys.executable, *script, "--spp", str(spp), "--seed", str(seed), *output]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        pictures = work / f"{kind}-1", work / f"{kind}-2"
        found = compared(*pictures, work / "relit")
        found["fine"] = compared(*pictures, work / "fine")["nrms"]
        loss = summary.rendered_loss if kind == "gltf" else None
        rows.append({"capture": name, "export": kind, "stated": loss, "spp": spp} | found)
    return rows


def row(r: dict[str, Any]) -> list[str]:
    stated = "-" if r["stated"] is None else f"{100 * r['stated']:.1f} %"
    percent = [f"{100 * r[key]:.2f} %" for key in ("nrms", "fine", "noise")]
    return [r["capture"], r["export"], str(r["frames"]), *percent, stated]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, required=True, help="folder with igea-merl/")
    parser.add_argument("--material", type=Path, help="igea-merl reconstructed before")
    parser.add_argument("--work", type=Path, help="keep pictures here")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--json", type=Path, help="write the figures here")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work = args.work or Path(temporary)
        made = simulate_capture(work / "simulated", object_shape="knot", k=6, test_views=3, size=128)
        reconstruct_folder(made.folder, work / "simulated-material")
        rows = measure("knot, simulated", work / "simulated-material", made.test_folder, work / "a", args.spp)
        material = args.material
        if material is None:
            material = work / "igea-material"
            reconstruct_folder(args.captures / "igea-merl", material)
        rows += measure("igea-merl", material, args.captures / "igea-merl" / "test", work / "b", args.spp)
    print(results.table(HEAD, [row(r) for r in rows]))
    results.write(args.json, {"rows": rows})


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where the photographs of a capture were taken from, by their silhouettes alone, against where they were.

    python scripts/measure/silhouettes.py --captures ../shared/captures \\
        --json target/validation/silhouettes.json

No pair is clicked; the masks are the photographs' alpha. Whatever is not placed without doubt is counted as
such.
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
from swatchwork.prepare.registering import Clues, apart, register
from swatchwork.surface import RayScene, read_mesh
from swatchwork.workflow.register_inputs import read_views

CAPTURES = ("igea-merl", "spot-merl-interreflect")
HEAD = ["capture", "photographs", "placed", "worst angle", "worst place", "least IoU"]


def measure(folder: Path) -> dict[str, Any]:
    """A row of one capture."""
    start = time.perf_counter()
    capture = read_capture(folder)
    assert capture.mesh_path is not None
    scene = RayScene([read_mesh(capture.mesh_path)])
    true = {frame.image_path.stem: frame.camera for frame in capture.frames}
    lens = replace(capture.frames[0].camera, world_from_camera=np.eye(4))
    views, _ = read_views([frame.image_path for frame in capture.frames], lens, None)
    found = register(scene, list(views.values()), Clues(), others="none")
    off = [apart(true[name], fit.camera, scene.centre) for name, fit in found.frames.items()]
    return {
        "capture": folder.name,
        "photographs": len(true),
        "placed": len(found.frames),
        "degrees": max(angle for angle, _ in off),
        "share": max(away for _, away in off),
        "iou": min(fit.iou or 0.0 for fit in found.frames.values()),
        "missing": found.missing,
        "seconds": time.perf_counter() - start,
    }


def cells(row: dict[str, Any]) -> list[str]:
    return [
        row["capture"],
        str(row["photographs"]),
        str(row["placed"]),
        f"{row['degrees']:.3f} degrees",
        f"{100 * row['share']:.3f} %",
        f"{row['iou']:.4f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, required=True, help=f"folder with {', '.join(CAPTURES)}")
    parser.add_argument("--json", type=Path, help="write the figures here")
    args = parser.parse_args()
    rows = [measure(args.captures / name) for name in CAPTURES]
    print(results.table(HEAD, [cells(row) for row in rows]))
    results.write(args.json, {"rows": rows})


if __name__ == "__main__":
    main()

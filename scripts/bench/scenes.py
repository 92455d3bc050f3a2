# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The simulated captures of the benchmarks: one for each row of the paper's Table 1, kept once made.

    python scripts/bench/scenes.py Mouse --size 1024 --folder target/bench/captures/Mouse-1024

Truth: GGX lobes of `many_materials` with a Smith masking of alpha 0.3, both outside either basis; each
measurement has 1 % noise; light `room`, novel light `sky`. n materials are blended at every point. Nothing of
the truth is given to the reconstruction.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import shared


@dataclass(frozen=True)
class Row:
    """A row of Table 1, and what stands for its object."""

    name: str
    k: int
    n: int
    N: int
    paper_minutes: int
    """On 8 Xeon cores."""
    shape: str
    rows: int
    """Of the shape's grid."""
    patches: float
    """Frequency of the blend's pattern: enough for all N materials to show."""
    size: int = 512
    """Pixels along an image's side."""


# 50,000 triangles are 4 rows^2 of a blob or a plate, 12 rows^2 of a knot.
TABLE = (
    Row("Bear", 1, 1, 10, 12, "blob", 116, 7.0),
    Row("Kitty", 5, 2, 8, 123, "blob", 116, 7.0),
    Row("Billiard", 20, 2, 6, 152, "sphere", 96, 5.0),
    Row("PaintSph", 17, 5, 6, 280, "sphere", 96, 5.0),
    Row("Pig", 54, 4, 8, 310, "knot", 68, 7.0, 1024),
    Row("Mouse", 26, 3, 9, 253, "knot", 68, 7.0, 1024),
    Row("DustSph", 22, 3, 5, 190, "sphere", 96, 5.0),
    Row("CopperPlt", 45, 5, 18, 298, "plate", 116, 7.0),
)
ROWS = {row.name: row for row in TABLE}
NOISE_PERCENT = 1.0
MASKING = "smith:0.3"
TEST_VIEWS = 4


def capture_of(name: str, size: int) -> Path:
    """The folder of a row's capture with images of ``size`` pixels; made in a process of its own if need be.

    It appears whole: what an interrupted run left is made anew.
    """
    folder = shared.BENCH / "captures" / f"{name}-{size}"
    if not folder.exists():
        part = folder.with_name(folder.name + ".part")
        shutil.rmtree(part, ignore_errors=True)
        print(f"making {folder.name} ...", file=sys.stderr, flush=True)
        # The measuring process stays small: a child starts with its parent's peak memory.
        command = [sys.executable, __file__, name, "--size", str(size), "--folder", str(part)]
        subprocess.run(command, check=True)
        part.rename(folder)
    return folder


def make(row: Row, size: int, folder: Path) -> None:
    """Write the capture of a row."""
    from swatchwork.simulate import many_materials, simulate_capture

    seed = TABLE.index(row)
    simulate_capture(
        folder,
        object_shape=row.shape,
        rows=row.rows,
        k=row.k,
        test_views=TEST_VIEWS,
        size=size,
        seed=seed,
        truth="ggx",
        masking=MASKING,
        recipes=many_materials(row.N, seed),
        materials=row.N,
        blended=row.n,
        patches=row.patches,
        noise_percent=NOISE_PERCENT,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("row", choices=ROWS)
    parser.add_argument("--size", type=int, default=1024, help="pixels along an image's side")
    parser.add_argument("--folder", type=Path, required=True)
    args = parser.parse_args()
    make(ROWS[args.row], args.size, args.folder)


if __name__ == "__main__":
    main()

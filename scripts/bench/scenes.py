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
from pathlib import Path

import shared

from swatchwork.reproduce.objects import ROWS, Row

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
    from swatchwork.simulate import simulate_capture

    simulate_capture(folder, test_views=TEST_VIEWS, size=size, **row.simulation())


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

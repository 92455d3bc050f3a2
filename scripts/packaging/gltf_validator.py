# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Install the Khronos glTF validator into target/, for the tests that use it, by the node of the viewer.

Run ``python scripts/packaging/gltf_validator.py``, or ``make gltf-validator``.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from build_viewer import node_and_npm

TARGET = Path(__file__).resolve().parents[2] / "target"
VALIDATOR = "gltf-validator@2.0.0-dev.3.10"


def install() -> None:
    """Put it into target/node_modules; SystemExit says what is missing."""
    _, npm = node_and_npm("the glTF validator")
    TARGET.mkdir(exist_ok=True)
    how = ["--prefix", str(TARGET), "--no-save", "--no-audit", "--no-fund", "--ignore-scripts"]
    subprocess.run([*npm, "install", *how, VALIDATOR], check=True)


if __name__ == "__main__":
    sys.exit(install())

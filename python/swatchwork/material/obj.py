# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The folder's own mesh.obj: one normal and one UV a vertex, doubles that come back bit for bit.

General OBJ files are surface's business; here order and every bit must survive, since texels refer to
this very mesh.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..arrays import F64, I32
from ..capture import MOST_MESH_BYTES, need_file
from ..errors import InputError


def write_obj(path: Path, vertices: F64, faces: I32, normals: F64, uv: F64) -> None:
    """Write with the shortest digits that read back as the same doubles."""
    lines = ["# swatchwork mesh; v, vt and vn share their indices"]
    for tag, table in (("v", vertices), ("vt", uv), ("vn", normals)):
        lines += [f"{tag} " + " ".join(map(repr, row)) for row in np.asarray(table, np.float64).tolist()]
    lines += ["f {0}/{0}/{0} {1}/{1}/{1} {2}/{2}/{2}".format(*row) for row in (faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def read_obj(path: Path) -> tuple[F64, I32, F64, F64]:
    """Vertices, faces, normals, UVs of a file `write_obj` wrote.

    Raises:
        InputError: missing, truncated, or an OBJ of another layout.
    """
    need_file(path, "the mesh of a material folder", most=MOST_MESH_BYTES)
    rows: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    faces: list[list[int]] = []
    where = "line 1"
    try:
        with path.open(encoding="ascii") as file:
            for number, line in enumerate(file, 1):
                where = f"line {number}"
                tag, _, rest = line.partition(" ")
                if tag in rows:
                    rows[tag].append([float(word) for word in rest.split()])
                elif tag == "f":
                    corners = [word.split("/") for word in rest.split()]
                    if any(len(set(corner)) != 1 or len(corner) != 3 for corner in corners):
                        raise ValueError("indices of v, vt and vn differ")
                    faces.append([int(corner[0]) - 1 for corner in corners])
        tables = [
            np.array(rows[tag], np.float64).reshape(-1, w) for tag, w in (("v", 3), ("vn", 3), ("vt", 2))
        ]
        return tables[0], np.array(faces, np.int32).reshape(-1, 3), tables[1], tables[2]
    except (ValueError, OverflowError, OSError) as error:
        raise InputError(
            f"{where}: {error}",
            file=path,
            expected="the mesh as swatchwork wrote it",
            hint="Is it truncated?",
        ) from error

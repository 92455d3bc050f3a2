# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Reading Wavefront OBJ: general readers merge, reorder or lose UVs at vertices no face uses."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swatchwork.arrays import F64, I64
from swatchwork.capture.guarding import MOST_ELEMENTS
from swatchwork.errors import InputError


def read_obj(path: Path) -> tuple[F64, I64, F64 | None, F64 | None]:
    """Vertices [V, 3], faces [F, 3], normals [V, 3] or None, UVs [V, 2] or None, split where corners differ.

    Polygons become fans; groups and materials are ignored. Normals or UVs that only some corners have
    count as absent.

    Raises:
        InputError: naming the line that cannot be read, or that names what does not exist.
    """
    rows: dict[str, list[list[str]]] = {"v": [], "vt": [], "vn": []}
    corners: list[tuple[int, int, int]] = []
    number = 0
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            for line in file:
                number += 1
                words = line.partition("#")[0].split()
                if not words:
                    continue
                if words[0] in rows:
                    rows[words[0]].append(words[1:4])
                elif words[0] == "f":
                    polygon = [_corner(word, rows) for word in words[1:]]
                    if len(polygon) < 3:
                        raise ValueError(f"a face of {len(polygon)} corners")
                    for i in range(1, len(polygon) - 1):
                        corners += (polygon[0], polygon[i], polygon[i + 1])
        number = 0
        v, vt, vn = (_table(rows[name], width) for name, width in (("v", 3), ("vt", 2), ("vn", 3)))
    except (ValueError, IndexError, OSError) as error:
        where = f"line {number} cannot be read" if number else "cannot be read"
        raise InputError(
            f"{where} ({error})", file=path, expected="a whole OBJ file", hint="Is it truncated?"
        ) from error
    index = np.array(corners, dtype=np.int64).reshape(-1, 3)
    for column, (table, what) in enumerate(((v, "vertex"), (vt, "texture coordinate"), (vn, "normal"))):
        if len(index) and index[:, column].max() >= len(table):
            worst = index[:, column].max() + 1
            raise InputError(f"a face names {what} {worst}", file=path, expected=f"1 to {len(table)}")
    # One vertex for each distinct (position, UV, normal) triple.
    for column in (1, 2):
        if len(index) and index[:, column].min() < 0:
            index[:, column] = -1
    triple, inverse = np.unique(index, axis=0, return_inverse=True)
    has_uv, has_normal = (len(index) > 0 and triple[0, column] >= 0 for column in (1, 2))
    return (
        v[triple[:, 0]],
        inverse.reshape(-1, 3).astype(np.int64),
        vn[triple[:, 2]] if has_normal else None,
        vt[triple[:, 1]] if has_uv else None,
    )


def _corner(word: str, rows: dict[str, list[list[str]]]) -> tuple[int, int, int]:
    parts = [*word.split("/"), "", ""]
    numbers = []
    for text, name in zip(parts, ("v", "vt", "vn"), strict=False):
        value = int(text) if text else 0
        if (text and not value) or abs(value) > MOST_ELEMENTS:
            raise ValueError(f"'{word[:60]}' names {name} {text[:20]}")
        if value < 0 and -value > len(rows[name]):
            raise IndexError(f"'{word}' counts back beyond the first {name}")
        numbers.append(value - 1 if value > 0 else len(rows[name]) + value if value < 0 else -1)
    if numbers[0] < 0:
        raise ValueError(f"'{word}' names no vertex")
    return numbers[0], numbers[1], numbers[2]


def _table(rows: list[list[str]], width: int) -> F64:
    if not rows:
        return np.zeros((0, width))
    if any(len(row) < width for row in rows):
        raise ValueError(f"an element has fewer than {width} numbers")
    return np.array([row[:width] for row in rows], dtype=np.float64)

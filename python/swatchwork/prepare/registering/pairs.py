# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Points of photographs paired with points of the mesh, and the file they are kept in.

    {"mesh": "bunny.obj",
     "photographs": {"IMG_0001.exr": [{"uv_px": [812.5, 403.0], "x_in_mesh": [0.1, -0.2, 0.3]}, ...]}}

``uv_px`` counts from the upper left corner of the photograph as it is, with pixel centres at +0.5.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture import read_json
from swatchwork.errors import InputError
from swatchwork.whole import whole_text

EXPECTED = '{"mesh": "bunny.obj", "photographs": {"a.exr": [{"uv_px": [u, v], "x_in_mesh": [x, y, z]}, ...]}}'


@dataclass(frozen=True, eq=False)
class Pairs:
    """Points of one photograph and of the mesh that show the same.

    Attributes:
        photograph: its file's name.
        uv_px: F64[C, 2], pixel centres at +0.5.
        x_in_world: F64[C, 3]; the world is the mesh's.
    """

    photograph: str
    uv_px: F64
    x_in_world: F64

    def __len__(self) -> int:
        return len(self.uv_px)

    @property
    def name(self) -> str:
        """As `View.name` of the photograph."""
        return Path(self.photograph).stem


def read_pairs(file: Path) -> dict[str, Pairs]:
    """The pairs of each photograph, by its name without folder and ending.

    How many a pose takes is for `pose_from_pairs` to say; a photograph may have none.

    Raises:
        InputError: the file cannot be read, is no JSON of the form above, holds a number that is not finite,
            or names a photograph twice.
    """
    document = read_json(file, EXPECTED)
    photographs = document.get("photographs") if isinstance(document, dict) else None
    if not isinstance(photographs, dict):
        raise InputError(
            'has no object "photographs"',
            file=file,
            expected=EXPECTED,
            hint="`swatchwork prepare pairs` saves such a file",
        )
    found: dict[str, Pairs] = {}
    for photograph, entries in photographs.items():
        pairs = _pairs(file, photograph, entries)
        if pairs.name in found:
            raise InputError(
                f'"{found[pairs.name].photograph}" and "{photograph}" are the same photograph by their names',
                file=file,
                expected="each photograph once, whatever its ending",
                hint="Merge the two lists",
            )
        found[pairs.name] = pairs
    return found


def write_pairs(file: Path, pairs: Mapping[str, Pairs], mesh: str) -> None:
    """Write what `read_pairs` reads; an older file is replaced once the new one is whole.

    Raises:
        OutputError: the file cannot be written.
    """
    photographs = {
        p.photograph: [
            {"uv_px": uv, "x_in_mesh": x}
            for uv, x in zip(p.uv_px.tolist(), p.x_in_world.tolist(), strict=True)
        ]
        for p in pairs.values()
    }
    text = json.dumps({"mesh": mesh, "photographs": photographs}, indent=1, allow_nan=False)
    whole_text(file, text + "\n")


def _pairs(file: Path, photograph: str, entries: Any) -> Pairs:
    if not isinstance(entries, list):
        raise InputError(
            f'"{photograph}" is {_short(entries)}',
            file=file,
            expected='a list of {"uv_px": [u, v], "x_in_mesh": [x, y, z]}',
        )
    uv, x = [], []
    for i, entry in enumerate(entries):
        where = f'"{photograph}", pair {i + 1}'
        if not isinstance(entry, dict):
            raise InputError(
                f"{where} is {_short(entry)}",
                file=file,
                expected='{"uv_px": [u, v], "x_in_mesh": [x, y, z]}',
            )
        uv.append(_numbers(file, where, entry, "uv_px", 2))
        x.append(_numbers(file, where, entry, "x_in_mesh", 3))
    return Pairs(photograph, np.array(uv, np.float64).reshape(-1, 2), np.array(x, np.float64).reshape(-1, 3))


def _numbers(file: Path, where: str, entry: dict[str, Any], key: str, count: int) -> list[float]:
    expected = f'"{key}" with {count} finite numbers'
    value = entry.get(key)
    if value is None:
        raise InputError(f'{where} has no "{key}"', file=file, expected=expected)
    sound = isinstance(value, list) and len(value) == count
    # JSON's true counts as a number in Python; a number that is too long for a double is infinite.
    if not sound or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in value):
        raise InputError(f'{where} has "{key}" {_short(value)}', file=file, expected=expected)
    try:
        numbers = [float(v) for v in value]
    except OverflowError:
        numbers = [np.inf]
    if not np.isfinite(numbers).all():
        raise InputError(
            f'{where} has "{key}" {_short(value)}',
            file=file,
            expected=expected,
            hint="Leave the pair out, or click it again",
        )
    return numbers


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."

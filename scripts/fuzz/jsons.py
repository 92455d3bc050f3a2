# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mutations of what transforms.json says: its values and structure."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

from mutating import mutation

WRONG = [
    "null-word",
    "'true'",
    "[]",
    "{}",
    "[1]",
    '{"a":1}',
    "NaN",
    "Infinity",
    "-Infinity",
    "1e400",
    "-1e400",
]
NOT_NUMBERS: list[Any] = ["1", "", "nan", True, False, [], [1.0], {}, {"a": 1}, float("nan"), float("inf")]
NOT_NUMBERS += [float("-inf"), 10**400, "\N{FULLWIDTH DIGIT ONE}"]
NOT_TEXT: list[Any] = [1, 0, True, [], ["mesh.obj"], {}, 1.5, float("nan"), ""]
NOT_MATRICES: list[Any] = [
    "none",
    1,
    True,
    [],
    [[]],
    [1, 2, 3],
    {},
    [[1.0] * 4] * 5,
    [[1.0] * 3] * 3,
    [[None] * 4] * 4,
]
NOT_MATRICES += [[["1"] * 4] * 4, [[True] * 4] * 4, [[[1.0]] * 4] * 4, [[10**400] * 4] * 4]


def load(folder: Path) -> dict[str, Any]:
    """The capture's JSON."""
    found: dict[str, Any] = json.loads((folder / "transforms.json").read_text(encoding="utf-8"))
    return found


def save(folder: Path, head: Any) -> None:
    """Write it, with what is no JSON but Python's writer and reader know."""
    (folder / "transforms.json").write_text(json.dumps(head), encoding="utf-8")


def _places(head: dict[str, Any], *keys: str) -> list[tuple[dict[str, Any], str]]:
    """Objects with one of the keys."""
    objects: list[dict[str, Any]] = [head, *head["frames"]]
    objects += [o["environment"] for o in objects if "environment" in o]
    return [(o, key) for o in objects for key in keys if key in o]


LENGTHS = ("fl_x", "fl_y", "w", "h", "camera_angle_x", "exposure")
NUMBERS = (*LENGTHS, "cx", "cy", "k1", "k2", "p1", "p2")


@mutation("json", "wrong type")
def number_of_another_type(folder: Path, rng: Random) -> str | None:
    head = load(folder)
    places = _places(head, *NUMBERS)
    if not places:
        return None
    there, key = rng.choice(places)
    there[key] = value = rng.choice(NOT_NUMBERS)
    save(folder, head)
    return f"{key} = {str(value)[:20]!r}"


@mutation("json", "out of range")
def number_out_of_range(folder: Path, rng: Random) -> str | None:
    head = load(folder)
    places = _places(head, *LENGTHS)
    if not places:
        return None
    there, key = rng.choice(places)
    value = rng.choice([0, -1, -0.5, -1e300, 0.0, 1e300 if key != "camera_angle_x" else 4.0])
    if key in ("w", "h"):
        value = rng.choice([0, -24, 24.5, 1e9, 2**31, 2**63, 10**30, 23, 25])
    there[key] = value
    save(folder, head)
    return f"{key} = {value}"


@mutation("json", "out of range")
def exposure_out_of_range(folder: Path, rng: Random) -> str:
    head = load(folder)
    value = rng.choice([0, -1.0, 1e-300, 1e300, 5e-324, -0.0])
    rng.choice(head["frames"])["exposure"] = value
    save(folder, head)
    return f"exposure = {value}"


@mutation("json", "out of range")
def lens_out_of_range(folder: Path, rng: Random) -> str:
    head = load(folder)
    key = rng.choice(("k1", "k2", "p1", "p2", "cx", "cy", "k3", "k4"))
    value = rng.choice((1e300, -1e300, 1e12, 1.7e308))
    rng.choice(head["frames"])[key] = value
    save(folder, head)
    return f"{key} = {value}"


@mutation("json", "wrong type")
def text_of_another_type(folder: Path, rng: Random) -> str | None:
    head = load(folder)
    there, key = rng.choice(_places(head, "mesh", "file_path", "mask_path", "file", "convention"))
    there[key] = value = rng.choice(NOT_TEXT)
    save(folder, head)
    return f"{key} = {value!r}"


@mutation("json", "wrong type")
def matrix_of_another_type(folder: Path, rng: Random) -> str:
    head = load(folder)
    there, _ = rng.choice(_places(head, "transform_matrix"))
    there["transform_matrix"] = value = rng.choice(NOT_MATRICES)
    save(folder, head)
    return f"transform_matrix = {str(value)[:40]}"


@mutation("json", "non-finite")
def matrix_not_finite(folder: Path, rng: Random) -> str:
    head = load(folder)
    there, _ = rng.choice(_places(head, "transform_matrix"))
    row, column = rng.randrange(4), rng.randrange(4)
    value = rng.choice([float("nan"), float("inf"), float("-inf")])
    there["transform_matrix"][row][column] = value
    save(folder, head)
    return f"transform_matrix[{row}][{column}] = {value}"


@mutation("json", "out of range")
def matrix_not_rigid(folder: Path, rng: Random) -> str:
    head = load(folder)
    there, _ = rng.choice(_places(head, "transform_matrix"))
    m = there["transform_matrix"]
    kind = rng.choice(("scaled", "mirrored", "sheared", "zero", "huge", "last row", "far", "cancelling"))
    for row in range(3):
        if kind == "scaled":
            m[row][0] *= 2
        elif kind == "mirrored":
            m[row][0] *= -1
        elif kind == "sheared":
            m[row][0] += 0.1 * m[row][1]
        elif kind == "zero":
            m[row][1] = 0
        elif kind == "huge":
            m[row][2] *= 1e300
        elif kind == "cancelling":
            m[row][:3] = [[1e200, 1e200, 0], [1e200, -1e200, 0], [0, 0, 1]][row]
    if kind == "last row":
        m[3][rng.randrange(3)] = 1.0
    elif kind == "far":
        m[rng.randrange(3)][3] = 1e300
    save(folder, head)
    return f"transform_matrix {kind}"


@mutation("json", "missing")
def key_missing(folder: Path, rng: Random) -> str | None:
    head = load(folder)
    there, key = rng.choice(
        _places(head, "mesh", "frames", "file_path", "transform_matrix", "convention", "file")
    )
    if key == "transform_matrix" and "file" in there:
        return None
    if rng.random() < 0.5:
        del there[key]
    else:
        there[key] = None
    save(folder, head)
    return f"no {key}"


@mutation("json", "wrong type")
def structure_of_another_type(folder: Path, rng: Random) -> str:
    head = load(folder)
    key = rng.choice(("frames", "frame", "environment", "occluders", "document", "occluder"))
    value = rng.choice([1, "x", True, [[]], float("nan")])
    if key == "document":
        head = rng.choice([[], 1, "x", None, True, [head]])
    elif key == "frame":
        head["frames"][rng.randrange(len(head["frames"]))] = value
    elif key == "environment":
        rng.choice([head, *head["frames"]])["environment"] = value
        if "environment" not in head and rng.random() < 0.5:
            head["environment"] = value
    elif key == "occluder":
        head["occluders"] = [value if value != "x" else 7]
    elif key == "frames":
        head["frames"] = rng.choice([[], {}, "x", 1, value])
    else:
        head["occluders"] = {"a": 1} if value == [[]] else value
    save(folder, head)
    return f"{key} = {str(value)[:20]}"


@mutation("json", "wrong type")
def format_of_another_version(folder: Path, rng: Random) -> str:
    head = load(folder)
    head["format_version"] = value = rng.choice([2, 0, -1, "1", True, [], 1.5, 10**400, float("nan")])
    save(folder, head)
    return f"format_version = {str(value)[:20]}"


@mutation("json", "out of range")
def name_unknown(folder: Path, rng: Random) -> str:
    head = load(folder)
    key = rng.choice(("convention", "camera_model", "is_fisheye"))
    if key == "convention":
        there, _ = rng.choice(_places(head, "convention"))
        there[key] = value = rng.choice(["latlong", "Blender", "blender ", "\N{BOM}blender", "<b>"])
    else:
        head[key] = value = (
            True if key == "is_fisheye" else rng.choice(["OPENCV_FISHEYE", "", "x" * 9999, [], {"a": 1}])
        )
    save(folder, head)
    return f"{key} = {str(value)[:20]!r}"


@mutation("json", "twice")
def frame_twice(folder: Path, rng: Random) -> str:
    head = load(folder)
    head["frames"].append(dict(rng.choice(head["frames"])))
    save(folder, head)
    return "a frame twice"

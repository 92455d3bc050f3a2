# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Cases beside captures: material folders, projects of other programs, the files of `prepare`."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from mutating import Done, flipped

from swatchwork import read_material
from swatchwork.capture import EnvironmentSource
from swatchwork.material import material_maps
from swatchwork.prepare import photographs_in
from swatchwork.prepare.earlier import from_earlier
from swatchwork.prepare.exposure import exposures_of
from swatchwork.prepare.importing import import_capture
from swatchwork.prepare.registering import read_pairs
from swatchwork.prepare.views import views_of
from swatchwork.workflow.preparing_calibrate import read_intrinsics

FIRST = 1_000_000_000
"""Seeds from here on are of these."""
KINDS = ("material", "foreign")
BOMB = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
VALUES: list[Any] = [None, True, "", "x", "1", -1, 0, 1.5, 1e300, 10**12, 10**400, [], [[]], {}, {"a": [1]}]
VALUES += [float("nan"), float("inf"), "\x1b[31m", "<script>", "../../x", "a" * 100_000, [1] * 1000]


def prepared(kind: str, bases: Path, folder: Path, rng: Random) -> tuple[list[Done], Callable[[], None]]:
    """A spoilt folder of a kind, what was done to it, and what reads it."""
    if kind == "material":
        source = folder / "material"
        shutil.copytree(bases / "material", source)
        file = source / rng.choice(("svbrdf.json", "svbrdf.json", "blend.exr", "mesh.obj"))
        return [_spoilt(file, kind, rng)], lambda: _use(source)
    source = folder / "foreign"
    shutil.copytree(bases / "foreign", source)
    part = rng.choice(("metashape", "colmap", "files"))
    if part == "files":
        file = rng.choice(sorted((source / "files").iterdir()))
        return [_spoilt(file, part, rng)], lambda: _read(file)
    names = (
        ["cameras.xml"]
        if part == "metashape"
        else [f"sparse/0/{n}.txt" for n in ("cameras", "images", "points3D")]
    )
    done = [_spoilt(source / part / rng.choice(names), part, rng)]
    light = EnvironmentSource(bases / "exr/env.exr", "blender")

    def bring() -> None:
        import_capture(source / part, folder / "out", mesh=bases / "exr/mesh.obj", environment=light)

    return done, bring


def _use(source: Path) -> None:
    material_maps(read_material(source))


def _read(file: Path) -> None:
    photographs = [file.with_name(name) for name in ("a.jpg", "b.jpg", "c.jpg")]
    for photograph in photographs:
        photograph.write_bytes(b"\xff\xd8")
    readers: dict[str, Callable[[], object]] = {
        "pairs.json": lambda: read_pairs(file),
        "intrinsics.json": lambda: read_intrinsics(file),
        "groups.json": lambda: views_of(photographs_in(photographs), groups=file),
        "exposures.json": lambda: exposures_of(photographs[:2], file),
        "exposures.csv": lambda: exposures_of(photographs[:2], file),
        "linearize.json": lambda: from_earlier(
            file,
            "multipliers",
            "a linearize.json",
            lambda d: [float(x) for x in d["white_balance"]["multipliers"]],
        ),
    }
    readers[file.name]()


def _spoilt(file: Path, kind: str, rng: Random) -> Done:
    """Any file: bytes; JSON: a value of it too; XML: a document type."""
    content = file.read_bytes()
    if file.suffix == ".json" and rng.random() < 0.6:
        head = json.loads(content)
        path, old, new = _replaced(head, rng)
        file.write_text(json.dumps(head), encoding="utf-8")
        violation = of_a_value(path, old, new) if file.name == "svbrdf.json" else None
        return Done("value", kind, violation, f"{file.name}: {'/'.join(path)[:60]} = {str(new)[:20]}")
    if file.suffix == ".xml" and rng.random() < 0.2:
        text = content.decode().replace("?>", "?>" + BOMB, 1).replace("Chunk 1", "&b;")
        file.write_text(text, encoding=(code := rng.choice(("utf-8", "utf-16"))))
        return Done("entities", kind, "wrong type", f"{file.name}: entities in {code}")
    if rng.random() < 0.15:
        deep = b"[" * 100_000
        file.write_bytes(deep)
        return Done("deep", kind, "wrong type", f"{file.name}: 100,000 brackets")
    if rng.random() < 0.3:
        cut = rng.randrange(len(content) + 1)
        file.write_bytes(content[:cut])
        # The rows of a .txt or .csv may end anywhere, and the .exr's last bytes may be padding.
        sure = file.suffix in (".json", ".xml", ".obj") and cut < len(content.rstrip())
        return Done("cut", kind, "truncated" if sure else None, f"{file.name}: the first {cut} bytes")
    if file.suffix in (".txt", ".xml", ".obj", ".csv") and content and rng.random() < 0.6:
        words = content.split(b" ")
        at = rng.randrange(len(words))
        words[at] = word = rng.choice(
            (b"nan", b"-1", b"1e400", b"99999999999999999999", b"x", b"", b"../../x", b"\0", b"0")
        )
        file.write_bytes(b" ".join(words))
        return Done("word", kind, None, f"{file.name}: {word!r}")
    file.write_bytes(flipped(content, rng))
    return Done("bits", kind, None, f"{file.name}: bits")


def _replaced(head: Any, rng: Random) -> tuple[list[str], Any, Any]:
    """One value somewhere in a document becomes another: where, what it was and what it is."""
    at, path = head, list[str]()
    while True:
        keys: list[Any] = list(at) if isinstance(at, dict) else list(range(len(at)))
        key = rng.choice(keys)
        path.append(str(key))
        inside = at[key]
        if not isinstance(inside, dict | list) or not inside or rng.random() < 0.4:
            at[key] = value = rng.choice(VALUES)
            return path, inside, value
        at = inside


NULLABLE = ("trust", "spread", "outliers")
"""Keys of svbrdf.json that may be null, beside the solver's numbers, since JSON has no NaN."""
EMPTY = ("representatives", "resolution", "penalties", "basis")
"""Keys of svbrdf.json whose lists and objects must hold something; elsewhere, nothing may have happened."""


def of_a_value(path: list[str], old: Any, new: Any) -> str | None:
    """The class of violation that another value in svbrdf.json certainly makes; None: it may be harmless."""
    numbers = isinstance(old, int | float) and not isinstance(old, bool)
    if new is None:
        harmless = path[-1] in NULLABLE or old is None or (numbers and path[0] == "solver")
        return None if harmless else "wrong type"
    if old is None or (numbers and isinstance(new, int | float) and not isinstance(new, bool)):
        if isinstance(new, float) and not math.isfinite(new):
            return "non-finite"
        if old is None:
            return None
        # Coefficients of the error model, and what is said of a photograph, may have either sign.
        signed = path[0] == "trust" or "photographs" in path
        if isinstance(new, int | float) and new < 0 and not signed:
            return "out of range"
        if path[0] in ("representatives", "basis", "n", "N", "resolution", "mesh") and new > 1e20:
            return "out of range"
        return None
    if type(old) is not type(new):
        return "wrong type"
    if isinstance(new, list | dict) and path[0] in EMPTY:
        return "wrong type"
    return "wrong type" if isinstance(new, str) and len(new) > 4096 else None

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Writing and reading the material folder: whole or not at all, and the same bits back."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..capture import exr_in_bands, need_file, read_exr_channels, read_json
from ..capture.fields import leads_outside
from ..errors import InputError
from ..keeping import Array
from ..whole import set_aside, whole_folder, write_text
from .maps import maps_in_bands
from .material import BasisRecord, Material
from .obj import read_obj, write_obj
from .record import check_record
from .trust import ErrorModel

FORMAT = "swatchwork-material"
SCHEMA_VERSION = 1
FILES = ("svbrdf.json", "blend.exr", "mesh.obj")
"""That are read; everything else in the folder is for people and other programs."""
ROWS = 64
"""Of an image, written at once."""
READS = 5
"""Of a folder that other processes replace meanwhile."""


def write_material(
    folder: str | PathLike[str], material: Material, extra: Callable[[Path], None] | None = None
) -> None:
    """Write the folder of design section 4; an older material there stays until the new one is whole.

    Args:
        folder: where; must not exist, be empty, or hold a material.
        material: what.
        extra: writes further files (a report) into the folder it is given before that becomes visible.

    Raises:
        InputError: the material is inconsistent, or the folder holds something else.
        OutputError: disk full, no permission; nothing of the new folder is left.
    """
    material.check()
    with whole_folder(folder, is_material_folder, "a material folder") as fresh:
        _write_blend(fresh / "blend.exr", material)
        write_obj(fresh / "mesh.obj", material.vertices, material.faces, material.normals, material.uv)
        _write_maps(fresh / "maps", material)
        write_text(fresh / "svbrdf.json", _as_json(material))
        if extra is not None:
            extra(fresh)


def read_material(folder: str | PathLike[str]) -> Material:
    """Read a folder `write_material` wrote, every number as it was.

    One that another process replaces meanwhile is read again, so that its files are of one material.

    Raises:
        InputError: a file is missing or damaged, of another schema version, or the parts disagree.
    """
    folder = Path(folder)
    for _ in range(READS):
        before = _identity(folder)
        try:
            material = _read(folder)
        except InputError:
            if _identity(folder) == before:
                raise
        else:
            if _identity(folder) == before:
                return material
    raise InputError("is being replaced again and again", file=folder, expected="a material that stays")


def _identity(folder: Path) -> tuple[int, int] | None:
    try:
        found = folder.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _read(folder: Path) -> Material:
    if not folder.is_dir():
        aside = set_aside(folder)
        hint = f"A run was killed as it replaced it, and the older one is whole in {aside}: rename it back"
        raise InputError(
            "no such folder", file=folder, expected="a material folder", hint=hint if aside else None
        )
    for name in FILES:
        if real := leads_outside(folder / name, [folder]):
            raise InputError(
                f"is a link that leads outside, to {real}",
                file=folder / name,
                expected="a file of the folder",
            )
    head = _read_json(folder / "svbrdf.json")
    try:
        check_record(head)
        basis = BasisRecord(
            head["basis"]["name"],
            tuple(map(float, head["basis"]["sigmas"])),
            tuple(map(str, head["basis"]["maskings"])),
            tuple(map(str, head["basis"]["diffuse"])),
            tuple(map(int, head["basis"]["fresnel"])),
        )
        representatives = np.array(head["representatives"], dtype=np.float64)
        n = head["n"]
        declared = {"N": head["N"], "resolution": head["resolution"]}
        penalties, solver, inputs = head["penalties"], head["solver"], head["inputs"]
        # Materials of before it was there have none.
        spread = np.array(head["spread"], dtype=np.float64) if head.get("spread") is not None else None
        trust = None
        if head.get("trust") is not None:
            trust = ErrorModel.from_dict(head["trust"], len(representatives))
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"a part is missing or malformed ({error!r})",
            file=folder / "svbrdf.json",
            expected="a whole material",
        ) from error
    blend = read_exr_channels(folder / "blend.exr")
    if not 1 <= n <= len(blend):
        raise InputError(
            f"n is {n}", file=folder / "svbrdf.json", expected="a number of channels in blend.exr"
        )
    wanted = [f"{kind}.{i}" for kind in ("index", "weight") for i in range(n)]
    missing = [name for name in [*wanted, "coverage", "residual"] if name not in blend]
    if missing:
        raise InputError(
            f"has no channel {missing[0]!r}",
            file=folder / "blend.exr",
            expected=f"n={n} index and weight channels",
        )
    vertices, faces, normals, uv = read_obj(folder / "mesh.obj")
    material = Material(
        basis=basis,
        representatives=representatives,
        index=np.stack([blend[f"index.{i}"].astype(np.uint32) for i in range(n)], axis=-1),
        weight=np.stack([blend[f"weight.{i}"].astype(np.float32) for i in range(n)], axis=-1),
        coverage=blend["coverage"].astype(np.uint32).astype(np.int64).astype(np.int32) - np.int32(1),
        residual=blend["residual"].astype(np.float32),
        vertices=vertices,
        faces=faces,
        normals=normals,
        uv=uv,
        penalties=penalties,
        solver=solver,
        trust=trust,
        spread=spread,
        inputs=inputs,
    )
    material.check(folder)
    own = {"N": material.N, "resolution": list(material.index.shape[:2])}
    # Materials of before it was there do not say how large their mesh is.
    if "mesh" in head:
        declared["mesh"], own["mesh"] = head["mesh"], _mesh_size(material)
    if declared != own:
        raise InputError(f"says {declared}", file=folder / "svbrdf.json", expected=f"{own}, as its parts are")
    return material


def _mesh_size(m: Material) -> dict[str, int]:
    """A mesh that is cut at the end of a line looks whole."""
    return {"vertices": len(m.vertices), "faces": len(m.faces)}


def is_material_folder(folder: str | PathLike[str]) -> bool:
    """Whether the folder's svbrdf.json says that it is one, of whatever version."""
    try:
        head = read_json(Path(folder) / "svbrdf.json")
    except InputError:
        return False
    return isinstance(head, dict) and head.get("format") == FORMAT


def _write_blend(path: Path, m: Material) -> None:
    height, width = m.coverage.shape
    types = {f"index.{i}": np.uint32 for i in range(m.n)} | {f"weight.{i}": np.float32 for i in range(m.n)}
    with exr_in_bands(path, width, height, types | {"coverage": np.uint32, "residual": np.float32}) as write:
        for start in range(0, height, ROWS):
            rows = slice(start, start + ROWS)
            channels: dict[str, Array] = {f"index.{i}": m.index[rows, :, i] for i in range(m.n)}
            channels |= {f"weight.{i}": m.weight[rows, :, i] for i in range(m.n)}
            # EXR has no signed integers: coverage is stored plus 1, so that 0 is off the atlas.
            channels["coverage"] = m.coverage[rows].astype(np.int64) + 1
            channels["residual"] = m.residual[rows]
            write(channels)


def _write_maps(folder: Path, m: Material) -> None:
    folder.mkdir()
    height, width = m.coverage.shape
    files: dict[str, Callable[[dict[str, Array]], None]] = {}
    with ExitStack() as opened:
        for maps in maps_in_bands(m):
            for name, pixels in vars(maps).items():
                bands = {"RGB"[i]: pixels[..., i] for i in range(3)} if pixels.ndim == 3 else {"Y": pixels}
                if name not in files:
                    types = dict.fromkeys(bands, np.float32)
                    file = exr_in_bands(folder / f"{name}.exr", width, height, types)
                    files[name] = opened.enter_context(file)
                files[name](bands)


def _as_json(m: Material) -> str:
    """Python's JSON writes the shortest digits that read back as the same double."""
    head = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "basis": asdict(m.basis),
        "n": m.n,
        "N": m.N,
        "resolution": list(m.index.shape[:2]),
        "mesh": _mesh_size(m),
        "representatives": m.representatives.tolist(),
        "penalties": m.penalties,
        "solver": m.solver,
        "trust": m.trust.as_dict() if m.trust else None,
        "spread": m.spread,
        "inputs": m.inputs,
    }
    return json.dumps(_plain(head), sort_keys=True, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    """Arrays as lists; JSON has no infinity nor NaN, so that a history's become null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _read_json(path: Path) -> dict[str, Any]:
    need_file(path, "the head of a material folder")
    head = read_json(path, "JSON", "Is it truncated?")
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        raise InputError("is not the head of a material folder", file=path, expected=f'"format": "{FORMAT}"')
    if head.get("schema_version") is True or head.get("schema_version") != SCHEMA_VERSION:
        raise InputError(
            f"has schema version {head.get('schema_version')!r}",
            file=path,
            expected=str(SCHEMA_VERSION),
            hint="Read it with the swatchwork that wrote it, or reconstruct again",
        )
    return head

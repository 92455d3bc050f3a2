# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs to be registered, with their lens and, where a mask or alpha says, where the object is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from ..arrays import Bool
from ..capture import IMAGE_SUFFIXES, Camera, read_image, read_mask
from ..errors import InputError
from ..prepare.boards import read_gray
from ..prepare.importing.found import mask_for
from ..prepare.registering import View
from ..progress import SILENT, Progress
from ..surface import Mesh, read_mesh, sphere_mesh


def photographs_to_register(places: Sequence[Path]) -> list[Path]:
    """Files as given, and of folders the images in them by name.

    Raises:
        InputError: a place does not exist or is no image; two have one name; there is none.
    """
    files: list[Path] = []
    for place in places:
        if place.is_dir():
            files += sorted(f for f in place.iterdir() if f.suffix.lower() in IMAGE_SUFFIXES and f.is_file())
        elif not place.is_file():
            raise InputError("no such file or folder", file=place, expected="photographs of the object")
        elif place.suffix.lower() not in IMAGE_SUFFIXES:
            raise InputError(
                f"is of type {place.suffix!r}",
                file=place,
                expected="one of " + ", ".join(IMAGE_SUFFIXES),
                hint="RAW files: run `swatchwork prepare linearize` first",
            )
        else:
            files.append(place)
    if not files:
        raise InputError("there are no photographs", expected="files ending in " + ", ".join(IMAGE_SUFFIXES))
    stems = [file.stem for file in files]
    twice = next((file for file in files if stems.count(file.stem) > 1), None)
    if twice is not None:
        raise InputError(
            f"two photographs are called {twice.stem}",
            file=twice,
            expected="one of each name",
            hint="Give either the EXRs or the files that they were made of",
        )
    return files


def object_of(mesh: str | PathLike[str] | None, sphere: float | None) -> Mesh:
    """The mesh read, or that of a sphere of a radius.

    Raises:
        InputError: both or neither are given, or it cannot be read.
    """
    if mesh is not None and sphere is not None:
        raise InputError("both --mesh and --sphere are given", expected="one of them")
    if sphere is not None:
        return sphere_mesh(sphere)
    if mesh is None:
        raise InputError("no object is given", expected="--mesh FILE, or --sphere RADIUS")
    return read_mesh(mesh)


def read_views(
    files: Sequence[Path], lens: Camera, masks: Path | None, progress: Progress = SILENT
) -> tuple[dict[str, View], dict[str, Path]]:
    """Views by name, and the mask file of each that has one.

    Raises:
        InputError: an image or mask cannot be read, has another size than the lens, or a mask is missing.
    """
    if masks is not None and not masks.is_dir():
        raise InputError(
            "no such folder", file=masks, expected="masks, NAME.png or STEM.png for each photograph"
        )
    views: dict[str, View] = {}
    found: dict[str, Path] = {}
    with progress.stage("Reading photographs", len(files)) as task:
        for file in files:
            gray = read_gray(file)
            if gray.shape != (lens.height, lens.width):
                raise InputError(
                    f"the photograph is {gray.shape[1]} x {gray.shape[0]}",
                    file=file,
                    expected=f"{lens.width} x {lens.height}, as the intrinsics say",
                    hint="Calibrate with photographs of the same size and orientation",
                )
            region = _alpha(file)
            mask = mask_for(masks, file.name)
            if mask is not None:
                found[file.stem] = mask
                region = _mask(mask, lens)
            views[file.stem] = View(file, replace(lens, world_from_camera=np.eye(4)), gray, region)
            task.advance()
    return views, found


def _alpha(file: Path) -> Bool | None:
    if file.suffix.lower() in (".jpg", ".jpeg", ".hdr"):
        return None
    alpha = read_image(file).alpha
    if alpha is None or not (alpha < 1).any():
        return None
    return np.asarray(alpha > 0.5)


def _mask(file: Path, lens: Camera) -> Bool:
    mask = read_mask(file)
    if mask.shape != (lens.height, lens.width):
        raise InputError(
            f"the mask is {mask.shape[1]} x {mask.shape[0]}",
            file=file,
            expected=f"{lens.width} x {lens.height}, as the photographs",
        )
    if not mask.any() or mask.all():
        raise InputError(
            "all of it is " + ("outside" if not mask.any() else "inside"),
            file=file,
            expected="white where the object is, black elsewhere",
        )
    return mask

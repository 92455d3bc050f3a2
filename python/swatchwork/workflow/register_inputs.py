# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs to be registered, with their lens and, where a mask or alpha says, where the object is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from ..arrays import Bool
from ..capture import IMAGE_SUFFIXES, Camera, Image, check_radiance, read_image, read_mask
from ..errors import InputError
from ..prepare.boards import read_gray
from ..prepare.importing.found import mask_for
from ..prepare.registering import View
from ..progress import SILENT, Progress
from ..surface import Mesh, read_mesh, sphere_mesh

LEAST_PX = 40
"""Side of the square that the object's largest part fills: less tells no pose."""
LINEARIZED = "linearize.json"
"""What `prepare linearize` leaves beside its EXRs, and a contact sheet."""
SPECKLED = 0.25
"""Share of the region in its largest part, below which there is no object but many specks."""


def photographs_to_register(places: Sequence[Path]) -> list[Path]:
    """Files as given, and of folders the images in them by name; of a folder of `prepare linearize` its EXRs.

    Raises:
        InputError: a place does not exist or is no image; two have one name; there is none.
    """
    files: list[Path] = []
    for place in places:
        if place.is_dir():
            suffixes = (".exr",) if (place / LINEARIZED).is_file() else IMAGE_SUFFIXES
            files += sorted(f for f in place.iterdir() if f.suffix.lower() in suffixes and f.is_file())
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
        InputError: an image or mask cannot be read, has another size than the lens, or a mask is missing; a
            pixel inside the mask is no radiance; mask or alpha show no object, or too small a one.
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
            mask_file = mask_for(masks, file.name)
            mask = _mask(mask_file, lens) if mask_file is not None else None
            if mask_file is not None:
                found[file.stem] = mask_file
            region = _region(file, mask, mask_file)
            views[file.stem] = View(file, replace(lens, world_from_camera=np.eye(4)), gray, region)
            task.advance()
    return views, found


def _region(file: Path, mask: Bool | None, mask_file: Path | None) -> Bool | None:
    """Where both mask and alpha have the object; None where neither says."""
    region = mask
    if file.suffix.lower() not in (".jpg", ".jpeg"):
        image = read_image(file)
        # As the capture will be read.
        check_radiance(image.linear, ~image.clipped if mask is None else ~image.clipped & mask, str(file))
        alpha = _alpha(file, image)
        if alpha is not None and mask is not None and not (alpha & mask).any():
            raise InputError(
                f"alpha has the object nowhere where the mask {mask_file} has it",
                file=file,
                expected="mask and alpha of one object",
            )
        region = mask if alpha is None else alpha if mask is None else alpha & mask
    if region is not None:
        _check_size(region, mask_file or file)
    return region


def _alpha(file: Path, image: Image) -> Bool | None:
    if image.alpha is None:
        return None
    region = np.asarray(image.alpha > 0.5)
    if not region.any():
        raise InputError(
            f"alpha is nowhere above 0.5, at most {image.alpha.max():g}",
            file=file,
            expected="1 where the object is, 0 elsewhere",
        )
    return None if region.all() else region


def _check_size(region: Bool, file: Path) -> None:
    # Opened, so that noise does not hang together by single pixels.
    opened = cv2.morphologyEx(region.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, _, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=4)
    largest = int(stats[1:, cv2.CC_STAT_AREA].max(initial=0))
    across = int(np.sqrt(largest))
    if across >= LEAST_PX:
        return
    if largest < SPECKLED * region.sum():
        raise InputError(
            f"it is speckles, the largest {across} px across",
            file=file,
            expected="one object, white on black or by alpha",
            hint="Mask the photograph anew",
        )
    raise InputError(
        f"the object is only {across} px large",
        file=file,
        expected=f"{LEAST_PX} px or more",
        hint="Check that the mask is the object's, or take photographs from nearer",
    )


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

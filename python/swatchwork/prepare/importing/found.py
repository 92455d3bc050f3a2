# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a reader of a foreign layout is asked for, and what it gives back."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swatchwork.arrays import F32, F64, Bool, Float
from swatchwork.capture import IMAGE_SUFFIXES, Camera, EnvironmentSource, need_file, rigid
from swatchwork.capture.fields import LINKS_INTO, leads_outside, path_within
from swatchwork.errors import InputError

GL_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])
"""From camera axes x right, y down, z forward to ours, x right, y up, z backward; its own inverse."""


@dataclass(frozen=True)
class Request:
    """What is imported, and where to look.

    Attributes:
        source: the folder or file.
        images: folder of the photographs, where the layout does not say; None: the usual places.
        masks: folder of masks, NAME.png or STEM.png for each photograph; None: the layout's own.
        split: which part of a data set; None: the layout's usual one.
        lit: whether the user gives the light.
    """

    source: Path
    images: Path | None = None
    masks: Path | None = None
    split: str | None = None
    lit: bool = False


@dataclass(frozen=True, eq=False)
class Shot:
    """One photograph of the source.

    Attributes:
        name: where it goes below the capture's images/, with its suffix.
        image: the file.
        camera: in our convention.
        mask: image file whose gray level above 0.5 is inside; None: all of it.
        exposure: pixel value per radiance.
        environment: this photograph's own light; None: the capture's.
        decode: for pixels that our reader would misread: gives radiance F32[H, W, 3] and valid Bool[H, W],
            which are written instead of a copy of the file.
    """

    name: str
    image: Path
    camera: Camera
    mask: Path | None = None
    exposure: float = 1.0
    environment: EnvironmentSource | None = None
    decode: Callable[[], tuple[F32, Bool]] | None = None


@dataclass(frozen=True, eq=False)
class Found:
    """What a source holds; ``skipped`` are photographs that it names and has no camera for."""

    shots: tuple[Shot, ...]
    mesh: Path | None = None
    environment: EnvironmentSource | None = None
    skipped: tuple[str, ...] = ()
    normals_suspect: bool = False
    """The layout is known for meshes whose normals are not those of their triangles."""
    beside: tuple[Path, ...] = ()
    """Folders of the layout outside the source, which its files may lie in."""


def check_links(found: Found, request: Request) -> None:
    """Every file that is copied lies in the source, or in a folder that the user named, links followed.

    Raises:
        InputError: naming the file, and where it leads.
    """
    source = request.source
    named = [folder for folder in (request.images, request.masks) if folder is not None]
    homes = [source if source.is_dir() else source.parent, *found.beside, *named]
    lights = [found.environment, *(shot.environment for shot in found.shots)]
    files = [found.mesh, *(light.file for light in lights if light is not None)]
    for file in (*files, *(file for shot in found.shots for file in (shot.image, shot.mask))):
        if file is not None and (real := leads_outside(file, homes)):
            raise InputError(
                f"is a link that leads outside the project, to {real}",
                file=file,
                expected=f"a file within {homes[0]}",
                hint="Copy the file there, name the folder with --images or --masks, or in "
                f"{LINKS_INTO} if you trust it",
            )


@dataclass(frozen=True)
class Layout:
    """A foreign layout: its name, how to tell it, and its reader."""

    name: str
    matches: Callable[[Path], bool]
    read: Callable[[Request], Found]


def world_from_gl_camera(world_from_camera: Float, what: str, file: str | Path) -> F64:
    """Our pose F64[4, 4] from a world_from_camera [4, 4] with x right, y down, z forward.

    Raises:
        InputError: it is not a rotation and a translation; names ``file`` and ``what``.
    """
    try:
        return rigid(np.asarray(world_from_camera, np.float64) @ GL_FROM_CV, "pose")
    except InputError as error:
        found = error.found.replace("pose", f"the pose of {what}", 1)
        raise InputError(found, file=file, expected=error.expected, hint=error.hint) from error


def image_named(folder: Path, name: str, where: str | Path) -> Path:
    """The photograph that a layout names, with or without its suffix.

    Raises:
        InputError: the name leaves the folder, or there is no such image, or one of a type we do not read.
    """
    path = path_within(folder, name, str(where), "image")
    if path.is_file():
        if path.suffix.lower() not in IMAGE_SUFFIXES:
            raise InputError(
                f"the photograph {name!r} is of type {path.suffix!r}",
                file=where,
                expected="one of " + ", ".join(IMAGE_SUFFIXES),
                hint="Convert the photographs (RAW files: swatchwork prepare linearize), keeping their size",
            )
        return path
    for suffix in (*IMAGE_SUFFIXES, *(s.upper() for s in IMAGE_SUFFIXES)):
        if path.with_name(path.name + suffix).is_file():
            return path_within(folder, os.path.normpath(name) + suffix, str(where), "image")
    raise InputError(
        f"names the photograph {name!r}, and there is no {path}",
        file=where,
        expected="every photograph",
        hint="Say where they are with --images FOLDER",
    )


def mask_for(folder: Path | None, name: str) -> Path | None:
    """The mask of the photograph ``name`` in a folder of masks: NAME.png, or STEM.png.

    Raises:
        InputError: the folder has none for it.
    """
    if folder is None:
        return None
    whole = path_within(folder, name + ".png", str(folder), "mask")
    stem = path_within(folder, str(Path(name).with_suffix(".png")), str(folder), "mask")
    for path in (whole, stem):
        if path.is_file():
            return path
    raise InputError(
        f"has no mask for {name}",
        file=folder,
        expected=f"{whole.name} or {stem.name}, one for each photograph",
    )


def image_folder(request: Request, candidates: tuple[Path, ...]) -> Path:
    """The folder of photographs: the one asked for, or the first candidate that exists.

    Raises:
        InputError: there is none.
    """
    if request.images is not None:
        if not request.images.is_dir():
            raise InputError("no such folder", file=request.images, expected="the photographs, for --images")
        return request.images
    for folder in candidates:
        if folder.is_dir():
            return folder
    raise InputError(
        "the photographs are not found: no " + ", no ".join(map(str, candidates)),
        file=request.source,
        expected="a folder of photographs",
        hint="Say where they are with --images FOLDER",
    )


def numbers(file: Path, count: int) -> F64:
    """The ``count`` numbers of a text file, in order.

    Raises:
        InputError: the file is missing, or has others, or so many that are not finite numbers.
    """
    need_file(file, f"{count} numbers", most=1 << 20)
    try:
        values = np.array(file.read_text(encoding="utf-8").split(), dtype=np.float64)
    except (OSError, ValueError) as error:
        raise InputError(f"is not numbers ({error})", file=file, expected=f"{count} numbers") from error
    if len(values) != count or not np.isfinite(values).all():
        raise InputError(f"has {len(values)} numbers", file=file, expected=f"{count} finite numbers")
    return values

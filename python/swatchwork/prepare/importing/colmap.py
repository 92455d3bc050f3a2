# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""COLMAP sparse models, binary or text, read with pycolmap.

Conventions (COLMAP documentation, "Output Format" and "Camera Models"; ``sensor/models.h``):

- a pose is cam_from_world, of a camera with x right, y down, z forward;
- pixel (0, 0) is the top left corner of the image, so that the first pixel's centre is (0.5, 0.5), as ours;
- the tangential terms of OPENCV are OpenCV's, as ours.

The world is the reconstruction's own: the mesh must be in it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.capture import Camera
from swatchwork.errors import InputError, is_out_of_memory
from swatchwork.prepare.importing.found import (
    Found,
    Layout,
    Request,
    Shot,
    image_folder,
    image_named,
    mask_for,
    world_from_gl_camera,
)

PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
}
"""What the numbers of each camera model are, in COLMAP's order."""


def _is_model(folder: Path) -> bool:
    return any(
        (folder / f"cameras{s}").is_file() and (folder / f"images{s}").is_file() for s in (".bin", ".txt")
    )


def _models(source: Path) -> list[Path]:
    if _is_model(source):
        return [source]
    sparse = source / "sparse"
    if _is_model(sparse):
        return [sparse]
    return sorted(folder for folder in sparse.glob("*") if _is_model(folder)) if sparse.is_dir() else []


def matches(source: Path) -> bool:
    """Whether a folder is a sparse model, or holds some in sparse/."""
    return source.is_dir() and bool(_models(source))


def read(request: Request) -> Found:
    """The registered photographs of the model.

    Raises:
        InputError: pycolmap is missing, no or several models, a damaged one, a camera model that we do not
            have, a photograph that is not there.
    """
    models = _models(request.source)
    if len(models) != 1:
        names = ", ".join(str(m.relative_to(request.source)) for m in models)
        raise InputError(
            f"has {len(models)} sparse models ({names})" if models else "has no sparse model",
            file=request.source,
            expected="one: cameras and images, .bin or .txt, in the folder or in its sparse/0",
            hint="Give the folder of one model, with --images" if models else None,
        )
    model = models[0]
    beside = (request.source / "images", model.parent / "images", model.parent.parent / "images")
    folder = image_folder(request, tuple(dict.fromkeys(beside)))
    shots, skipped = [], []
    images = _reconstruction(model).images.values()
    for image in sorted(images, key=lambda image: str(image.name)):
        if not image.has_pose:
            skipped.append(str(image.name))
            continue
        path = image_named(folder, image.name, model)
        name = path.relative_to(folder).as_posix()
        mask = mask_for(request.masks, name)
        shots.append(Shot(name, path, _camera(image, model), mask))
    return Found(tuple(shots), skipped=tuple(skipped), beside=(folder.parent,))


def _reconstruction(model: Path) -> Any:
    try:
        import pycolmap
    except ImportError as error:
        raise InputError(
            "a COLMAP model is read with pycolmap, which is not installed",
            file=model,
            expected="the package pycolmap",
            hint="pip install 'swatchwork[colmap]'",
        ) from error
    # It logs what it also raises.
    level, pycolmap.logging.minloglevel = pycolmap.logging.minloglevel, pycolmap.logging.FATAL.value
    try:
        return pycolmap.Reconstruction(str(model))
    except Exception as error:  # its readers raise whatever they trip over
        if is_out_of_memory(error):
            raise
        raise InputError(
            f"cannot be read as a COLMAP model ({str(error).strip().splitlines()[-1]})",
            file=model,
            expected="whole cameras, images and points3D files",
            hint="Is one truncated or missing?",
        ) from error
    finally:
        pycolmap.logging.minloglevel = level


def _camera(image: Any, model: Path) -> Camera:
    given = image.camera
    names = PARAMETERS.get(given.model_name)
    if names is None:
        raise InputError(
            f"the camera of {image.name} is of model {given.model_name}",
            file=model,
            expected="one of " + ", ".join(PARAMETERS),
            hint="Run colmap image_undistorter and import its result",
        )
    lens = dict(zip(names, map(float, given.params), strict=True))
    if "f" in lens:
        lens["fx"] = lens["fy"] = lens.pop("f")
    camera_from_world = np.eye(4)
    camera_from_world[:3] = image.cam_from_world().matrix()
    pose = world_from_gl_camera(np.linalg.inv(camera_from_world), image.name, model)
    return Camera(int(given.width), int(given.height), world_from_camera=pose, **lens)


LAYOUT = Layout("colmap", matches, read)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Reading `transforms.json`: nerfstudio's and NeRF-Blender's format with a mesh and an environment."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.capture.camera import Camera, rigid
from swatchwork.capture.capture import CONVENTIONS, Capture, EnvironmentSource, Frame
from swatchwork.capture.fields import Fields, is_file, path_within, shown
from swatchwork.capture.guarding import read_json
from swatchwork.capture.images import IMAGE_SUFFIXES, image_size
from swatchwork.capture.photograph import size_error
from swatchwork.errors import InputError

FORMAT_VERSION = 1
"""What ``format_version`` may say; a file without the key is taken as this version."""

CAMERA_MODELS = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV")
LEAST_EXPOSURE = 1e-12
DISTORTION = ("k1", "k2", "p1", "p2")


def read_capture(path: str | os.PathLike[str], *, require_images: bool = True) -> Capture:
    """Read a capture: a folder with a ``transforms.json``, or such a file.

    Args:
        path: the folder or the JSON file.
        require_images: False reads the cameras alone: mesh, environment and image files may be absent.

    Raises:
        InputError: something in the file, or a file it names, is missing or wrong; names file, frame,
            value and what was expected. Image sizes are checked here, pixels when they are read.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "transforms.json"
    root = file.parent
    fields = Fields(_parsed(file), str(file))
    if "format_version" in fields and fields.number("format_version") != FORMAT_VERSION:
        raise InputError(
            f'"format_version" is {shown(fields.raw("format_version"))}',
            file=file,
            expected=str(FORMAT_VERSION),
            hint="The file was written for another version of swatchwork: update the one or the other",
        )

    # The scene.
    mesh_path = None
    if require_images or "mesh" in fields:
        mesh_path = _scene_file(root, fields.text("mesh"), fields, "mesh", must_exist=require_images)
    occluders = fields.items("occluders", [])
    for occluder in occluders:
        if not isinstance(occluder, str):
            raise fields.error("occluders", occluders, "a list of mesh files")
    occluder_paths = tuple(
        _scene_file(root, o, fields, "occluders", must_exist=require_images) for o in occluders
    )
    environment = None
    if "environment" in fields:
        environment = _environment(root, fields, must_exist=require_images)

    # The frames.
    entries = fields.items("frames")
    if not entries:
        raise InputError('"frames" is empty', file=file, expected="at least one frame (k >= 1)")
    frames: list[Frame] = []
    seen: set[str] = set()
    for number, entry in enumerate(entries):
        frame = _frame(file, number, entry, fields, environment, must_exist=require_images)
        if frame.name in seen:
            raise InputError(
                f'"file_path" {frame.name!r} occurs twice',
                file=f"{file} (frame {number})",
                expected="one frame an image",
            )
        seen.add(frame.name)
        frames.append(frame)
    return Capture(root, file, mesh_path, occluder_paths, environment, tuple(frames))


def _parsed(file: Path) -> Any:
    if not is_file(file):
        raise InputError(
            "no such file", file=file, expected="a capture folder with a transforms.json, or that file"
        )
    return read_json(file)


def _frame(
    file: Path, number: int, entry: Any, common: Fields, shared: EnvironmentSource | None, *, must_exist: bool
) -> Frame:
    root = file.parent
    name = Fields(entry, f"{file} (frame {number})").text("file_path")
    said = name if name.isprintable() and len(name) <= 200 else shown(name)
    fields = Fields(entry, f"{file} (frame {number}, {said})", fallback=common)
    # What is only named may be a link to anywhere; where the size is missing, the image is read.
    read = must_exist or not ("w" in fields and "h" in fields)
    image_path = _image_path(root, name, fields.where, links=read)
    if must_exist and not is_file(image_path):
        raise InputError(
            f'"file_path" is {shown(name)}, and there is no {image_path}',
            file=fields.where,
            expected="an image",
        )
    camera = _camera(fields, image_path)
    has_own_light = fields.values.get("environment") is not None
    frame = Frame(
        name=name,
        image_path=image_path,
        mask_path=_mask_path(root, fields, must_exist),
        exposure=_exposure(fields),
        camera=camera,
        environment=_environment(root, fields, must_exist) if has_own_light else shared,
    )
    if must_exist:
        if frame.environment is None:
            raise InputError(
                'key "environment" is missing',
                file=fields.where,
                expected='an "environment" of the frame or of the capture',
            )
        size = image_size(image_path)
        if size != (camera.width, camera.height):
            raise size_error(f"{image_path} (frame {name})", *size, frame)
    return frame


def _exposure(fields: Fields) -> float:
    """Images are divided by it in 32 bits, and what became of that must be neither infinite nor nothing."""
    exposure = fields.number("exposure", 1.0, positive=True)
    if not LEAST_EXPOSURE <= exposure <= 1 / LEAST_EXPOSURE:
        raise fields.error(
            "exposure", exposure, f"a number from {LEAST_EXPOSURE:g} to {1 / LEAST_EXPOSURE:g}"
        )
    return exposure


def _camera(fields: Fields, image_path: Path) -> Camera:
    """A frame's intrinsics over the file's; what neither has is filled in as NeRF-Blender means it."""
    model = fields.raw("camera_model", "OPENCV")
    if model not in CAMERA_MODELS or fields.raw("is_fisheye", False):
        raise InputError(
            f'"camera_model" is {shown(model)}' if model not in CAMERA_MODELS else '"is_fisheye" is true',
            file=fields.where,
            expected="one of " + ", ".join(CAMERA_MODELS),
            hint="Undistort the photographs to a pinhole camera first",
        )
    for key in ("k3", "k4", "k5", "k6"):
        if fields.number(key, 0.0) != 0:
            raise fields.error(key, fields.raw(key), "0: the lens model has k1, k2, p1, p2")
    if "w" in fields and "h" in fields:
        width, height = fields.pixels("w"), fields.pixels("h")
    elif is_file(image_path):
        width, height = image_size(image_path)
    else:
        raise InputError(
            'keys "w" and "h" are missing',
            file=fields.where,
            expected="the image size in pixels",
            hint=f"There is no {image_path} to take it from",
        )
    if "fl_x" in fields.values or ("fl_x" in fields and "camera_angle_x" not in fields.values):
        fx = fields.number("fl_x", positive=True)
        fy = fields.number("fl_y", fx, positive=True)
    else:
        if "camera_angle_x" not in fields:
            raise InputError(
                'keys "fl_x" and "camera_angle_x" are missing', file=fields.where, expected="one of the two"
            )
        angle_rad = fields.number("camera_angle_x", positive=True)
        if angle_rad >= math.pi:
            raise fields.error("camera_angle_x", angle_rad, "radians below pi")
        fx = fy = 0.5 * width / math.tan(0.5 * angle_rad)
    lens = {key: fields.number(key, 0.0) for key in DISTORTION}
    cx, cy = fields.number("cx", width / 2), fields.number("cy", height / 2)
    try:
        return Camera(width, height, fx, fy, cx, cy, fields.matrix("transform_matrix"), **lens)
    except InputError as error:
        if error.file is not None:
            raise
        found = error.found.replace("pose", '"transform_matrix"')
        raise InputError(found, file=fields.where, expected=error.expected, hint=error.hint) from error


def _environment(root: Path, fields: Fields, must_exist: bool) -> EnvironmentSource:
    entry = Fields(fields.values["environment"], f"{fields.where} (environment)")
    convention = entry.raw("convention", None)
    if convention not in CONVENTIONS:
        raise InputError(
            'key "convention" is missing' if convention is None else f'"convention" is {shown(convention)}',
            file=entry.where,
            expected="one of " + ", ".join(CONVENTIONS),
        )
    file = _scene_file(root, entry.text("file"), entry, "file", must_exist)
    rotation = np.eye(3)
    if "transform_matrix" in entry:
        try:
            rotation = rigid(entry.matrix("transform_matrix"), '"transform_matrix"')[:3, :3]
        except InputError as error:
            if error.file is not None:
                raise
            raise InputError(
                error.found, file=entry.where, expected=error.expected, hint=error.hint
            ) from error
    return EnvironmentSource(file, convention, rotation)


def _scene_file(root: Path, text: str, fields: Fields, key: str, must_exist: bool) -> Path:
    """Mesh, occluder or environment; may lie one folder up, where a test set shares its capture's."""
    path = path_within(root, text, fields.where, key, above=1)
    if must_exist and not is_file(path):
        raise InputError(
            f'"{key}" is {shown(text)}, and there is no {path}',
            file=fields.where,
            expected="an existing file",
        )
    return path


def _image_path(root: Path, name: str, where: str, *, links: bool) -> Path:
    """NeRF-Blender leaves the suffix out: the first image of that name that exists, or else PNG."""
    path = path_within(root, name, where, "file_path", links=links, shared=True)
    if path.suffix.lower() in IMAGE_SUFFIXES or is_file(path):
        return path
    suffixes = (".png", *IMAGE_SUFFIXES)
    found = next((s for s in suffixes if is_file(path.with_name(path.name + s))), suffixes[0])
    return path_within(root, os.path.normpath(name) + found, where, "file_path", links=links, shared=True)


def _mask_path(root: Path, fields: Fields, must_exist: bool) -> Path | None:
    if fields.values.get("mask_path") is None:
        return None
    text = fields.text("mask_path")
    path = path_within(root, text, fields.where, "mask_path", links=must_exist, shared=True)
    if must_exist and not is_file(path):
        raise InputError(
            f'"mask_path" is {shown(text)}, and there is no {path}',
            file=fields.where,
            expected="an existing file",
        )
    return path

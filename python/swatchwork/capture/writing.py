# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Writing `transforms.json`; the reader is in `transforms`."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.capture.camera import Camera
from swatchwork.capture.capture import Capture, EnvironmentSource
from swatchwork.capture.fields import path_within
from swatchwork.capture.transforms import DISTORTION, FORMAT_VERSION
from swatchwork.whole import whole_text


def write_capture(capture: Capture, folder: str | os.PathLike[str]) -> Path:
    """Write ``folder/transforms.json``, with paths relative to the folder; gives the file's path.

    The files that the capture names must lie in the folder (mesh, occluders and environments also
    beside it), since a capture refers to nothing else; nothing is copied.

    Raises:
        InputError: a file of the capture lies elsewhere.
        OutputError: the file cannot be written; one that was there before is intact.
    """
    folder = Path(folder)
    file = folder / "transforms.json"
    document: dict[str, Any] = {"format_version": FORMAT_VERSION}
    if capture.mesh_path is not None:
        document["mesh"] = _relative(capture.mesh_path, folder, "mesh", above=1)
    if capture.environment is not None:
        document["environment"] = _environment_entry(capture.environment, folder)
    if capture.occluder_paths:
        document["occluders"] = [_relative(o, folder, "occluders", above=1) for o in capture.occluder_paths]
    intrinsics = [_intrinsics_entry(frame.camera) for frame in capture.frames]
    shared = all(entry == intrinsics[0] for entry in intrinsics)
    if shared:
        document |= intrinsics[0]
    document["frames"] = []
    for frame, own in zip(capture.frames, intrinsics, strict=True):
        entry: dict[str, Any] = {"file_path": _relative(frame.image_path, folder, "file_path")}
        if folder / os.path.normpath(frame.name) == frame.image_path.with_suffix(""):
            entry["file_path"] = frame.name
        entry["transform_matrix"] = frame.camera.world_from_camera.tolist()
        if frame.mask_path is not None:
            entry["mask_path"] = _relative(frame.mask_path, folder, "mask_path")
        if frame.exposure != 1.0:
            entry["exposure"] = frame.exposure
        if frame.environment is not None and frame.environment is not capture.environment:
            entry["environment"] = _environment_entry(frame.environment, folder)
        document["frames"].append(entry if shared else entry | own)

    return whole_text(file, json.dumps(document, indent=1) + "\n")


def _relative(path: Path, folder: Path, key: str, *, above: int = 0) -> str:
    text = Path(os.path.relpath(path, folder)).as_posix()
    path_within(folder, text, f"{path}", key, above=above)
    return text


def _environment_entry(source: EnvironmentSource, folder: Path) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "file": _relative(source.file, folder, "file", above=1),
        "convention": source.convention,
    }
    if not np.array_equal(source.world_from_environment, np.eye(3)):
        matrix = np.eye(4)
        matrix[:3, :3] = source.world_from_environment
        entry["transform_matrix"] = matrix.tolist()
    return entry


def _intrinsics_entry(camera: Camera) -> dict[str, Any]:
    entry: dict[str, Any] = {"w": camera.width, "h": camera.height, "fl_x": camera.fx, "fl_y": camera.fy}
    entry |= {"cx": camera.cx, "cy": camera.cy}
    return entry | {key: getattr(camera, key) for key in DISTORTION if getattr(camera, key) != 0}

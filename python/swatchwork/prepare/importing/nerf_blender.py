# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""NeRF's Blender layout: transforms_train.json and its siblings, or nerfstudio's transforms.json.

Conventions (nerfstudio documentation, "Data conventions"; the data of Mildenhall et al. 2020): a frame's
transform_matrix is world_from_camera with x right, y up, looking along -z, as ours; camera_angle_x is the
horizontal field of view in radians; a file_path may lack its suffix; PNG alpha is straight. Blender's world
has z up: the mesh must be exported with z up too, and the light's convention is ``blender``.
"""

from __future__ import annotations

from pathlib import Path

from swatchwork.capture import IMAGE_SUFFIXES, read_capture
from swatchwork.errors import InputError
from swatchwork.prepare.importing.found import Found, Layout, Request, Shot, mask_for

USUAL = "train"


def matches(source: Path) -> bool:
    """Whether it is, or holds, such a JSON file."""
    if source.is_file():
        return source.suffix.lower() == ".json"
    return source.is_dir() and any(source.glob("transforms*.json"))


def transforms_file(request: Request, usual: str = USUAL) -> Path:
    """The JSON file of the split asked for.

    Raises:
        InputError: there is none.
    """
    if request.source.is_file():
        return request.source
    split = request.split or usual
    file = request.source / f"transforms_{split}.json"
    alone = request.source / "transforms.json"
    if not file.is_file() and request.split is None and alone.is_file():
        return alone
    if not file.is_file():
        have = ", ".join(sorted(p.name for p in request.source.glob("transforms*.json"))) or "none"
        raise InputError(
            f"has no {file.name} (there is: {have})",
            file=request.source,
            expected="the cameras of a split",
            hint="Say which with --split NAME",
        )
    return file


def read(request: Request) -> Found:
    """The frames of one JSON file.

    Raises:
        InputError: the file is wrong, or a photograph that it names is missing or outside its folder.
    """
    file = transforms_file(request)
    # The light and the mesh are the user's to give: what the file may say of them is not this layout's.
    capture = read_capture(file, require_images=False)
    shots = []
    for frame in capture.frames:
        if not frame.image_path.is_file():
            raise InputError(
                f'"file_path" is {frame.name!r}, and there is no {frame.image_path}',
                file=file,
                expected="an image of type " + ", ".join(IMAGE_SUFFIXES),
            )
        name = frame.image_path.relative_to(capture.root).as_posix().removeprefix("images/")
        mask = mask_for(request.masks, name) if request.masks else frame.mask_path
        shots.append(Shot(name, frame.image_path, frame.camera, mask, frame.exposure))
    return Found(tuple(shots))


LAYOUT = Layout("nerf-blender", matches, read)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Objects with Lighting: dataset/OBJECT/test with inputs/ (Ummenhofer et al. 2024).

Conventions (the data set's README, "Dataset format" and "Coordinate systems"):

- camera_NNNN.txt has K, R, t and width, height, channels; x = K (R X + t), so x right, y down, z forward;
- the first pixel's centre is (0.5, 0.5), as ours;
- 8-bit values are 255 (radiance 2^exposure)^(1/2.2), clipped: not sRGB, so they are decoded here;
- env.hdr: +z is the top, +x the middle, +y a quarter from the left: our ``blender``;
- world_to_env.txt takes world points to the probe's axes.

The data set has no mesh.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swatchwork.arrays import F32, Bool
from swatchwork.capture import Camera, EnvironmentSource, rigid
from swatchwork.capture.images import read_coded
from swatchwork.errors import InputError
from swatchwork.prepare.importing.found import (
    Found,
    Layout,
    Request,
    Shot,
    mask_for,
    numbers,
    world_from_gl_camera,
)

GAMMA = 2.2
USUAL = "inputs"
SPLITS = ("inputs", "gt")


def matches(source: Path) -> bool:
    """Whether a folder has cameras in inputs/ as this data set names them."""
    return (source / "inputs").is_dir() and any((source / "inputs").glob("camera_*.txt"))


def read(request: Request) -> Found:
    """The input photographs under env.hdr, or (split ``gt``) each ground-truth one under its own light.

    Raises:
        InputError: another split, or a file of the layout is missing or wrong.
    """
    split = request.split or USUAL
    if split not in SPLITS:
        raise InputError(f"--split is {split!r}", expected="one of " + ", ".join(SPLITS))
    folder = request.source / "inputs" if split == "inputs" else request.source
    start = "" if split == "inputs" else "gt_"
    files = sorted(folder.glob(f"{start}camera_*.txt"))
    if not files:
        raise InputError(f"has no {start}camera_*.txt", file=folder, expected="the cameras of a split")
    shots = []
    for file in files:
        number = file.stem.removeprefix(f"{start}camera_")
        image = folder / f"{start}image_{number}.png"
        if not image.is_file():
            raise InputError(f"there is no {image.name} beside it", file=file, expected="its photograph")
        exposure = folder / ("exposure.txt" if split == "inputs" else f"gt_exposure_{number}.txt")
        mask: Path | None = folder / f"{start}mask_{number}.png"
        if request.masks is not None:
            mask = mask_for(request.masks, image.name)
        elif mask is not None and not mask.is_file():
            mask = None
        light = None
        if split == "gt" and not request.lit:
            light = _light(request.source, f"gt_env_{number}.hdr", f"gt_world_to_env_{number}.txt")
        shots.append(
            Shot(
                Path(image.name).with_suffix(".exr").name,
                image,
                _camera(file),
                mask,
                environment=light,
                decode=_Decoder(image, float(numbers(exposure, 1)[0])),
            )
        )
    shared = None
    if split == "inputs" and not request.lit:
        shared = _light(request.source, "env.hdr", "world_to_env.txt")
    return Found(tuple(shots), environment=shared)


class _Decoder:
    """Undoes the data set's tone mapping; a value at 255 in any channel is clipped and so no data."""

    def __init__(self, image: Path, exposure: float) -> None:
        self.image, self.exposure = image, exposure

    def __call__(self) -> tuple[F32, Bool]:
        coded = read_coded(self.image)
        if coded.dtype != np.uint8 or coded.shape[2] < 3:
            raise InputError(
                f"has {coded.shape[2]} channels of {coded.dtype.itemsize * 8} bits",
                file=self.image,
                expected="8-bit colour",
            )
        table = ((np.arange(256) / 255.0) ** GAMMA / 2.0**self.exposure).astype(np.float32)
        return table[coded[..., :3]], np.asarray((coded[..., :3] < 255).all(axis=-1))


def _camera(file: Path) -> Camera:
    rows = numbers(file, 24).reshape(8, 3)
    k, rotation, translation = rows[:3], rows[3:6], rows[6]
    fixed = [k[0, 1], k[1, 0], *k[2]]
    if not np.allclose(fixed, [0, 0, 0, 0, 1], atol=1e-9):
        raise InputError(
            f"K is {k.tolist()}", file=file, expected="[[fx, 0, cx], [0, fy, cy], [0, 0, 1]], without skew"
        )
    width, height = int(rows[7, 0]), int(rows[7, 1])
    camera_from_world = np.eye(4)
    camera_from_world[:3, :3], camera_from_world[:3, 3] = rotation, translation
    try:
        rigid(camera_from_world, "R, t")
        pose = world_from_gl_camera(np.linalg.inv(camera_from_world), "R, t", file)
        return Camera(width, height, k[0, 0], k[1, 1], k[0, 2], k[1, 2], pose)
    except InputError as error:
        if error.file is not None:
            raise
        raise InputError(error.found, file=file, expected=error.expected) from error


def _light(folder: Path, image: str, transform: str) -> EnvironmentSource:
    file = folder / transform
    matrix = numbers(file, 16).reshape(4, 4)
    try:
        probe_from_world = rigid(matrix, "world_to_env")[:3, :3]
    except InputError as error:
        raise InputError(error.found, file=file, expected=error.expected) from error
    if not (folder / image).is_file():
        raise InputError("no such file", file=folder / image, expected="the light of the photographs")
    return EnvironmentSource(folder / image, "blender", probe_from_world.T)


LAYOUT = Layout("objects-with-lighting", matches, read)

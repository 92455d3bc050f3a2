# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One frame's pixels as radiance, with what is known of each pixel."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swatchwork.arrays import F32, Bool
from swatchwork.capture.capture import Frame
from swatchwork.capture.exr import read_exr_channels
from swatchwork.capture.images import LINEAR_SUFFIXES, image_size, read_coded, read_image
from swatchwork.errors import InputError

BRIGHTEST = 1e15
"""Radiance, in whatever units: the sun has 1.6e9 candela per square metre. Squares stay finite in 32 bits."""


@dataclass(frozen=True, eq=False)
class Photograph:
    """A photograph as radiance.

    Attributes:
        radiance: F32[H, W, 3], linear, premultiplied by alpha, divided by the exposure.
        alpha: F32[H, W], coverage in [0, 1]; 1 where the file gives none.
        valid: Bool[H, W], the pixel is data: unclipped and inside the mask. Others are missing,
            whatever their radiance.
        mask: Bool[H, W], the mask file alone; None where the frame names none.
    """

    radiance: F32
    alpha: F32
    valid: Bool
    mask: Bool | None = None


def read_photograph(frame: Frame) -> Photograph:
    """Read a frame's image and mask.

    Raises:
        InputError: an image or mask is missing or damaged, disagrees in size with the intrinsics, or a
            pixel inside the mask is negative, infinite or not a number.
    """
    where = f"{frame.image_path} (frame {frame.name})"
    shape = (frame.camera.height, frame.camera.width)
    width, height = image_size(frame.image_path)
    if (height, width) != shape:
        raise size_error(where, width, height, frame)
    image = read_image(frame.image_path)
    valid, mask = ~image.clipped, None
    if frame.mask_path is not None:
        # By its header first: a mask of another size is not decoded.
        width, height = image_size(frame.mask_path)
        if (height, width) != shape:
            raise size_error(f"{frame.mask_path} (mask of frame {frame.name})", width, height, frame)
        mask = read_mask(frame.mask_path)
        valid &= mask
    check_radiance(image.linear, valid, where)
    with np.errstate(over="ignore", invalid="ignore"):
        radiance = image.linear / np.float32(frame.exposure)
    if not np.isfinite(radiance[valid]).all():
        raise InputError(
            f"the radiance is infinite: pixels of up to {image.linear[valid].max():g} over the exposure "
            f"{frame.exposure:g}",
            file=where,
            expected="pixel values and an exposure of a camera",
        )
    radiance[~np.isfinite(radiance)] = 0.0
    alpha = np.ones(shape, dtype=np.float32) if image.alpha is None else image.alpha
    return Photograph(radiance, alpha, valid, mask)


def read_mask(path: Path) -> Bool:
    """Bool[H, W]: the gray level (the mean of a file's colours, as stored) is above 0.5.

    Raises:
        InputError: the file is missing, damaged or of unknown type.
    """
    if path.suffix.lower() in LINEAR_SUFFIXES:
        if path.suffix.lower() == ".exr":
            channels = read_exr_channels(path)
            colours = [channels[name] for name in ("R", "G", "B", "Y") if name in channels]
            gray = np.mean(colours or list(channels.values()), axis=0, dtype=np.float64)
        else:
            gray = read_image(path).linear.mean(axis=-1)
        return np.asarray(gray > 0.5)
    coded = read_coded(path)
    colour = coded[..., :3] if coded.shape[-1] >= 3 else coded
    return np.asarray(colour.mean(axis=-1) > 0.5 * np.iinfo(coded.dtype).max)


def check_radiance(radiance: F32, within: Bool, where: str) -> None:
    """Refuse pixels [H, W, 3] that cannot be light, where ``within`` [H, W] holds.

    Raises:
        InputError: naming how many are not finite, or negative and how much.
    """
    bad = ~np.isfinite(radiance).all(axis=-1) & within
    if bad.any():
        row, column = np.argwhere(bad)[0]
        values = ", ".join(f"{v:g}" for v in radiance[row, column])
        raise InputError(
            f"{np.count_nonzero(bad)} pixels are NaN or infinite, the first at row {row}, column {column} "
            f"({values})",
            file=where,
            expected="finite radiance",
            hint="Repair them, or leave them out by a mask",
        )
    if within.any() and radiance[within].max() > BRIGHTEST:
        raise InputError(
            f"a pixel has {radiance[within].max():g}",
            file=where,
            expected=f"radiance of {BRIGHTEST:g} at most",
            hint="The file may be damaged",
        )
    negative = (radiance < 0).any(axis=-1) & within
    if negative.any():
        row, column = np.argwhere(negative)[0]
        raise InputError(
            f"{np.count_nonzero(negative)} pixels are negative, down to {radiance[negative].min():g}, "
            f"the first at row {row}, column {column}",
            file=where,
            expected="radiance of 0 or more",
            hint="Resampling filters with negative lobes do this: set such pixels to 0, or leave them out by "
            "a mask",
        )


def size_error(where: str, width: int, height: int, frame: Frame) -> InputError:
    """The error for an image whose size is not its camera's."""
    return InputError(
        f"the image is {width} x {height}",
        file=where,
        expected=f"{frame.camera.width} x {frame.camera.height}, the w and h of its intrinsics",
        hint="Scale the intrinsics (fl_x, fl_y, cx, cy, w, h) together with the images",
    )

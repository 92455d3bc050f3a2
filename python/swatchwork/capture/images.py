# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Images in, linear; images out. EXR, Radiance .hdr, 8- and 16-bit PNG, JPEG."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from cv2.utils import logging
from PIL import Image as Pillow

from swatchwork.arrays import F32, U8, Bool, Float
from swatchwork.capture.exr import exr_size, read_exr_channels
from swatchwork.capture.guarding import MOST_IMAGE_BYTES, check_size, need_file
from swatchwork.errors import InputError, OutputError, is_out_of_memory

LINEAR_SUFFIXES = (".exr", ".hdr")
SRGB_SUFFIXES = (".png", ".jpg", ".jpeg")
IMAGE_SUFFIXES = LINEAR_SUFFIXES + SRGB_SUFFIXES

PIXELS_A_BYTE = {".hdr": 16, ".png": 8 * 1032, ".jpg": 1024, ".jpeg": 1024}
"""At most: .hdr packs runs of 127 in 2 bytes a channel, PNG deflates 1032 bytes (8 pixels of one bit) to one,
JPEG takes 6 bits or more for 256 pixels of one colour."""

MOST_HEADER_BYTES = 1 << 16
"""Of a .hdr file, before its pixels."""

MOST_PIXEL_BYTES = 12
"""Of what OpenCV decodes: three floats, for .hdr."""

Coded = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class Image:
    """An image as light.

    Attributes:
        linear: F32[H, W, 3], premultiplied by alpha.
        alpha: F32[H, W] in [0, 1]; None where the file has none.
        clipped: Bool[H, W], some channel of a covered pixel is at the file's largest value, so that
            the light was that much or more. Never true of EXR and .hdr.
    """

    linear: F32
    alpha: F32 | None
    clipped: Bool


def read_image(path: Path) -> Image:
    """Read by suffix: EXR and .hdr as linear numbers, PNG and JPEG decoded from sRGB.

    EXR alpha is taken as premultiplied, PNG alpha as straight; EXR channels clipped.R, .G and .B mark
    saturated pixels. Numbers that are no radiance (negative,
    not finite) come through: what they mean is the caller's to say. A JPEG's orientation tag is left
    alone, since calibrations speak of the pixels as stored.

    Raises:
        InputError: the file is missing, truncated, damaged or of another kind; alpha outside [0, 1].
    """
    suffix = path.suffix.lower()
    if suffix == ".exr":
        return _read_exr(path)
    if suffix == ".hdr":
        linear = np.ascontiguousarray(_decoded(path)[..., ::-1], dtype=np.float32)
        return Image(linear, None, np.zeros(linear.shape[:2], dtype=bool))
    return _from_srgb(read_coded(path))


def read_coded(path: Path) -> Coded:
    """The numbers of a PNG or JPEG as stored, uint8 or uint16 [H, W, 1, 3 or 4], channels in RGBA order.

    Raises:
        InputError: the file is missing, truncated, damaged or of another kind.
    """
    suffix = path.suffix.lower()
    if suffix not in SRGB_SUFFIXES:
        raise InputError(
            f"unknown image type {path.suffix!r}", file=path, expected="one of " + ", ".join(IMAGE_SUFFIXES)
        )
    image_size(path)
    try:
        with Pillow.open(path, formats=_formats(path)) as picture:
            if suffix != ".png":
                gray = picture.mode == "L"
                coded = np.asarray(picture if gray else picture.convert("RGB"))
                return coded[..., None] if gray else coded
            # Pillow checks that the file is whole, but cannot give 16-bit colour: OpenCV can.
            picture.verify()
    except Exception as error:
        if is_out_of_memory(error):
            raise
        raise _damaged(path, str(error)) from error
    pixels = _decoded(path)
    if pixels.ndim == 2:
        return pixels[..., None]
    order = [2, 1, 0, 3] if pixels.shape[2] == 4 else [2, 1, 0]
    return np.ascontiguousarray(pixels[..., order])


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) from the file's header, without reading the pixels.

    Raises:
        InputError: the file is missing or not an image, or declares more than we read or it can hold.
    """
    suffix = path.suffix.lower()
    if suffix == ".exr":
        return exr_size(path)
    length = need_file(path, "an image", most=MOST_IMAGE_BYTES)
    if suffix == ".hdr":
        width, height = _hdr_size(path)
    else:
        try:
            # Pillow warns of pictures half as large as those that it refuses.
            with (
                warnings.catch_warnings(action="ignore"),
                Pillow.open(path, formats=_formats(path)) as picture,
            ):
                width, height = (int(side) for side in picture.size)
        except Exception as error:
            if is_out_of_memory(error):
                raise
            raise _damaged(path, str(error)) from error
    check_size(path, width, height, file_bytes=length, most_a_byte=PIXELS_A_BYTE.get(suffix, np.inf))
    return width, height


def write_png(path: Path, coded: U8) -> None:
    """Write numbers already encoded for display, uint8 [H, W, 3] or [H, W, 4] (straight alpha).

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        Pillow.fromarray(np.ascontiguousarray(coded, dtype=np.uint8)).save(path, format="PNG")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error})") from error


def linear_from_srgb(coded: Float) -> F32:
    """Decode sRGB values in [0, 1] (IEC 61966-2-1) to linear ones."""
    coded = np.asarray(coded, dtype=np.float32)
    low = coded / np.float32(12.92)
    high = ((coded + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(coded <= 0.04045, low, high).astype(np.float32)


def _from_srgb(coded: Coded) -> Image:
    largest = np.iinfo(coded.dtype).max
    table = linear_from_srgb(np.arange(largest + 1) / largest)
    colour = coded[..., :3] if coded.shape[-1] >= 3 else np.repeat(coded[..., :1], 3, axis=-1)
    linear = table[colour]
    # Reductions along so short an axis take NumPy ten times as long.
    clipped = (colour[..., 0] == largest) | (colour[..., 1] == largest) | (colour[..., 2] == largest)
    if coded.shape[-1] < 4:
        return Image(linear, None, clipped)
    alpha = coded[..., 3].astype(np.float32) / np.float32(largest)
    return Image(linear * alpha[..., None], alpha, clipped & (alpha > 0))


def _read_exr(path: Path) -> Image:
    channels = read_exr_channels(path)
    prefix = _colour_layer(path, list(channels))
    names = [prefix + c for c in "RGB"] if prefix + "R" in channels else [prefix + "Y"] * 3
    linear = np.stack([channels[name].astype(np.float32) for name in names], axis=-1)
    alpha = None
    if prefix + "A" in channels:
        alpha = channels[prefix + "A"].astype(np.float32)
        # Reconstruction filters leave alpha a little outside [0, 1]; more than that is another thing.
        wrong = ~((alpha >= -0.02) & (alpha <= 1.02))
        if wrong.any():
            raise InputError(
                f"alpha has {np.count_nonzero(wrong)} values outside [0, 1], such as {alpha[wrong][0]:g}",
                file=path,
                expected="coverage between 0 and 1",
            )
        alpha = np.clip(alpha, 0, 1)
    # As `prepare linearize` marks what is saturated: the numbers there are a reading, not the light.
    marks = [channels[f"clipped.{c}"] > 0 for c in "RGB" if f"clipped.{c}" in channels]
    clipped = np.any(marks, axis=0) if marks else np.zeros(linear.shape[:2], dtype=bool)
    return Image(linear, alpha, np.asarray(clipped, dtype=np.bool_))


def _colour_layer(path: Path, names: list[str]) -> str:
    """Prefix of the one layer with colour: "" for plain R, G, B or Y, "View.Combined." for Blender's."""
    layers = {
        name[:-1] for name in names if name[-1:] == "R" and {name[:-1] + "G", name[:-1] + "B"} <= {*names}
    }
    if "" in layers:
        return ""
    if "Y" in names:
        return ""
    combined = {layer for layer in layers if layer.endswith("Combined.")} or layers
    if len(combined) == 1:
        return combined.pop()
    raise InputError(
        "channels " + ", ".join(names), file=path, expected="R, G, B (and A), or Y, in one layer"
    )


def _decoded(path: Path) -> npt.NDArray[np.uint8]:
    """OpenCV's reading of a file, channels in its order (BGR); one that it reports damaged is refused."""
    width, height = image_size(path)
    level = logging.getLogLevel()
    logging.setLogLevel(0)
    try:
        pixels = cv2.imdecode(np.fromfile(path, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        if is_out_of_memory(error):
            raise
        raise _damaged(path, str(error).strip()) from error
    finally:
        logging.setLogLevel(level)
    if pixels is None:
        # It says no more where memory was refused: ask for as much, which raises MemoryError then.
        np.empty((height, width, MOST_PIXEL_BYTES), dtype=np.uint8)
        raise _damaged(path, "the pixels could not be decoded")
    return pixels  # type: ignore[no-any-return]


def _hdr_size(path: Path) -> tuple[int, int]:
    """From the line "-Y height +X width", which follows the header's blank one."""
    with path.open("rb") as file:
        start = file.read(MOST_HEADER_BYTES)
    if not start.startswith(b"#?"):
        raise _damaged(path, "it does not begin with #?")
    found = re.search(rb"\n\r?\n-Y +([0-9]{1,9}) +\+X +([0-9]{1,9})[ \r]*\n", start)
    if found is None:
        raise _damaged(path, 'its header has no line "-Y height +X width"')
    return int(found[2]), int(found[1])


def _formats(path: Path) -> tuple[str]:
    """Pillow's name of what a file must be: its many other readers are not for strangers' files."""
    return ("PNG",) if path.suffix.lower() == ".png" else ("JPEG",)


def _damaged(path: Path, reason: str) -> InputError:
    return InputError(
        f"cannot be read as an image ({reason})",
        file=path,
        expected=f"a complete {path.suffix.lower().lstrip('.').upper()} file",
        hint="It may be truncated, or of another type than its name says",
    )

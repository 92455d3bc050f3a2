# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""RAW files, developed linearly (LibRaw): nothing brightened, no gamma, white balance fixed, clipping kept.

Values are shares of the way from the sensor's black level to its white level, times white balance
multipliers whose green is 1. Colours are taken to linear sRGB (Rec. 709 primaries, D65 white) by the
camera's own matrix, as LibRaw knows it or the DNG gives it, in float, so that nothing is clipped twice.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

from ..arrays import F32, F64, Bool
from ..errors import InputError
from .white_balance import WhiteBalance

# fmt: off
RAW_SUFFIXES = (
    ".dng", ".nef", ".nrw", ".cr2", ".cr3", ".crw", ".arw", ".sr2", ".raf",
    ".orf", ".rw2", ".pef", ".srw", ".3fr", ".iiq", ".kdc", ".mrw", ".rwl",
)
# fmt: on

Colour = Literal["srgb", "camera"]

CLIPPED = 0.99
"""Share of the way from black to white from which a photosite counts as saturated: sensors bend and scatter a
little before the white level that LibRaw states."""

DEMOSAIC = "AHD"
"""Of rawpy's DemosaicAlgorithm: Hirakawa and Parks 2005, in every LibRaw, of bounded reach. DCB carries one
photosite 20 pixels; DHT and AAHD, which scale by the brightest of all, carry it across the whole picture."""
DEMOSAIC_OTHER = "VNG"
"""Of mosaics without a 2 x 2 period (X-Trans): for AHD LibRaw takes a method of its own there, which gives
other values at each run."""

FOOTPRINT_PX = 11
"""Side of the square of photosites that may change a pixel. AHD interpolates green from 2 pixels away and the
other colours from 1 more, compares each pixel with the next, and sums this over neighbours to choose one of
two directions: 5 pixels. Measured, too: one saturated photosite changes values by more than 1 % of full scale
5 pixels away, and none farther; of VNG it is 2 (tests)."""

# Linear sRGB to CIE XYZ (IEC 61966-2-1).
_XYZ_FROM_SRGB = np.array(
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)


@dataclass(frozen=True, eq=False)
class Developed:
    """One RAW file as light.

    Attributes:
        linear: F32[H, W, 3]; 1 is the sensor's white level in green. Not cut at 0 or 1.
        clipped: Bool[H, W, 3], a photosite of that camera channel near the pixel is saturated.
        white_balance: the multipliers used, green 1.
        matrix: F64[3, 3] linear sRGB from white-balanced camera colours; None where they were left.
        black, white: levels of the file, in its own numbers.
    """

    linear: F32
    clipped: Bool
    white_balance: tuple[float, float, float]
    matrix: F64 | None
    black: tuple[int, ...]
    white: int


def develop(file: Path, white_balance: WhiteBalance = "daylight", colour: Colour = "srgb") -> Developed:
    """Develop one RAW file, pixels as the sensor has them (not turned by its orientation tag).

    Raises:
        InputError: rawpy is not installed; the file is missing, damaged or no mosaic of three colours; it has
            no colour matrix or no such white balance; multipliers are not positive.
    """
    rawpy = _rawpy()
    with _opened(file) as raw:
        mosaic = raw.raw_image_visible if raw.raw_type == rawpy.RawType.Flat else None
        if mosaic is None or raw.num_colors != 3:
            raise InputError(
                f"{raw.num_colors} colours, {raw.raw_type.name} pixels",
                file=file,
                expected="a mosaic of red, green and blue photosites",
            )
        daylight, matrix = _colours(raw)
        if colour == "srgb" and matrix is None:
            raise InputError(
                "no colour matrix is known for this camera",
                file=file,
                expected="a camera that LibRaw knows, or a DNG with ColorMatrix1",
                hint="--colour camera keeps the camera's own primaries",
            )
        multipliers = _multipliers(file, raw, white_balance, daylight)
        black = tuple(int(b) for b in raw.black_level_per_channel)
        stated = [int(w) for w in raw.camera_white_level_per_channel or [] if w > 0]
        white = min([int(raw.white_level), *stated])
        clipped = _clipped(mosaic, raw.raw_colors_visible, black, white)
        r, g, b = multipliers
        bayer = raw.raw_pattern is not None and raw.raw_pattern.shape == (2, 2)
        pixels = raw.postprocess(
            gamma=(1, 1),
            no_auto_bright=True,
            adjust_maximum_thr=0.0,
            output_bps=16,
            output_color=rawpy.ColorSpace.raw,
            user_wb=[r, g, b, g],
            # Scales by the largest multiplier instead of the smallest, so that nothing is cut.
            highlight_mode=rawpy.HighlightMode.Ignore,
            user_flip=0,
            demosaic_algorithm=rawpy.DemosaicAlgorithm[DEMOSAIC if bayer else DEMOSAIC_OTHER],
        )
        scale = max(multipliers) / 65535 * (int(raw.white_level) - min(black)) / (white - min(black))
    linear = pixels.astype(np.float32) * np.float32(scale)
    if colour == "camera" or matrix is None:
        return Developed(linear, clipped, multipliers, None, black, white)
    linear = np.asarray(linear @ matrix.T.astype(np.float32), dtype=np.float32)
    return Developed(linear, clipped, multipliers, matrix, black, white)


def raw_exposure(file: Path) -> dict[str, float]:
    """time (s), iso and aperture as the file says; 0 where it does not. Raises InputError as `develop`."""
    with _opened(file) as raw:
        other = raw.other
        return {"time": other.shutter_speed, "iso": other.iso_speed, "aperture": other.aperture}


def _rawpy() -> Any:
    try:
        import rawpy
    except ImportError as error:
        raise InputError(
            "RAW files need rawpy, which is not installed",
            expected="the extra `raw`",
            hint="pip install swatchwork[raw]",
        ) from error
    return rawpy


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    rawpy = _rawpy()
    if not file.is_file():
        raise InputError("no such file", file=file, expected="a RAW photograph")
    try:
        with rawpy.imread(str(file)) as raw:
            yield raw
    except rawpy.LibRawError as error:
        reason = error.args[0].decode() if error.args and isinstance(error.args[0], bytes) else str(error)
        raise InputError(
            f"cannot be read as RAW ({reason})",
            file=file,
            expected="a complete RAW file of a camera that LibRaw knows",
        ) from error


def _colours(raw: Any) -> tuple[F64 | None, F64 | None]:
    """Daylight multipliers and linear sRGB from camera colours balanced by them; None where not known."""
    cam_from_xyz = np.asarray(raw.rgb_xyz_matrix, dtype=np.float64)[:3]
    if cam_from_xyz.any():
        cam_from_srgb = cam_from_xyz @ _XYZ_FROM_SRGB
        white = cam_from_srgb.sum(axis=1)
        return white[1] / white, np.linalg.inv(cam_from_srgb / white[:, None])
    # A DNG's ColorMatrix1, which LibRaw has brought to this form already.
    matrix = np.asarray(raw.color_matrix, dtype=np.float64)[:, :3]
    daylight = np.asarray(raw.daylight_whitebalance, dtype=np.float64)[:3]
    return (daylight / daylight[1] if (daylight > 0).all() else None), (matrix if matrix.any() else None)


def _multipliers(
    file: Path, raw: Any, white_balance: WhiteBalance, daylight: F64 | None
) -> tuple[float, float, float]:
    if white_balance == "daylight":
        found = daylight
    elif white_balance == "camera":
        found = np.asarray(raw.camera_whitebalance, dtype=np.float64)[:3]
    else:
        found = np.asarray(white_balance, dtype=np.float64)
    if found is None or not (np.isfinite(found).all() and (found > 0).all()):
        what = white_balance if isinstance(white_balance, str) else "given"
        said = "none" if found is None else ", ".join(f"{m:g}" for m in found)
        raise InputError(
            f"the {what} white balance is {said}",
            file=file,
            expected="three positive multipliers",
            hint="Give --white-balance R,G,B",
        )
    r, g, b = (float(m) for m in found / found[1])
    return r, g, b


def _clipped(mosaic: Any, colours: Any, black: tuple[int, ...], white: int) -> Bool:
    """Bool[H, W, 3]: saturated photosites of each channel, spread over what demosaicing reads."""
    levels = np.array([b + CLIPPED * (white - b) for b in black])
    saturated = mosaic >= levels[colours]
    # The mosaic's fourth colour is the second green.
    channel = np.where(colours == 3, 1, colours)
    kernel = np.ones((FOOTPRINT_PX, FOOTPRINT_PX), dtype=np.uint8)
    spread = [cv2.dilate((saturated & (channel == c)).astype(np.uint8), kernel) for c in range(3)]
    return np.stack(spread, axis=-1) > 0

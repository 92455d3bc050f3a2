# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs as a browser can show them, as bright as a person wants them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from threading import Lock

import cv2
import numpy as np

from ..arrays import F32, U8, U16
from ..capture import read_image
from ..capture.images import LINEAR_SUFFIXES
from ..report.pictures import exposure_for

KEPT = 3
"""Photographs in memory, at 6 bytes a pixel."""
QUALITY = 95
ENOUGH = 500
"""Rows and columns that the exposure is judged by."""
CODES = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)
"""The number that each bit pattern of a half float stands for."""


class Pictures:
    """JPEGs of photographs, read when asked for."""

    def __init__(self, files: Sequence[Path]) -> None:
        self._files = list(files)
        self._kept: OrderedDict[int, U16] = OrderedDict()
        self._lock = Lock()

    def jpeg(self, number: int, stops: float) -> bytes:
        """Photograph ``number`` as sRGB, 2^stops times as bright as shown at first.

        At first EXR and .hdr are exposed so that their bright parts are bright; others are as they are.

        Raises:
            InputError: the photograph cannot be read.
        """
        with self._lock:
            half = self._halves(number)
        # Half floats have 11 bits of mantissa, more than the eye and JPEG: a table does the rest.
        table = _srgb_codes(CODES, 2.0**stops)
        # OpenCV wants BGR, and full colour resolution: a click aims at pixels.
        options = [
            cv2.IMWRITE_JPEG_QUALITY,
            QUALITY,
            cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
            cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
        ]
        return bytes(cv2.imencode(".jpg", table[half[..., ::-1]], options)[1])

    def _halves(self, number: int) -> U16:
        if number not in self._kept:
            file = self._files[number]
            image = read_image(file)
            linear = np.nan_to_num(image.linear, nan=0.0, posinf=6e4, neginf=0.0)
            exposure = _exposure(linear, image.alpha) if file.suffix.lower() in LINEAR_SUFFIXES else 1.0
            # Scaled first, so that very dark radiance does not fall below what a half can hold.
            half = np.clip(linear * np.float32(exposure), 0, 6e4).astype(np.float16).view(np.uint16)
            self._kept[number] = half
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(number)
        return self._kept[number]


def _exposure(linear: F32, alpha: F32 | None) -> float:
    step = max(1, min(linear.shape[:2]) // ENOUGH)
    some = linear[::step, ::step]
    return exposure_for(some, np.ones(some.shape[:2]) if alpha is None else alpha[::step, ::step])


def _srgb_codes(linear: F32, factor: float) -> U8:
    """8-bit codes (IEC 61966-2-1) of finite numbers times a factor; others are black."""
    finite = np.where(np.isfinite(linear), linear, 0)
    shown = np.clip(finite * np.float32(factor), 0, 1)
    coded = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
    return np.asarray(np.round(255 * coded), dtype=np.uint8)

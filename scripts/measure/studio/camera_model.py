# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From radiance to the files of a camera: exposure, photon and read noise, saturation, response, coding."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pillow
from PIL.TiffImagePlugin import IFDRational

from swatchwork.arrays import F64, Float

FULL_WELL, READ_NOISE = 30_000.0, 6.0
"""In electrons."""
QUALITY, CHROMA = 95, 1
"""Of JPEGs; colour at half of the pixels across (4:2:2), as cameras write it."""
CONTRAST = 0.25
"""Of the S-curve that the camera puts over sRGB's."""
STOPS = 4.0
"""Factor between the exposures of a bracket."""
APERTURE, ISO = 8.0, 100
EXIF_FOLDER, TIME_TAG, APERTURE_TAG, ISO_TAG = 0x8769, 33434, 33437, 34855


@dataclass(frozen=True)
class Camera8:
    """JPEGs with a response of the camera's own, and exposures in EXIF."""

    suffix: str = ".jpg"
    response: str = "recover"
    """For `prepare linearize`."""

    def coded(self, signal: F64) -> F64:
        """Codes in [0, 1] of signals in [0, 1]."""
        srgb = np.where(
            signal <= 0.0031308, 12.92 * signal, 1.055 * np.maximum(signal, 1e-9) ** (1 / 2.4) - 0.055
        )
        return np.asarray(srgb + CONTRAST * (srgb * srgb * (3 - 2 * srgb) - srgb))

    def write(self, file: Path, signal: F64, time_s: float) -> None:
        picture = Pillow.fromarray((self.coded(signal) * 255 + 0.5).astype(np.uint8))
        exif = Pillow.Exif()
        exif[EXIF_FOLDER] = {
            TIME_TAG: IFDRational(round(time_s * 1_000_000), 1_000_000),
            APERTURE_TAG: IFDRational(round(APERTURE * 10), 10),
            ISO_TAG: ISO,
        }
        picture.save(file, quality=QUALITY, subsampling=CHROMA, exif=exif)


@dataclass(frozen=True)
class Camera16:
    """PNGs of 16 bits, linear, and exposures in a table."""

    suffix: str = ".png"
    response: str = "gamma:1"

    def coded(self, signal: F64) -> F64:
        """Codes in [0, 1] of signals in [0, 1]."""
        return signal

    def write(self, file: Path, signal: F64, time_s: float) -> None:
        coded = (signal[..., ::-1] * 65535 + 0.5).astype(np.uint16)
        if not cv2.imwrite(str(file), coded):
            raise SystemExit(f"{file}: cannot be written")


CameraKind = Camera8 | Camera16
CAMERAS: dict[str, CameraKind] = {"jpeg": Camera8(), "linear16": Camera16()}


def signals(radiance: Float, time_s: float, rng: np.random.Generator) -> F64:
    """What the sensor reads over its full scale: radiance 1 fills it in 1/100 s."""
    electrons = np.asarray(radiance, np.float64) * (time_s * 100) * FULL_WELL
    read = rng.poisson(np.maximum(electrons, 0)) + READ_NOISE * rng.normal(size=electrons.shape)
    return np.clip(read / FULL_WELL, 0, 1)


def bracket(middle: float, count: int) -> list[float]:
    """Exposure times in seconds, shortest first, two stops apart, as a camera's dial has them."""
    return [float(f"{middle * STOPS ** (i - count // 2):.2g}") for i in range(count)]


def times_for(pictures: Sequence[Float], count: int) -> list[float]:
    """A bracket whose shortest exposure keeps all but a ten-thousandth of the pixels below full scale."""
    bright = max(float(np.quantile(picture, 0.9999)) for picture in pictures)
    return bracket(0.8 / bright / 100 * STOPS ** (count // 2), count)


def photograph(
    kind: CameraKind, folder: Path, pictures: Sequence[Float], times: Sequence[float], *, name: str, seed: int
) -> list[list[Path]]:
    """Take each picture at all times, as NAME_0001 and on; the files of each. Writes exposures.csv, too."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    taken: list[list[Path]] = []
    rows = []
    for i, picture in enumerate(pictures):
        taken.append([])
        for j, time_s in enumerate(times):
            file = folder / f"{name}_{i * len(times) + j + 1:04d}{kind.suffix}"
            kind.write(file, signals(picture, time_s, rng), time_s)
            taken[-1].append(file)
            rows.append([file.name, f"{time_s:.9g}", ISO, APERTURE])
    with (folder / "exposures.csv").open("w", newline="", encoding="utf-8") as out:
        csv.writer(out).writerows([["file", "time", "iso", "aperture"], *rows])
    return taken

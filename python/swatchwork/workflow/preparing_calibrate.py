# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs of a board to intrinsics.json, with a picture of the corners and what is left of them."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..arrays import F64, U8
from ..capture import Camera, read_json, write_png
from ..capture.fields import Fields
from ..errors import InputError
from ..prepare import Board, Calibration, calibrate
from ..prepare.calibrate import SUFFIXES
from ..progress import SILENT, Progress
from ..report.pictures import PALETTE, rgb
from ..whole import write_text
from .together import files_together

PICTURE_PX = 1200
ARROW_PX = 14.0
"""Length at which a residual as large as the rms is drawn."""


@dataclass(frozen=True)
class CalibrateSummary:
    """The camera and its figures of merit."""

    output: str
    picture: str
    intrinsics: dict[str, float]
    figures: dict[str, Any]
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "output": self.output,
            "picture": self.picture,
            **self.intrinsics,
            "figures": self.figures,
            "seconds": self.seconds,
        }

    def in_words(self) -> str:
        """A line for a person."""
        i, f = self.intrinsics, self.figures
        return (
            f"{f['images']} photographs in {self.output}: rms {f['rms_px']:.3f} px; "
            f"focal length {i['fl_x']:.1f}, {i['fl_y']:.1f} px (known to {f['deviation_px']['fl_x']:.1f}), "
            f"centre {i['cx']:.1f}, {i['cy']:.1f}; "
            f"corners cover {100 * f['coverage']:.0f} % of the image; {self.picture} shows what is left "
            f"({self.seconds:.0f} s)"
        )


def calibrate_photographs(
    places: Sequence[str | PathLike[str]],
    output: str | PathLike[str],
    board: Board,
    progress: Progress = SILENT,
) -> CalibrateSummary:
    """Write ``output`` (JSON with the keys of transforms.json) and a picture beside it.

    Args:
        places: photographs of the board, or folders of them.

    Raises:
        InputError: as `swatchwork.prepare.calibrate`; a place is missing or has no photograph.
        OutputError: a file cannot be written; those there before are intact.
    """
    start = time.perf_counter()
    file = Path(output)
    if file.suffix.lower() != ".json" or file.is_dir():
        raise InputError(f"the output is {file}", expected="a file ending in .json")
    found = calibrate(_photographs([Path(place) for place in places]), board, progress)
    intrinsics, figures = intrinsics_of(found), figures_of(found)
    picture = file.with_name(f"{file.stem}.corners.png")
    text = json.dumps({"camera_model": "OPENCV", **intrinsics, "figures": figures}, indent=1, allow_nan=False)
    with files_together(file.parent, file.name) as made:
        write_text(made / file.name, text + "\n")
        write_png(made / picture.name, residual_picture(found))
    return CalibrateSummary(str(file), str(picture), intrinsics, figures, time.perf_counter() - start)


def intrinsics_of(found: Calibration) -> dict[str, float]:
    """By the names of transforms.json; pixel centres at +0.5."""
    c = found.camera
    size = {"w": c.width, "h": c.height, "fl_x": c.fx, "fl_y": c.fy, "cx": c.cx, "cy": c.cy}
    return {**size, "k1": c.k1, "k2": c.k2, "p1": c.p1, "p2": c.p2}


EXPECTED = "intrinsics: w, h, fl_x, fl_y, cx, cy as `swatchwork prepare calibrate` writes them"


def read_intrinsics(file: str | PathLike[str]) -> Camera:
    """A camera at the origin with the intrinsics that ``calibrate_photographs`` wrote.

    Raises:
        InputError: the file is missing, no JSON, or lacks a number.
    """
    path = Path(file)
    document = read_json(path, EXPECTED)
    try:
        fields = Fields(document, str(path))
        size = fields.pixels("w"), fields.pixels("h")
        fx, fy = (fields.number(key, positive=True) for key in ("fl_x", "fl_y"))
        cx, cy = (fields.number(key) for key in ("cx", "cy"))
        k1, k2, p1, p2 = (fields.number(key, 0.0) for key in ("k1", "k2", "p1", "p2"))
        return Camera(*size, fx, fy, cx, cy, np.eye(4), k1, k2, p1, p2)
    except InputError as error:
        raise InputError(
            f"cannot be read as intrinsics ({error.found})",
            file=path,
            expected=EXPECTED,
        ) from error


def figures_of(found: Calibration) -> dict[str, Any]:
    """What says how far the intrinsics are to be trusted."""
    return {
        "rms_px": found.rms_px,
        "deviation_px": dict(zip(("fl_x", "fl_y", "cx", "cy"), found.deviation_px, strict=True)),
        "images": len(found.sightings),
        "corners": sum(len(s.uv_px) for s in found.sightings),
        "image_rms_px": {
            s.file.name: rms for s, rms in zip(found.sightings, found.image_rms_px, strict=True)
        },
        "coverage": float(found.coverage.mean()),
        "outliers": [file.name for file in found.outliers],
        "not_found": [file.name for file in found.not_found],
    }


def residual_picture(found: Calibration) -> U8:
    """All corners where they were found, a colour an image, with magnified residuals; empty cells in gray."""
    camera = found.camera
    scale = PICTURE_PX / max(camera.width, camera.height)
    width, height = round(camera.width * scale), round(camera.height * scale)
    canvas = np.full((height + 30, width, 3), 255, dtype=np.uint8)
    cells = np.asarray(np.where(found.coverage, 255, 226), dtype=np.uint8)
    canvas[:height] = cv2.resize(cells, (width, height), interpolation=cv2.INTER_NEAREST)[..., None]
    larger = ARROW_PX / max(found.rms_px, 1e-9)
    for i, (sighting, residual) in enumerate(zip(found.sightings, found.residual_px, strict=True)):
        colour = rgb(PALETTE[i % len(PALETTE)])
        for uv, left in zip(sighting.uv_px * scale, residual * larger, strict=True):
            start = _point(uv)
            cv2.circle(canvas, start, 2, colour, -1, cv2.LINE_AA)
            cv2.line(canvas, start, _point(uv + left), colour, 1, cv2.LINE_AA)
    centre = _point(np.array([camera.cx, camera.cy]) * scale)
    cv2.drawMarker(canvas, centre, (0, 0, 0), cv2.MARKER_CROSS, 22, 1, cv2.LINE_AA)
    text = (
        f"rms {found.rms_px:.3f} px; lines: what is left of each corner, {larger / scale:.0f} times as long; "
        "cross: principal point; gray: no corner"
    )
    at = (8, height + 20)
    cv2.putText(canvas, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
    return canvas


def _point(uv: F64) -> tuple[int, int]:
    # OpenCV draws with pixel centres at whole numbers.
    return round(float(uv[0]) - 0.5), round(float(uv[1]) - 0.5)


def _photographs(places: Sequence[Path]) -> list[Path]:
    files: list[Path] = []
    for place in places:
        if place.is_dir():
            files += sorted(f for f in place.iterdir() if f.suffix.lower() in SUFFIXES and f.is_file())
        elif place.is_file():
            files.append(place)
        else:
            raise InputError("no such file or folder", file=place, expected="photographs of a board")
    if not files:
        raise InputError(
            "there are no photographs", file=places[0], expected="files ending in " + ", ".join(SUFFIXES)
        )
    return files

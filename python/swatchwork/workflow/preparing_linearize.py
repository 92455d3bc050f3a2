# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs to radiance EXRs, with what was done to them, a contact sheet and the response."""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..arrays import U8
from ..capture import linear_from_srgb, read_json, write_png
from ..errors import CaptureWarning, InputError
from ..prepare import Linearized, LinearizeOptions, LinearView, linearize, photographs_in
from ..prepare.linearize import DEFAULT
from ..progress import SILENT, Progress
from ..report import curve_plot, display, exposure_for
from ..whole import write_text
from .together import files_together

MISSING_COLOUR = (235, 60, 200)
"""Of saturated pixels on the contact sheet: nothing photographed looks like it."""
CLIPPED = (
    "of the camera's own red, green and blue, whether it is saturated in every exposure; R, G, B then hold "
    "what the shortest one reads, which is "
)
UNMIXED = "no more light than there was"
MIXED = (
    "through srgb_from_camera, whose negative entries mean that a colour can read more light than there was"
)

COLUMNS, CELL_PX, CAPTION_PX = 5, 244, 22


@dataclass(frozen=True)
class LinearizeSummary:
    """What was written, and its figures of merit."""

    output: str
    views: int
    photographs: int
    response: str | None
    """None of RAW."""
    white_balance: tuple[float, float, float] | None
    """Multipliers of RAW, green 1; None of JPEG."""
    residual: float | None
    """Rms of log radiance between photographs of the same pixel, over all views; None without brackets."""
    worst_step: float | None
    """Of neighbours in a bracket, the ratio of radiances farthest from 1; None without brackets."""
    missing: float
    """Share of pixels saturated in every exposure."""
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        text = f"{self.views} views of {self.photographs} photographs in {self.output}: "
        if self.residual is not None:
            text += f"exposures agree to {100 * self.residual:.1f} % a pixel"
            if self.worst_step is not None:
                text += f", to {100 * abs(self.worst_step - 1):.1f} % on the whole"
            text += "; "
        if self.white_balance is not None:
            text += f"white balance {_numbers(self.white_balance)}; "
        text += f"{100 * self.missing:.2f} % of pixels saturated; contact-sheet.png shows them"
        return f"{text} ({self.seconds:.0f} s)"


def linearize_photographs(
    places: Sequence[str | PathLike[str]],
    output: str | PathLike[str],
    options: LinearizeOptions = DEFAULT,
    progress: Progress = SILENT,
) -> LinearizeSummary:
    """Write ``output/VIEW.exr`` of each view, linearize.json, contact-sheet.png and (of JPEG) response.svg.

    Args:
        places: photographs, and folders of them.
        output: a folder; files of these names in it are replaced, linearize.json last: it lists its own. What
            an older linearize.json lists, and this run does not write, is removed.

    Raises:
        InputError: as `swatchwork.prepare.linearize`.
        OutputError: the folder cannot be written.
    """
    start = time.perf_counter()
    files = photographs_in([Path(place) for place in places])
    folder = Path(output)
    with files_together(folder, "linearize.json", _written_with) as made:
        found = linearize(files, made, options, progress)
        write_text(made / "linearize.json", json.dumps(described(found), indent=1, allow_nan=False) + "\n")
        write_png(made / "contact-sheet.png", contact_sheet(found.views))
        if found.response is not None:
            write_text(made / "response.svg", _response_plot(found))
    if found.raw is not None and options.white_balance == "camera":
        warnings.warn(
            f"the white balance ({_numbers(found.raw.white_balance)}) is what the camera stored in "
            f"{found.views[0].files[0].name}, and may be another one for the next run: give --white-balance "
            f"{folder / 'linearize.json'} to that for the light probe",
            CaptureWarning,
            stacklevel=2,
        )
    residuals = [v.residual for v in found.views if v.residual is not None]
    steps = [s for v in found.views for s in v.steps if math.isfinite(s)]
    pixels = np.array([v.size[0] * v.size[1] for v in found.views], dtype=np.float64)
    return LinearizeSummary(
        str(folder),
        len(found.views),
        len(files),
        found.response.name if found.response is not None else None,
        found.raw.white_balance if found.raw is not None else None,
        float(np.sqrt(np.mean(np.square(residuals)))) if residuals else None,
        max(steps, key=lambda s: abs(math.log(s))) if steps else None,
        float(np.dot(pixels, [v.missing for v in found.views]) / pixels.sum()),
        time.perf_counter() - start,
    )


def described(found: Linearized) -> dict[str, Any]:
    """What linearize.json says."""
    response, raw = found.response, found.raw
    return {
        "unit": "radiance 1 brings a photograph of the reference exposure to full scale",
        "reference": found.reference.as_dict(),
        "clipped": CLIPPED + (MIXED if raw is not None and raw.matrix is not None else UNMIXED),
        "colours": "linear sRGB (Rec. 709 primaries, D65 white)"
        if raw is None or raw.matrix is not None
        else "the camera's own primaries, white-balanced",
        "response": None
        if response is None
        else {
            "name": response.name,
            "spread": response.spread,
            "samples": [[float(f"{v:.7g}") for v in row] for row in response.table],
        },
        "raw": None
        if raw is None
        else {
            "white_balance": raw.white_balance,
            "srgb_from_camera": None if raw.matrix is None else raw.matrix.tolist(),
            "black": raw.black,
            "white": raw.white,
        },
        "views": [_view(view) for view in found.views],
    }


def _view(view: LinearView) -> dict[str, Any]:
    photographs = [
        {"file": file.name, **exposure.as_dict(), "saturated": saturated}
        for file, exposure, saturated in zip(view.files, view.exposures, view.saturated, strict=True)
    ]
    return {
        "file": f"{view.name}.exr",
        "w": view.size[0],
        "h": view.size[1],
        "photographs": photographs,
        "missing": view.missing,
        "residual": view.residual,
        "steps": [step if math.isfinite(step) else None for step in view.steps],
        "below_zero": view.negative,
    }


def contact_sheet(views: Sequence[LinearView]) -> U8:
    """All views at one exposure under their names, [H, W, 3]; saturated pixels in magenta."""
    columns = min(COLUMNS, len(views))
    rows = math.ceil(len(views) / columns)
    sheet = np.full((rows * (CELL_PX + CAPTION_PX), columns * CELL_PX, 3), 255, dtype=np.uint8)
    exposure = float(np.median([exposure_for(v.thumbnail[..., :3], v.thumbnail[..., 3]) for v in views]))
    for i, view in enumerate(views):
        rgba = display(view.thumbnail[..., :3], view.thumbnail[..., 3], exposure)
        share = rgba[..., 3:] / 255
        picture = rgba[..., :3] * share + np.array(MISSING_COLOUR) * (1 - share)
        top, left = i // columns * (CELL_PX + CAPTION_PX), i % columns * CELL_PX
        h, w = picture.shape[:2]
        sheet[top + 2 : top + 2 + h, left + 2 : left + 2 + w] = (picture + 0.5).astype(np.uint8)
        at = (left + 3, top + CELL_PX + CAPTION_PX - 8)
        cv2.putText(sheet, view.name[:28], at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (40, 40, 40), 1, cv2.LINE_AA)
    return sheet


def _response_plot(found: Linearized) -> str:
    assert found.response is not None
    codes = [*range(4, 256, 6)]
    curves = {
        name: [(float(code), float(found.response.table[code, c])) for code in codes]
        for c, name in enumerate(("red", "green", "blue"))
    }
    curves["sRGB"] = [
        (float(code), float(value))
        for code, value in zip(codes, linear_from_srgb(np.array(codes) / 255), strict=True)
    ]
    return str(curve_plot(curves, x_label="code of 255", y_label="light", alone=True))


def _written_with(file: Path) -> list[str]:
    """The files that a linearize.json says were written with it; none of one that is damaged."""
    try:
        document = read_json(file)
        views = [str(view["file"]) for view in document["views"]]
        plots = ["response.svg"] if document["response"] is not None else []
    except (InputError, KeyError, TypeError):
        return []
    return [name for name in views if name.endswith(".exr")] + plots


def _numbers(multipliers: tuple[float, float, float]) -> str:
    return ", ".join(f"{m:.4g}" for m in multipliers)

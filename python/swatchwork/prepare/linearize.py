# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a camera's files to radiance on one scale: each view's exposures merged into one EXR."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import F32
from ..capture import write_exr_channels
from ..errors import CaptureWarning, InputError
from ..progress import SILENT, Progress
from .brackets import Merged, merge
from .exposure import REFERENCE, Exposure, exposures_of
from .raw import RAW_SUFFIXES, Colour
from .response_curve import Response, given_response
from .shots import CodedShots, RawSettings, RawShots, recovered_from, shots_of
from .views import views_of
from .white_balance import WhiteBalance

WRONG_STEP = 1.2
"""Factor between photographs of a view, after their exposures, worth a warning: shutters keep to 5 %."""
THUMBNAIL_PX = 240


@dataclass(frozen=True)
class LinearizeOptions:
    """How.

    Attributes:
        per_view: photographs a view, in the order given; or ``groups``, a JSON file (`views_of`).
        exposures: table that overrides EXIF (`exposures_of`).
        response: of JPEG and PNG: recover, or as `given_response` reads.
        white_balance, colour: of RAW (`develop`); the first file's multipliers serve all.
        reference: exposure whose full scale is radiance 1; the same for photographs and probe.
    """

    per_view: int = 1
    groups: Path | None = None
    exposures: Path | None = None
    response: str = "recover"
    white_balance: WhiteBalance = "daylight"
    colour: Colour = "srgb"
    reference: Exposure = REFERENCE


DEFAULT = LinearizeOptions()


@dataclass(frozen=True, eq=False)
class LinearView:
    """One view written.

    Attributes:
        name: of the EXR without its suffix.
        files: shortest exposure first, with ``exposures``.
        missing: share of pixels saturated in all of them.
        thumbnail: F32[h, w, 4], premultiplied.
        saturated, residual, steps, negative: as in `Merged`.
    """

    name: str
    files: tuple[Path, ...]
    exposures: tuple[Exposure, ...]
    size: tuple[int, int]
    missing: float
    saturated: tuple[float, ...]
    residual: float | None
    steps: tuple[float, ...]
    negative: float
    thumbnail: F32


@dataclass(frozen=True, eq=False)
class Linearized:
    """All views, and what was done to them; ``response`` or ``raw`` is None, by the kind of file."""

    views: tuple[LinearView, ...]
    reference: Exposure
    response: Response | None
    raw: RawSettings | None


def linearize(
    files: Sequence[Path],
    folder: Path,
    options: LinearizeOptions = DEFAULT,
    progress: Progress = SILENT,
) -> Linearized:
    """Write ``folder/VIEW.exr`` of each view: radiance in units of `LinearizeOptions.reference`'s full scale.

    Channels R, G, B and clipped.R, .G, .B: 1 where that channel of the camera is saturated in every exposure,
    and R, G, B are what the shortest one reads (`Merged.least`). `read_image` takes such pixels for missing.

    Args:
        files: all RAW, or all JPEG and PNG.
        folder: exists.

    Raises:
        InputError: a file, table or option is wrong; photographs of a view differ in size or have the
            same exposure; a response is to be recovered where there is no bracket.
        OutputError: an EXR cannot be written.
    """
    views = views_of(files, options.per_view, options.groups)
    exposures = exposures_of(files, options.exposures)
    views = {name: tuple(sorted(own, key=lambda f: exposures[f].light)) for name, own in views.items()}
    for name, own in views.items():
        if len(own) > 1 and exposures[own[0]].light == exposures[own[-1]].light:
            e = exposures[own[0]]
            raise InputError(
                f"all {len(own)} photographs have the same exposure "
                f"({e.time_s:g} s, ISO {e.iso:g}, f/{e.aperture:g})",
                file=f"{own[0].parent} (view {name})",
                expected="different ones",
                hint="Their EXIF may be wrong: give --exposures FILE; or --per-view 1",
            )
    is_raw = files[0].suffix.lower() in RAW_SUFFIXES
    source: RawShots | CodedShots
    if is_raw:
        source = RawShots(options.white_balance, options.colour)
    elif options.response == "recover":
        with progress.stage("Recovering the response"):
            source = CodedShots(recovered_from(views, exposures))
    else:
        source = CodedShots(given_response(options.response))
    written = []
    with progress.stage("Merging", len(files)) as task:
        for name, own in views.items():
            task.describe(name)
            light = [exposures[f].light / options.reference.light for f in own]
            merged = merge(shots_of(own, light, source))
            task.advance(len(own))
            _write(folder / f"{name}.exr", merged)
            _warn(name, own, merged)
            written.append(_view(name, own, [exposures[f] for f in own], merged))
    response = source.response if isinstance(source, CodedShots) else None
    return Linearized(
        tuple(written), options.reference, response, source.settings if isinstance(source, RawShots) else None
    )


def _write(file: Path, merged: Merged) -> None:
    channels: dict[str, npt.NDArray[np.floating]] = {
        name: np.where(merged.missing, merged.least[..., c], merged.radiance[..., c])
        for c, name in enumerate("RGB")
    }
    for c, name in enumerate("RGB"):
        channels[f"clipped.{name}"] = merged.clipped[..., c].astype(np.float16)
    write_exr_channels(file, channels)


def _warn(name: str, files: Sequence[Path], merged: Merged) -> None:
    for i, step in enumerate(merged.steps):
        if math.isnan(step):
            message = f"view {name}: no pixel is well exposed in both {files[i].name} and {files[i + 1].name}"
        elif not 1 / WRONG_STEP < step < WRONG_STEP:
            message = (
                f"view {name}: {files[i + 1].name} is {step:.2f} times as bright as its exposure over "
                f"that of {files[i].name} says; is one of them wrong?"
            )
        else:
            continue
        warnings.warn(message, CaptureWarning, stacklevel=3)


def _view(name: str, files: Sequence[Path], exposures: Sequence[Exposure], merged: Merged) -> LinearView:
    height, width = merged.missing.shape
    alpha = (~merged.missing).astype(np.float32)
    scale = min(1.0, THUMBNAIL_PX / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    thumbnail = cv2.resize(np.dstack([merged.radiance, alpha]), size, interpolation=cv2.INTER_AREA)
    return LinearView(
        name,
        tuple(files),
        tuple(exposures),
        (width, height),
        float(merged.missing.mean()),
        merged.saturated,
        merged.residual,
        merged.steps,
        merged.negative,
        np.asarray(thumbnail, dtype=np.float32),
    )

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a camera's files to radiance on one scale: each view's exposures merged into one EXR."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays import F32, F64, U8
from ..capture import write_exr_channels
from ..capture.images import read_coded
from ..errors import CaptureWarning, InputError
from ..progress import SILENT, Progress
from .brackets import Merged, Shot, merge
from .exposure import REFERENCE, Exposure, exposures_of
from .raw import RAW_SUFFIXES, Colour, WhiteBalance, develop
from .response_curve import Response, given_response, recover_response
from .views import views_of

CLIP_CODE, DARK_CODE = 250 / 255, 10 / 255
"""Codes of JPEG and PNG, as shares of the largest, from which a pixel counts as saturated, and below which as
dark: compression moves codes by a few, and at the dark end one is a tenth of the light."""
DARK_RAW = 1 / 512
"""The same for RAW, as a share of the white level: eight steps of a sensor's 12 bits."""
FITTED_TO = 6
"""Brackets at most that a response is recovered from."""
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
        missing: share of pixels saturated in all of them; alpha is 0 there.
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
class RawSettings:
    """How RAW files were developed: multipliers (green 1), matrix to linear sRGB, levels of the first."""

    white_balance: tuple[float, float, float]
    matrix: F64 | None
    black: tuple[int, ...]
    white: int


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

    Channels R, G, B, A (0 where a channel is saturated in every exposure, else 1), clipped.R, .G, .B (1 where
    that channel is) and least.R, .G, .B (where A is 0, what the shortest exposure reads).

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
    source = _Raw(options) if is_raw else _Coded(_response(views, exposures, options, progress))
    written = []
    with progress.stage("Merging", len(files)) as task:
        for name, own in views.items():
            task.describe(name)
            light = [exposures[f].light / options.reference.light for f in own]
            merged = merge(_of_one_size(own, light, source))
            task.advance(len(own))
            _write(folder / f"{name}.exr", merged)
            _warn(name, own, merged)
            written.append(_view(name, own, [exposures[f] for f in own], merged))
    response = source.response if isinstance(source, _Coded) else None
    return Linearized(
        tuple(written), options.reference, response, source.settings if isinstance(source, _Raw) else None
    )


class _Raw:
    """Shots from RAW files, all with the first one's multipliers and matrix."""

    def __init__(self, options: LinearizeOptions) -> None:
        self.options = options
        self.settings: RawSettings | None = None

    def shot(self, file: Path, light: float) -> Shot:
        first = self.settings
        balance = self.options.white_balance if first is None else first.white_balance
        found = develop(file, balance, self.options.colour)
        if first is None:
            self.settings = RawSettings(found.white_balance, found.matrix, found.black, found.white)
        elif (
            first.matrix is not None
            and found.matrix is not None
            and np.abs(first.matrix - found.matrix).max() > 1e-4
        ):
            raise InputError(
                "its colour matrix is not that of the photographs before it",
                file=file,
                expected="photographs of one camera",
            )
        return Shot(found.linear, found.clipped, found.linear < DARK_RAW, light)


@dataclass(frozen=True)
class _Coded:
    """Shots from JPEG and PNG."""

    response: Response

    def shot(self, file: Path, light: float) -> Shot:
        coded = _colours(file)
        largest = int(np.iinfo(coded.dtype).max)
        table = self.response.lookup(largest)
        linear = np.stack([table[coded[..., c], c] for c in range(3)], axis=-1)
        return Shot(linear, coded >= CLIP_CODE * largest, coded < DARK_CODE * largest, light)


def _colours(file: Path) -> npt.NDArray[np.uint8] | npt.NDArray[np.uint16]:
    coded = read_coded(file)
    if coded.shape[-1] in (2, 4):
        raise InputError("has an alpha channel", file=file, expected="a photograph, opaque")
    gray: bool = coded.shape[-1] == 1
    return coded[..., [0, 0, 0]] if gray else coded


def _of_one_size(files: Sequence[Path], light: Sequence[float], source: _Raw | _Coded) -> Iterator[Shot]:
    size: tuple[int, ...] | None = None
    for file, exposure in zip(files, light, strict=True):
        shot = source.shot(file, exposure)
        size = size or shot.linear.shape
        if shot.linear.shape != size:
            raise InputError(
                f"{shot.linear.shape[1]} x {shot.linear.shape[0]} pixels",
                file=file,
                expected=f"{size[1]} x {size[0]} as {files[0].name} of the same view has",
            )
        yield shot


def _response(
    views: Mapping[str, Sequence[Path]],
    exposures: Mapping[Path, Exposure],
    options: LinearizeOptions,
    progress: Progress,
) -> Response:
    if options.response != "recover":
        return given_response(options.response)
    brackets = [own for own in views.values() if len(own) > 1]
    if not brackets:
        raise InputError(
            "the response cannot be recovered from single photographs",
            expected="brackets (--per-view COUNT), or --response",
            hint="Give --response srgb, gamma:2.2, or the linearize.json of brackets of the same camera",
        )
    chosen = [
        brackets[i] for i in np.unique(np.linspace(0, len(brackets) - 1, FITTED_TO).round().astype(int))
    ]
    with progress.stage("Recovering the response"):
        read = [([_eight_bits(f) for f in own], [exposures[f].light for f in own]) for own in chosen]
        for own, (pictures, _) in zip(chosen, read, strict=True):
            for file, picture in zip(own, pictures, strict=True):
                if picture.shape != pictures[0].shape:
                    h, w = pictures[0].shape[:2]
                    raise InputError(
                        f"{picture.shape[1]} x {picture.shape[0]} pixels",
                        file=file,
                        expected=f"{w} x {h} as {own[0].name} of the same view has",
                    )
        return recover_response(read)


def _eight_bits(file: Path) -> U8:
    coded = _colours(file)
    if coded.dtype != np.uint8:
        raise InputError(
            "has 16 bits", file=file, expected="8 bits to recover a response from", hint="Give --response"
        )
    return np.asarray(coded, dtype=np.uint8)


def _write(file: Path, merged: Merged) -> None:
    channels: dict[str, npt.NDArray[np.floating]] = {
        name: merged.radiance[..., c] for c, name in enumerate("RGB")
    }
    channels["A"] = (~merged.missing).astype(np.float16)
    for c, name in enumerate("RGB"):
        channels[f"clipped.{name}"] = merged.clipped[..., c].astype(np.float16)
        channels[f"least.{name}"] = merged.least[..., c]
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

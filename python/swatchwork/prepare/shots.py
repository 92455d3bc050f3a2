# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a camera wrote, as shots to merge: RAW developed alike, JPEG and PNG through one response."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..arrays import F64, U8
from ..capture.images import read_coded
from ..errors import InputError
from .brackets import Shot
from .exposure import Exposure
from .raw import Colour, develop
from .response_curve import Response, recover_response
from .views import Views
from .white_balance import WhiteBalance

CLIP_CODE, DARK_CODE = 250 / 255, 10 / 255
"""Codes of JPEG and PNG, as shares of the largest, from which a pixel counts as saturated, and below which as
dark: compression moves codes by a few, and at the dark end one is a tenth of the light."""
DARK_RAW = 1 / 512
"""The same for RAW, as a share of the white level: eight steps of a sensor's 12 bits."""
FITTED_TO = 6
"""Brackets at most that a response is recovered from."""


@dataclass(frozen=True, eq=False)
class RawSettings:
    """How RAW files were developed: multipliers (green 1), matrix to linear sRGB, levels of the first."""

    white_balance: tuple[float, float, float]
    matrix: F64 | None
    black: tuple[int, ...]
    white: int


class RawShots:
    """Shots from RAW files, all with the first one's multipliers and matrix."""

    def __init__(self, white_balance: WhiteBalance, colour: Colour) -> None:
        self.white_balance, self.colour = white_balance, colour
        self.settings: RawSettings | None = None

    def shot(self, file: Path, light: float) -> Shot:
        first = self.settings
        balance = self.white_balance if first is None else first.white_balance
        found = develop(file, balance, self.colour)
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
class CodedShots:
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


def shots_of(files: Sequence[Path], light: Sequence[float], source: RawShots | CodedShots) -> Iterator[Shot]:
    """The photographs of one view, in the order given, one at a time; ``light`` is their exposure."""
    size: tuple[int, ...] | None = None
    for file, exposure in zip(files, light, strict=True):
        shot = source.shot(file, exposure)
        size = size or shot.linear.shape
        _same_size(file, shot.linear.shape, files[0], size)
        yield shot


def recovered_from(views: Views, exposures: Mapping[Path, Exposure]) -> Response:
    """The response recovered from some of the brackets among the views.

    Raises:
        InputError: there is no bracket; photographs of one differ in size, or have 16 bits.
    """
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
    read = []
    for own in chosen:
        pictures = [_eight_bits(file) for file in own]
        for file, picture in zip(own, pictures, strict=True):
            _same_size(file, picture.shape, own[0], pictures[0].shape)
        read.append((pictures, [exposures[file].light for file in own]))
    return recover_response(read)


def _same_size(file: Path, shape: tuple[int, ...], first: Path, wanted: tuple[int, ...]) -> None:
    if shape != wanted:
        raise InputError(
            f"{shape[1]} x {shape[0]} pixels",
            file=file,
            expected=f"{wanted[1]} x {wanted[0]} as {first.name} of the same view has",
        )


def _eight_bits(file: Path) -> U8:
    coded = _colours(file)
    if coded.dtype != np.uint8:
        raise InputError(
            "has 16 bits", file=file, expected="8 bits to recover a response from", hint="Give --response"
        )
    return np.asarray(coded, dtype=np.uint8)

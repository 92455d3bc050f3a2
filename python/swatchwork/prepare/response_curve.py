# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The response of a camera's JPEGs: from what it wrote, 0 to full scale, to light.

A recovered response is known up to a factor; it is scaled to sRGB's at half of full scale, in each channel,
so that the camera's own white balance stays. Photographs and light probe must be read with the same response.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..arrays import F32, F64, U8
from ..capture import linear_from_srgb
from ..errors import InputError
from .earlier import from_earlier

SAMPLES = 256
SMALLEST_PX = 32
"""Pixels of a bracket that a response is fitted to; 256 unknowns a channel ask for no fewer."""
SMOOTHNESS = 20.0
"""Weight of its second differences: twice OpenCV's, which leaves the ripple of 8 bits in."""
TRUSTED = slice(13, 243)
"""Codes, of 256, in which a recovered response must rise: outside, hardly a pixel says anything."""
FALL = 0.05


@dataclass(frozen=True, eq=False)
class Response:
    """Light for each code.

    Attributes:
        name: srgb, gamma:2.2, or how it was recovered.
        table: F64[256, 3], light at codes 0 to 255 of 255, in the order red, green, blue.
        spread: how far responses recovered from single brackets are from this, rms of the log over the
            trusted codes; None where there was one bracket or none.
    """

    name: str
    table: F64
    spread: float | None = None

    def lookup(self, largest: int) -> F32:
        """F32[largest + 1, 3]: light for each code of a file whose largest is ``largest``."""
        x = np.arange(largest + 1) / largest
        kind, _, exponent = self.name.partition(":")
        if kind == "srgb":
            return np.repeat(linear_from_srgb(x)[:, None], 3, axis=1)
        if kind == "gamma":
            return np.repeat((x ** float(exponent)).astype(np.float32)[:, None], 3, axis=1)
        nodes = np.arange(256) / 255
        return np.stack([np.interp(x, nodes, self.table[:, c]) for c in range(3)], axis=1).astype(np.float32)


def given_response(text: str) -> Response:
    """``srgb``, ``gamma:2.2``, or the path of a linearize.json whose response is to be used again.

    Raises:
        InputError: it is none of these; the file holds no response.
    """
    codes = np.arange(256) / 255
    if text == "srgb":
        return Response(text, np.repeat(linear_from_srgb(codes)[:, None], 3, axis=1).astype(np.float64))
    kind, _, number = text.partition(":")
    if kind == "gamma":
        try:
            exponent = float(number)
        except ValueError:
            exponent = math.nan
        if not 0.2 <= exponent <= 5:
            raise InputError(
                f"the response is {text!r}", expected="gamma:NUMBER from 0.2 to 5, such as gamma:2.2"
            )
        return Response(f"gamma:{exponent:g}", np.repeat((codes**exponent)[:, None], 3, axis=1))
    return _read(Path(text))


def recover_response(
    brackets: Sequence[tuple[Sequence[U8], Sequence[float]]],
) -> Response:
    """The response that makes the photographs of each bracket agree (Debevec and Malik 1997, by OpenCV).

    Robertson's method, which OpenCV has too, is no choice here: from four exposures of a synthetic scene at
    steps of 4 it left waves of 15 % where this leaves 0.3 %.

    Args:
        brackets: photographs uint8 [H, W, 3] with the light each took in, at least two different ones.

    Raises:
        InputError: the pictures are too small; the recovered response falls somewhere.
    """
    smallest = min(min(p.shape[:2]) for pictures, _ in brackets for p in pictures)
    if smallest < SMALLEST_PX:
        raise InputError(
            f"a photograph has a side of {smallest} px",
            expected=f"{SMALLEST_PX} or more, to recover the response from",
            hint="Give --response srgb, gamma:2.2 or a linearize.json",
        )
    logs = []
    for pictures, light in brackets:
        times = np.asarray(light, dtype=np.float32) / np.float32(max(light))
        solver = cv2.createCalibrateDebevec(samples=SAMPLES, lambda_=SMOOTHNESS, random=False)
        table = np.asarray(
            solver.process([np.ascontiguousarray(p) for p in pictures], times), dtype=np.float64
        )
        logs.append(np.log(_at_the_middle(_filled(table.reshape(256, 3)))))
    mean = np.median(logs, axis=0)
    spread = float(np.sqrt(np.mean((np.array(logs) - mean)[:, TRUSTED] ** 2))) if len(logs) > 1 else None
    table = _at_the_middle(np.exp(mean))
    highest = np.maximum.accumulate(table, axis=0)
    fall = float((1 - table / np.maximum(highest, 1e-12))[TRUSTED].max())
    if not fall < FALL:
        raise InputError(
            f"the response recovered from the brackets falls by {100 * fall:.0f} % where codes rise",
            expected="one that rises",
            hint="Check the exposures and that nothing moved, or give --response srgb, gamma:2.2 or a "
            "linearize.json",
        )
    return Response("recovered", highest, spread)


def _filled(table: F64) -> F64:
    """The table with codes that no pixel has, where the fit says nothing, between their neighbours'."""
    codes, filled = np.arange(256), np.empty_like(table)
    for c in range(3):
        known = np.isfinite(table[:, c]) & (table[:, c] > 0)
        if np.count_nonzero(known) < 2:
            raise InputError(
                "the brackets have too few different codes to recover a response from",
                expected="photographs with shadows and lights",
                hint="Give --response srgb, gamma:2.2 or a linearize.json",
            )
        filled[:, c] = np.exp(np.interp(codes, codes[known], np.log(table[known, c])))
    return filled


def _at_the_middle(table: F64) -> F64:
    """The table scaled to sRGB's value at half of full scale."""
    middle = float(linear_from_srgb(np.array([0.5]))[0])
    return np.asarray(table / np.maximum((table[127] + table[128]) / 2, 1e-30) * middle)


def _read(file: Path) -> Response:
    def read(document: dict[str, Any]) -> tuple[F64, str]:
        entry = document["response"]
        return np.array(entry["samples"], dtype=np.float64), str(entry["name"])

    expected = "srgb, gamma:2.2, or a linearize.json with a response"
    table, name = from_earlier(file, "response", expected, read)
    if table.shape != (256, 3) or not np.isfinite(table).all() or (np.diff(table, axis=0) < 0).any():
        raise InputError(
            f"the response has samples of shape {list(table.shape)}, or they fall",
            file=file,
            expected="256 rows of 3 numbers that rise",
        )
    return Response(name, table)

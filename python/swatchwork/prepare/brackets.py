# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs of one view at several exposures, merged to radiance.

The light L of a pixel makes v_i = L h_i in photograph i, h_i its exposure over the reference exposure. Under
photon noise the variance of v_i grows with v_i, so that the best mean of the v_i / h_i is sum v_i / sum h_i
over the photographs in which the pixel is neither saturated nor dark.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..arrays import F32, F64, Bool

SAMPLES = 100_000
"""Pixels that the figures of merit are computed on, evenly spread."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One photograph.

    Attributes:
        linear: F32[H, W, 3], proportional to light; 1 is full scale.
        clipped: Bool[H, W, 3], saturated.
        dark: Bool[H, W, 3], too dark to be worth something beside a longer exposure.
        exposure: of the photograph over the reference exposure.
    """

    linear: F32
    clipped: Bool
    dark: Bool
    exposure: float


@dataclass(frozen=True, eq=False)
class Merged:
    """The radiance of one view.

    Attributes:
        radiance: F32[H, W, 3]; 0 where missing.
        missing: Bool[H, W], some channel is saturated even in the shortest exposure.
        clipped: Bool[H, W, 3], which channels that are, before any colour matrix.
        least: F32[H, W, 3], what the shortest exposure reads where missing. In the camera's own channels that
            is no more than the light; a colour matrix, which subtracts channels, can make it more.
        saturated: share of pixels with a saturated channel, of each photograph, shortest first.
        residual: rms of log radiance about its mean, between photographs of the same pixel; None of one.
        steps: of each photograph and the next, the median of their radiances' ratio; 1 where exposures are as
            stated, NaN where no pixel is good in both.
        negative: share of pixels with a channel below 0, set to 0: colours outside the primaries' gamut.
    """

    radiance: F32
    missing: Bool
    clipped: Bool
    least: F32
    saturated: tuple[float, ...]
    residual: float | None
    steps: tuple[float, ...]
    negative: float


def merge(shots: Iterable[Shot]) -> Merged:
    """Merge photographs given by rising exposure; they are looked at once, one at a time."""
    signal: F32 | None = None
    rows: slice = slice(None)
    saturated, sampled = [], []
    for shot in shots:
        value = shot.linear / np.float32(shot.exposure)
        # A camera's processing mixes channels: where one is saturated, none is to be trusted.
        unsaturated = np.asarray(~shot.clipped.any(axis=-1))
        good = unsaturated[..., None] & ~shot.dark
        if signal is None:
            signal, light = np.zeros_like(value), np.zeros_like(value)
            longest, seen = np.zeros_like(value), np.zeros_like(unsaturated)
            clipped, least = shot.clipped, value
            rows = slice(None, None, max(1, math.isqrt(unsaturated.size // SAMPLES)))
        signal += np.where(good, shot.linear, 0)
        light += np.where(good, np.float32(shot.exposure), 0)
        longest = np.where(unsaturated[..., None], value, longest)
        seen |= unsaturated
        saturated.append(float(1 - unsaturated.mean()))
        usable = good[rows, rows] & (value[rows, rows] > 0)
        sampled.append(np.where(usable, np.log(np.maximum(value[rows, rows], 1e-30)), np.nan))
    if signal is None:
        raise ValueError("no photograph to merge")
    # Dark in all photographs: the longest exposure that is not saturated says most.
    radiance = np.where(light > 0, signal / np.maximum(light, np.float32(1e-30)), longest)
    missing = ~seen
    negative = float(((radiance < 0).any(axis=-1) & seen).mean())
    radiance = np.where(missing[..., None], 0, np.maximum(radiance, 0)).astype(np.float32)
    least = np.where(missing[..., None], np.maximum(least, 0), 0).astype(np.float32)
    logs = np.stack(sampled).astype(np.float64)
    return Merged(
        radiance,
        missing,
        clipped & missing[..., None],
        least,
        tuple(saturated),
        _residual(logs),
        _steps(logs),
        negative,
    )


def _residual(logs: F64) -> float | None:
    """Pooled over the pixels that two photographs or more agree to know, with a degree of freedom each."""
    known = np.isfinite(logs)
    count = known.sum(axis=0)
    freedom = int(np.maximum(count - 1, 0).sum())
    if freedom == 0:
        return None
    value = np.where(known, logs, 0)
    mean = value.sum(axis=0) / np.maximum(count, 1)
    return float(np.sqrt(np.where(known, (value - mean) ** 2, 0).sum() / freedom))


def _steps(logs: F64) -> tuple[float, ...]:
    ratios = []
    for a, b in pairwise(logs):
        difference = b - a
        known = difference[np.isfinite(difference)]
        ratios.append(float(np.exp(np.median(known))) if known.size else math.nan)
    return tuple(ratios)

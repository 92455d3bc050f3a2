# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What error to expect of a texel in a view that was not taken, from what is known of it.

The model is log-linear, log e = c . f(texel), of features that a material holds for every texel: its residual
and that around it, how much the blend changes from pixel to pixel, how bright the blend is, how many views
saw it, and its blend weights, for some materials fit the basis worse than others. Its coefficients are learnt
where the truth is known: at texels whose blend is found anew without one of their views, from the error in
that view (`analysis.fit_error_model`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ..arrays import F32, F64, I32, I64, U8, U32, Bool, Float
from ..errors import InputError

Weights = TypeVar("Weights", F32, F64)

LEAST = 1e-3
"""Relative errors and changes below it count alike: no photograph tells them apart."""
HALF = 0.1
"""Expected relative error at which confidence is one half."""


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """Coefficients of the expected error; F = 5 + N features."""

    appearance: F64
    """[N, N]: |w A|^2 is the mean squared response, over the texels measured, of a blend w."""
    mean: F64
    """[F] of the features it was learnt from."""
    spread: F64
    """[F]"""
    coefficients: F64
    """[F + 1], of the standardised features and 1; squares add up to those met, but for the hundredth that is
    largest: highlights that the view left out has and the others lack."""
    held_out: int
    """Measurements it was learnt from."""

    def expected(self, features: F64) -> F64:
        """Expected relative error [T] from features [T, F]."""
        standard = (features - self.mean) / self.spread
        return np.asarray(np.exp(standard @ self.coefficients[:-1] + self.coefficients[-1]))

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "appearance": self.appearance.tolist(),
            "mean": self.mean.tolist(),
            "spread": self.spread.tolist(),
            "coefficients": self.coefficients.tolist(),
            "held_out": self.held_out,
        }

    @classmethod
    def from_dict(cls, found: Mapping[str, Any], N: int) -> ErrorModel:
        """From JSON, of a material with N representatives; InputError where shapes or values are wrong."""
        shapes = {
            "appearance": (N, N),
            "mean": (5 + N,),
            "spread": (5 + N,),
            "coefficients": (6 + N,),
        }
        arrays = {name: np.array(found[name], dtype=np.float64) for name in shapes}
        for name, shape in shapes.items():
            if arrays[name].shape != shape or not np.isfinite(arrays[name]).all():
                raise InputError(
                    f"the error model's {name} has shape {arrays[name].shape} or is not finite",
                    expected=f"{shape} finite numbers",
                )
        return cls(**arrays, held_out=int(found["held_out"]))


def features(
    residual: Float, around: F64, change: F64, strength: F64, views: I32 | I64, weights: F64, n: int
) -> F64:
    """What the error is expected from [T, 5 + N].

    Args:
        residual: relative error [T] of each texel's own measurements.
        around: root mean square of it [T] over the texel and its neighbours.
        change: root mean square difference [T] to its neighbours' blends, relative to its own response.
        strength: mean squared response [T] of its blend, relative to the object's typical one.
        views: of each texel [T].
        weights: [T, N].
        n: blended at most; they fit n - 1 of the 3 k numbers of k views.
    """
    K = 3 * np.maximum(np.asarray(views, np.float64), 1)
    own = residual * np.sqrt(K / np.maximum(K - (n - 1), 1))
    logs = [np.log(np.maximum(x, LEAST)) for x in (own, around, change + 10 * LEAST, strength)]
    return np.concatenate([np.stack([*logs, np.log(K)], axis=-1), weights], axis=-1)


def neighbourhood(appearance: F32, residual: F32, coverage: I32) -> tuple[F64, F64]:
    """``around`` and ``change`` [H, W] of images: appearance [H, W, N] (weights times A), residual, coverage.

    Neighbours off the atlas do not count, nor, for residuals, those that no view sees.
    """
    height, width = coverage.shape
    on: Bool = coverage >= 0
    seen = coverage > 0
    square = np.where(seen, residual.astype(np.float64), 0) ** 2
    total, count = np.zeros((height, width)), np.zeros((height, width))
    change, beside = np.zeros((height, width)), np.zeros((height, width))
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            here, there = _shifted(height, width, dy, dx)
            total[here] += square[there]
            count[here] += seen[there]
            if abs(dy) + abs(dx) == 1:
                difference = ((appearance[here] - appearance[there]) ** 2).sum(axis=-1)
                change[here] += np.where(on[there], difference, 0)
                beside[here] += on[there]
    strength = np.maximum((appearance.astype(np.float64) ** 2).sum(axis=-1), 1e-30)
    around = np.sqrt(total / np.maximum(count, 1))
    return around, np.sqrt(change / np.maximum(beside, 1) / strength)


def neighbourhood_of_windows(appearance: F64, residual: F64, coverage: I32) -> tuple[F64, F64]:
    """The same [T] of the centres of windows [T, 3, 3, ...]."""
    seen = coverage > 0
    count = np.maximum(seen.sum(axis=(1, 2)), 1)
    around = np.sqrt((np.where(seen, residual, 0) ** 2).sum(axis=(1, 2)) / count)
    rows, columns = np.array([0, 1, 1, 2]), np.array([1, 0, 2, 1])
    on = coverage[:, rows, columns] >= 0
    centre = appearance[:, 1, 1]
    difference = ((appearance[:, rows, columns] - centre[:, None]) ** 2).sum(axis=-1)
    strength = np.maximum((centre**2).sum(axis=-1), 1e-30)
    total = np.where(on, difference, 0).sum(axis=1)
    return around, np.sqrt(total / np.maximum(on.sum(axis=1), 1) / strength)


def _shifted(height: int, width: int, dy: int, dx: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Where pixels with a neighbour at an offset are, and where that neighbour is."""

    def along(size: int, d: int) -> tuple[slice, slice]:
        return slice(max(0, -d), size - max(0, d)), slice(max(0, d), size - max(0, -d))

    (y0, y1), (x0, x1) = along(height, dy), along(width, dx)
    return (y0, x0), (y1, x1)


def dense(index: U8 | U32, weight: Weights, N: int) -> Weights:
    """Weights [..., N] from n slots [..., n], in the slots' precision; repeated indices add up."""
    found = np.zeros((*index.shape[:-1], N), weight.dtype)
    flat = found.reshape(-1, N)
    at = np.arange(len(flat))
    for i in range(index.shape[-1]):
        np.add.at(flat, (at, index[..., i].ravel().astype(np.int64)), weight[..., i].ravel())
    return found


def confidence_of(expected_error: Float) -> F64:
    """In [0, 1]: 1 where no error is expected, one half at 10 %."""
    return np.asarray(1 / (1 + (np.asarray(expected_error, np.float64) / HALF) ** 2))

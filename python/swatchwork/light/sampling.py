# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Bilinear lookups in an environment raster whose edges continue as the sphere does."""

from __future__ import annotations

import cv2
import numpy as np

from swatchwork.arrays import F32, F64, Float
from swatchwork.light.conventions import solid_angles


def with_border(radiance: F32, convention: str) -> F32:
    """The raster [H, W, 3] with one more pixel on each side, F32[H + 2, W + 2, 3].

    A latitude-longitude map wraps in azimuth, and goes on beyond a pole on the other side of it. Outside
    an angular map's disc, whatever the file holds there is replaced by what lies across the rim.
    """
    if convention == "debevec-angular":
        return _beyond_rim(radiance)
    half = radiance.shape[1] // 2
    rows = np.concatenate(
        [np.roll(radiance[:1], half, axis=1), radiance, np.roll(radiance[-1:], half, axis=1)]
    )
    return np.concatenate([rows[:, -1:], rows, rows[:, :1]], axis=1)


def bilinear(bordered: F32, uv: Float) -> F64:
    """Values F64[P, 3] of a bordered raster at points [P, 2] in [0, 1] of the raster without its border."""
    height, width = bordered.shape[0] - 2, bordered.shape[1] - 2
    x = np.clip(uv[:, 0] * width, 0, width) + 0.5
    y = np.clip(uv[:, 1] * height, 0, height) + 0.5
    column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    fx, fy = (x - column)[:, None], (y - row)[:, None]
    flat = bordered.reshape(-1, 3)
    at = row * (width + 2) + column
    top = flat[at] * (1 - fx) + flat[at + 1] * fx
    at += width + 2
    return np.asarray(top * (1 - fy) + (flat[at] * (1 - fx) + flat[at + 1] * fx) * fy)


def halved(radiance: F32, convention: str) -> F32:
    """The raster [H, W, 3] at half its size; each pixel is the solid-angle mean of four."""
    height, width = radiance.shape[:2]
    weight = solid_angles(convention, height, width)[..., None]

    def sums(values: F64) -> F64:
        return np.asarray(values.reshape(height // 2, 2, width // 2, 2, -1).sum(axis=(1, 3)))

    light = sums(np.where(weight > 0, radiance, 0) * weight)
    return (light / np.maximum(sums(weight), 1e-300)).astype(np.float32)


def shrunk(radiance: F32, convention: str, width: int) -> F32:
    """The raster [H, W, 3] at a smaller width; each pixel is the solid-angle mean of the area under it."""
    weight = solid_angles(convention, *radiance.shape[:2])[..., None]
    size = width, max(1, round(width * radiance.shape[0] / radiance.shape[1]))

    def means(values: F64) -> F64:
        found = cv2.resize(values, size, interpolation=cv2.INTER_AREA)
        return np.asarray(found.reshape(size[1], size[0], -1), np.float64)

    light = means(np.where(weight > 0, radiance, 0) * weight)
    return (light / np.maximum(means(weight), 1e-300)).astype(np.float32)


def _beyond_rim(radiance: F32) -> F32:
    size = radiance.shape[0]
    bordered = np.pad(radiance, ((1, 1), (1, 1), (0, 0)))
    axis = (2 * np.arange(-1, size + 1) + 1) / size - 1
    radius = np.hypot(axis[None, :], axis[:, None])
    bordered[radius > 1] = 0

    # All of the rim is one direction: a point beyond it lies as far inside on the opposite side.
    row, column = np.nonzero((radius > 1) & (radius < 1 + 6 / size))
    r = radius[row, column]
    mirrored = -np.stack([axis[column], axis[row]], axis=-1) * ((2 - r) / r)[:, None]
    uv = (mirrored + 1) / 2

    # Interpolate among the pixels that are part of the sphere only.
    inside = np.repeat((radius <= 1)[..., None], 3, axis=-1).astype(np.float32)
    bordered[row, column] = bilinear(bordered, uv) / np.maximum(bilinear(inside, uv), 1e-6)
    return bordered

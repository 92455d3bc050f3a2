# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From linear radiance to pixels on a page: exposure, gamma, heat maps, colours of a blend, data URIs."""

from __future__ import annotations

import base64
import io

import numpy as np
from PIL import Image

from ..arrays import F32, F64, U8, U32, Bool, Float

PALETTE = (
    "#3b6fb6",
    "#e08b2c",
    "#4a9c6d",
    "#c8504b",
    "#8a6bb8",
    "#d9b93b",
    "#4fb3bf",
    "#b0628f",
    "#7d8a3c",
    "#8c6248",
    "#6b7b8c",
    "#e3a6a1",
)
"""One colour for each representative, told apart side by side; it starts again after twelve."""

_HEAT = ("#0b0724", "#3b0f6f", "#8c2981", "#de4968", "#fe9f6d", "#fcfdbf")


def rgb(colour: str) -> tuple[int, int, int]:
    """``#rrggbb`` as three numbers of 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def palette(count: int) -> F64:
    """Colours [count, 3] in [0, 1]."""
    return np.array([rgb(PALETTE[i % len(PALETTE)]) for i in range(count)]) / 255.0


def exposure_for(linear: Float, alpha: Float, key: float = 0.9) -> float:
    """The factor that brings the brightest 2 % of the foreground's radiance to ``key``."""
    values = linear[alpha > 0.5]
    bright = float(np.quantile(values.max(axis=-1), 0.98)) if values.size else 0.0
    return key / bright if bright > 0 else 1.0


def display(linear: Float, alpha: Float | None, exposure: float) -> U8:
    """Linear premultiplied radiance [H, W, 3] as straight 8-bit RGBA [H, W, 4], gamma 2.2 as the paper's."""
    a = np.ones(linear.shape[:2]) if alpha is None else np.clip(alpha, 0.0, 1.0)
    straight = np.where(a[..., None] > 0, linear[..., :3] / np.maximum(a, 1e-6)[..., None], 0.0)
    encoded = np.clip(np.nan_to_num(straight) * exposure, 0.0, 1.0) ** (1 / 2.2)
    return to_bytes(np.concatenate([encoded, a[..., None]], axis=-1))


def to_bytes(unit_values: Float) -> U8:
    """Values in [0, 1] as 8 bits, rounded."""
    return np.asarray(np.clip(unit_values, 0.0, 1.0) * 255.0 + 0.5, dtype=np.uint8)


def heat(values: Float, mask: Bool, top: float) -> U8:
    """A heat map [H, W, 4] of ``values`` [H, W] from 0 to ``top``, transparent outside ``mask``."""
    stops = np.array([rgb(colour) for colour in _HEAT]) / 255.0
    at = np.clip(np.nan_to_num(values / top), 0.0, 1.0) * (len(stops) - 1)
    low = np.minimum(at.astype(int), len(stops) - 2)
    share = (at - low)[..., None]
    colours = stops[low] * (1 - share) + stops[low + 1] * share
    return to_bytes(np.concatenate([colours, mask[..., None].astype(float)], axis=-1))


def heat_gradient() -> str:
    """The heat map's colours as a CSS gradient, for its key."""
    return f"linear-gradient(90deg, {', '.join(_HEAT)})"


def relative_error(rendered: Float, reference: Float, mask: Bool) -> F64:
    """Error [H, W] a pixel, as a fraction of the reference's RMS over ``mask``."""
    difference = np.sqrt(np.mean((rendered[..., :3] - reference[..., :3]).astype(np.float64) ** 2, axis=-1))
    scale = np.sqrt(np.mean(reference[mask][:, :3].astype(np.float64) ** 2)) if mask.any() else 1.0
    return np.where(mask, difference / max(float(scale), 1e-12), 0.0)


def blend_colours(index: U8 | U32, weight: Float, count: int) -> U8:
    """The blend [H, W, n] as a map [H, W, 4]: each representative's colour times its weight."""
    colours = palette(count)[np.minimum(np.asarray(index, dtype=np.int64), count - 1)]
    total = weight.sum(axis=-1)
    mixed = (colours * weight[..., None]).sum(axis=-2) / np.maximum(total, 1e-6)[..., None]
    return to_bytes(np.concatenate([mixed, (total > 0)[..., None].astype(float)], axis=-1))


def shrink(pixels: U8, limit: int) -> U8:
    """The picture with neither side above ``limit``, area-averaged; smaller ones unchanged."""
    height, width = pixels.shape[:2]
    scale = limit / max(height, width)
    if scale >= 1:
        return pixels
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BOX))


def crop_box(alpha: F32, margin: float = 0.06) -> tuple[slice, slice]:
    """Rows and columns around the foreground, square where the picture allows, with a margin."""
    rows, columns = np.nonzero(alpha > 0.5)
    height, width = alpha.shape
    if rows.size == 0:
        return slice(0, height), slice(0, width)
    side = max(np.ptp(rows), np.ptp(columns)) * (1 + 2 * margin) + 1
    middle_y, middle_x = (rows.min() + rows.max()) / 2, (columns.min() + columns.max()) / 2
    top, left = max(0, round(middle_y - side / 2)), max(0, round(middle_x - side / 2))
    return slice(top, min(height, round(top + side))), slice(left, min(width, round(left + side)))


def data_uri(pixels: U8) -> str:
    """The picture as a PNG inside a ``data:`` address."""
    buffer = io.BytesIO()
    # Best compression takes five times as long and saves 3 %.
    Image.fromarray(pixels).save(buffer, format="PNG", compress_level=6)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")

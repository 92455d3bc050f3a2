# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Atlas images for other programs: gutters filled, so that filters and mipmaps meet no background."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO

import numpy as np
from PIL import Image as Pillow
from scipy.ndimage import distance_transform_edt

from ..arrays import F64, I64, U8, Float
from ..keeping import Array
from ..material import Material, dense


@dataclass(frozen=True, eq=False)
class Padding:
    """Which texel each pixel of an atlas shows: its own, or off the atlas the nearest."""

    texel_of_pixel: I64
    """[H, W], in the order of `Material.on_atlas`."""

    @classmethod
    def of(cls, material: Material) -> Padding:
        on = material.on_atlas
        number = np.cumsum(on.ravel(), dtype=np.int64).reshape(on.shape) - 1
        row, col = distance_transform_edt(~on, return_distances=False, return_indices=True)
        return cls(number[row, col])

    def image(self, values: Array) -> Array:
        """Values [M, ...] of the texels as an image [H, W, ...]."""
        return np.asarray(values[self.texel_of_pixel])


def padded_image(padding: Padding, material: Material, image: Array) -> Array:
    """An image [H, W, ...] of a material with its gutter filled."""
    return padding.image(image[material.on_atlas])


def dense_weights(material: Material, padding: Padding) -> Array:
    """Weight of each representative, F32[H, W, N]: unlike indices, they may be filtered."""
    on = material.on_atlas
    return padding.image(dense(material.index[on], material.weight[on], material.N))


def srgb_coded(linear: Float) -> U8:
    """Linear values, clipped to [0, 1], as 8-bit sRGB (IEC 61966-2-1)."""
    x: F64 = np.clip(np.asarray(linear, np.float64), 0, 1)
    return eight_bits(np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055))


def eight_bits(values: Float) -> U8:
    """Values, clipped to [0, 1], to the nearest of 256."""
    return np.rint(255 * np.clip(np.asarray(values, np.float64), 0, 1)).astype(np.uint8)


def png_bytes(coded: U8) -> bytes:
    """A PNG file of [H, W], [H, W, 3] or [H, W, 4], without a gamma or a profile of its own."""
    stored = BytesIO()
    Pillow.fromarray(np.ascontiguousarray(coded)).save(stored, format="PNG")
    return stored.getvalue()

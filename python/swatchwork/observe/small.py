# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A photograph made small about the object: what a displaced camera would have shown is looked up in it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from swatchwork.arrays import F32, F64, Bool, Float
from swatchwork.capture import Camera, Photograph
from swatchwork.keeping import Array, Kept
from swatchwork.observe.pixels import PixelMap

SIDE = 160
"""Pixels along the longer side: with the margin, about two thirds of a degree each around an object."""
MARGIN = 0.3
"""Of the object's box, on each side: a displaced object lies there."""
KNOWN = 0.9
"""Share of a small pixel that must be data."""


@dataclass(frozen=True)
class SmallPicture:
    """``pixels`` F32[h, w, 5]: radiance and coverage, both times the share that is data, and that share.

    Coverage is 1 where the photograph has neither alpha nor a mask. ``place`` F64[4]: left, top, and a small
    pixel's width and height, in the photograph's pixels.
    """

    pixels: F32
    place: F64

    @classmethod
    def of(cls, photograph: Photograph, camera: Camera, pixels: PixelMap, vertices: F64) -> SmallPicture:
        """Crop to the projected ``vertices`` [V, 3] and average over areas."""
        left, top, right, bottom = _box(camera, vertices)
        part = slice(top, bottom), slice(left, right)
        # Outside its mask a photograph is known to show something else; clipped, it is not known.
        off: Bool = np.zeros_like(photograph.valid) if photograph.mask is None else ~photograph.mask
        known: Bool = (photograph.valid | off) & ~pixels.blocked.reshape(photograph.valid.shape)
        shown: F32 = np.asarray(known & ~off, dtype=np.float32)[part]
        radiance = np.where(photograph.valid[part][..., None], photograph.radiance[part], 0)
        beside = np.stack([photograph.alpha[part] * shown, known[part].astype(np.float32)], axis=-1)
        height, width = shown.shape
        scale = min(1.0, SIDE / max(height, width))
        size = max(1, round(width * scale)), max(1, round(height * scale))
        # OpenCV averages no more than four channels at once.
        small = [
            cv2.resize(np.asarray(image, dtype=np.float32), size, interpolation=cv2.INTER_AREA)
            for image in (radiance * shown[..., None], beside)
        ]
        return cls(
            np.concatenate(small, axis=-1),
            np.array([left, top, width / size[0], height / size[1]], dtype=np.float64),
        )

    def arrays(self) -> dict[str, Array]:
        """What ``kept`` reads."""
        return {"small": self.pixels, "small_place": self.place}

    @classmethod
    def kept(cls, kept: Kept) -> SmallPicture:
        """The picture whose ``arrays`` were kept."""
        return cls(kept.rows("small"), kept.rows("small_place"))

    def look(self, uv_px: Float) -> tuple[F64, F64]:
        """Radiance [P, 3] and coverage [P] at the photograph's image points [P, 2]; NaN where unknown."""
        at = (np.asarray(uv_px) - self.place[:2]) / self.place[2:] - 0.5
        height, width = self.pixels.shape[:2]
        with np.errstate(invalid="ignore"):
            inside: Bool = np.all((at >= 0) & (at <= [width - 1, height - 1]), axis=1)
        x, y = np.where(inside[:, None], at, 0).astype(np.float32).T
        found = np.concatenate(
            [
                # Its maps have at most 32767 columns.
                cv2.remap(self.pixels[..., channels], x[:, None], y[:, None], cv2.INTER_LINEAR).reshape(
                    len(at), -1
                )
                for channels in (slice(0, 3), slice(3, 5))
            ],
            axis=1,
        ).astype(np.float64)
        known: Bool = inside & (found[:, 4] > KNOWN)
        cover = np.where(known, found[:, 3] / np.maximum(found[:, 4], 1e-6), np.nan)
        radiance = np.where(known[:, None], found[:, :3] / np.maximum(found[:, 3:4], 1e-6), np.nan)
        return radiance, cover


def _box(camera: Camera, vertices: F64) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of the object with its margin, inside the photograph."""
    uv, depth = camera.project(vertices)
    if not (depth > 0).all() or not np.isfinite(uv).all():
        return 0, 0, camera.width, camera.height
    low, high = uv.min(axis=0), uv.max(axis=0)
    margin = MARGIN * float((high - low).max())
    left, top = np.floor(np.clip(low - margin, 0, [camera.width - 1, camera.height - 1])).astype(int)
    right, bottom = np.ceil(np.clip(high + margin, 1, [camera.width, camera.height])).astype(int)
    return int(left), int(top), int(max(right, left + 1)), int(max(bottom, top + 1))

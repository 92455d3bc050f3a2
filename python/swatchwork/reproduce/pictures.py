# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Pictures of spheres: the truth beside what methods recovered, with their differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from ..arrays import F64, U8, Bool
from ..capture import write_png
from ..report import display, heat
from ..simulate import Pairs
from ..whole import whole_file

BRIGHT = 0.6
"""Linear value that nine tenths of a picture are below."""
TOP = 0.3
"""Difference, of the reference's root mean square, that the top colour of a heat map stands for."""
LABEL_PX = 18
FONT = (cv2.FONT_HERSHEY_SIMPLEX, 0.4, 1)


@dataclass(frozen=True, eq=False)
class Disc:
    """The pixels of a unit sphere seen from far away."""

    pairs: Pairs
    inside: Bool
    """[S, S]"""

    @classmethod
    def of(cls, direction: F64, size: int, rim: float = 0.07) -> Disc:
        """Seen from a direction [3], z up in the picture, S pixels a side; without n.o below ``rim``."""
        back = direction / np.linalg.norm(direction)
        right = np.cross([0.0, 0.0, 1.0], back)
        right /= np.linalg.norm(right)
        x = (np.arange(size) + 0.5) / size * 2.1 - 1.05
        a, b = np.meshgrid(x, -x)
        inside = a**2 + b**2 < 1 - rim**2
        a, b = a[inside], b[inside]
        front = np.sqrt(1 - a * a - b * b)
        normal = a[:, None] * right + b[:, None] * np.cross(back, right) + front[:, None] * back
        count = len(normal)
        pairs = Pairs(
            np.arange(count, dtype=np.int32),
            np.zeros(count, np.int32),
            normal.astype(np.float32),
            np.broadcast_to(back, normal.shape).astype(np.float32),
            np.arange(count + 1, dtype=np.int64),
        )
        return cls(pairs, inside)

    def on(self, normal: F64) -> Pairs:
        """The pixels' pairs as those of the nearest of texels [M, 3]."""
        from scipy.spatial import cKDTree

        p = self.pairs
        texel = np.asarray(cKDTree(normal).query(p.normal)[1], dtype=np.int32)
        return Pairs(texel, p.view, p.normal, p.to_viewer, p.offsets)

    def image(self, radiance: F64, exposure: float) -> U8:
        """Radiance [P, 3] of the pixels, ready to show."""
        image = np.zeros((*self.inside.shape, 3))
        image[self.inside] = radiance
        return display(image, self.inside.astype(np.float64), exposure)

    def difference(self, radiance: F64, reference: F64) -> U8:
        """Heat map of the differences."""
        image = np.zeros(self.inside.shape)
        scale = np.sqrt((reference**2).sum(axis=1).mean())
        image[self.inside] = np.linalg.norm(radiance - reference, axis=1) / scale
        return heat(image, self.inside, TOP)


def exposure_of(reference: F64) -> float:
    """An exposure that shows a reference [P, 3] well."""
    return BRIGHT / max(float(np.quantile(reference.max(axis=1), 0.9)), 1e-9)


def comparison(file: Path, disc: Disc, reference: F64, found: Sequence[tuple[str, F64]]) -> None:
    """The reference and what was recovered side by side, each with its name, differences below."""
    exposure = exposure_of(reference)
    columns = [_column("reference", disc.image(reference, exposure), disc.difference(reference, reference))]
    for name, radiance in found:
        columns.append(_column(name, disc.image(radiance, exposure), disc.difference(radiance, reference)))
    write_flat(file, np.concatenate(columns, axis=1))


def _column(name: str, picture: U8, difference: U8) -> U8:
    """Two pictures under a name, on white as wide as the name."""
    both = np.concatenate([picture, difference])
    wider = max(0, cv2.getTextSize(name, *FONT)[0][0] + 8 - both.shape[1])
    left = wider // 2
    padded = np.pad(both, ((0, 0), (left, wider - left), (0, 0)))
    return np.concatenate([caption(name, padded.shape[1]), padded])


def caption(text: str, width: int) -> U8:
    """A strip with a text, as wide as the picture below it."""
    strip = np.full((LABEL_PX, width, 4), 255, np.uint8)
    face, scale, thickness = FONT
    cv2.putText(strip, text, (4, 13), face, scale, (0, 0, 0, 255), thickness, cv2.LINE_AA)
    return strip


def write_flat(file: Path, pixels: U8) -> None:
    """Write a picture [H, W, 4] on white."""
    alpha = pixels[..., 3:] / 255.0
    write_small(file, (pixels[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8))


def write_small(file: Path, pixels: U8) -> None:
    """Write a picture [H, W, 3], as JPEG where the name says so: sheets for a page need no lossless bits."""
    with whole_file(file) as made:
        if file.suffix == ".jpg":
            Image.fromarray(pixels).save(made, quality=88)
        else:
            write_png(made, pixels)

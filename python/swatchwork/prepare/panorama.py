# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One photograph of a mirror ball as a latitude-longitude map, with what each texel of it is worth."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from swatchwork.arrays import F32, F64, Bool, Float
from swatchwork.capture import check_radiance
from swatchwork.errors import InputError
from swatchwork.light import direction_from_uv
from swatchwork.prepare.ball import Outline

RIM_PX = 1.0
"""Pixels this near to the outline are mixed with the background by any lens."""
PHOTOGRAPHER_DEGREES = 8.0
"""Half angle about the camera, as the ball sees it, where a map is worth little if another view has more."""
LEAST = 1e-3
"""What the middle of the photographer, and clipped pixels, are worth: used only where nothing else is."""
BLOCK = 2**21


@dataclass(frozen=True, eq=False)
class View:
    """A photograph of the ball.

    Attributes:
        radiance: F32[H, W, 3], linear; clipped pixels hold the least that they can be.
        clipped: Bool[H, W].
        outline: the ball in it.
        name: what messages call it, such as its file.
    """

    radiance: F32
    clipped: Bool
    outline: Outline
    name: str

    def __post_init__(self) -> None:
        on_ball = self.on_ball()
        check_radiance(self.radiance, on_ball, self.name)
        if not self.radiance[on_ball].any():
            raise InputError(
                "the ball is all black",
                file=self.name,
                expected="reflected light",
                hint="Is it the right file, and the right outline?",
            )

    def on_ball(self) -> Bool:
        """Bool[H, W], pixels whose centre is on the ball."""
        height, width = self.radiance.shape[:2]
        off = self.outline.ball.residual_px(pixel_centres(width, height))
        return np.asarray((off < 0).reshape(height, width))


@dataclass(frozen=True, eq=False)
class Mirror:
    """Share of light that the ball reflects: ``normal`` F64[3], rising to 1 at the rim with ``fresnel``."""

    normal: F64
    fresnel: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.normal).all() and (self.normal > 0).all() and (self.normal <= 1).all()):
            raise InputError(
                "the ball's reflectance is " + ",".join(f"{r:g}" for r in self.normal),
                expected="above 0 and at most 1, such as 0.6 for polished steel, or R,G,B",
            )

    def reflectance(self, cosine: F64) -> F64:
        """F64[P, 3] at cosines [P] of normal and viewer (Schlick)."""
        rise = (1 - cosine)[:, None] ** 5 if self.fresnel else np.zeros((len(cosine), 1))
        return self.normal + (1 - self.normal) * rise


@dataclass(frozen=True, eq=False)
class Panorama:
    """A latitude-longitude map of one view.

    Attributes:
        radiance: F32[H, W, 3], 0 where unseen.
        weight: F32[H, W], what it is worth from 0 (unseen) to 1.
        clipped: F32[H, W], share of a texel that is clipped.
    """

    radiance: F32
    weight: F32
    clipped: F32


def panorama(view: View, world_from_camera: F64, convention: str, width: int, mirror: Mirror) -> Panorama:
    """Resample a ball to a map in world axes.

    Each texel is the solid-angle mean of lookups at evenly spread directions, bilinear in the photograph, as
    many as make at least one and a half per pixel and axis. A lookup is worth (n.o)^2, since a pixel covers
    1 / (n.o) times as much angle towards the rim; next to nothing within `PHOTOGRAPHER_DEGREES` of the camera
    and where it is clipped; and nothing in the blind cone, beside the picture, or within `RIM_PX` of the rim.

    Args:
        world_from_camera: F64[3, 3] rotation.
        convention: "blender" or "mitsuba".
        width: of the map, twice its height.
    """
    ball, height = view.outline.ball, width // 2
    samples = int(np.clip(np.ceil(1.5 * np.pi * view.outline.radius_px / width), 2, 16))
    rows = max(1, BLOCK // (width * samples * samples))
    packed = np.dstack([view.radiance, view.clipped.astype(np.float32)])
    size = (view.radiance.shape[1], view.radiance.shape[0])
    radiance = np.zeros((height, width, 3), np.float32)
    weight, clipped = np.zeros((height, width), np.float32), np.zeros((height, width), np.float32)
    u = (np.arange(width * samples) + 0.5) / (width * samples)
    for top in range(0, height, rows):
        bottom = min(height, top + rows)
        v = (np.arange(top * samples, bottom * samples) + 0.5) / (height * samples)
        uv = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1).reshape(-1, 2)
        d = direction_from_uv(convention, uv) @ world_from_camera
        at, cosine = ball.seen_at(d)
        seen = _usable(view, at, cosine, size)
        value = _bilinear(packed, np.where(seen[:, None], at, 0))
        light = value[:, :3] / mirror.reflectance(np.where(seen, cosine, 1))
        clip = value[:, 3] > 0
        worth = np.where(seen, cosine**2, 0) * _besides_photographer(d @ ball.towards_camera)
        worth = worth * np.where(clip, LEAST, 1)

        def of_texels(values: Float, rows: int = bottom - top) -> F64:
            split = values.reshape(rows, samples, width, samples, -1)
            return np.asarray(split.sum(axis=(1, 3)))

        # Rows nearer to the pole are shorter.
        area = np.repeat(np.sin(np.pi * v), width * samples)
        share = of_texels(area * seen)
        total = np.maximum(share, 1e-300)
        radiance[top:bottom] = of_texels((area * seen)[:, None] * light) / total
        clipped[top:bottom] = (of_texels(area * seen * value[:, 3]) / total)[..., 0]
        weight[top:bottom] = (of_texels(area * worth) / of_texels(area))[..., 0]
    return Panorama(radiance, weight, clipped)


def pixel_centres(width: int, height: int) -> F64:
    """Image points F64[H * W, 2], row by row."""
    v, u = np.mgrid[0:height, 0:width] + 0.5
    return np.stack([u, v], axis=-1).reshape(-1, 2)


def _usable(view: View, at: F64, cosine: F64, size: tuple[int, int]) -> Bool:
    """Whether image points show the mirror alone."""
    inside = ((at >= 0.5) & (at <= np.array(size) - 0.5)).all(axis=1) & (cosine > 0)
    off = np.full(len(at), 0.0)
    off[inside] = view.outline.ball.residual_px(at[inside])
    return inside & (off < -RIM_PX)


def _besides_photographer(cosine: F64) -> F64:
    """From `LEAST` in the camera's direction to 1 at twice the photographer's half angle."""
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    t = np.clip(angle / PHOTOGRAPHER_DEGREES - 1, 0, 1)
    return np.asarray(LEAST + (1 - LEAST) * t * t * (3 - 2 * t))


def _bilinear(packed: F32, at: F64) -> F32:
    """Values F32[P, C] at image points [P, 2]."""
    # OpenCV takes tables of fewer than 32768 rows.
    count = len(at)
    padded = np.zeros((-(-count // 4096) * 4096, 2), np.float32)
    padded[:count] = at - 0.5
    x, y = (padded[:, i].reshape(-1, 4096) for i in (0, 1))
    fine = cv2.remap(packed, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(fine.reshape(-1, packed.shape[2])[:count], dtype=np.float32)

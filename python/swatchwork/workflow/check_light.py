# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Exposure: whether photographs agree with the light probe, and with each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import F32, F64, Bool, dot, unit
from ..capture import Camera, Photograph
from ..light import Environment
from ..octahedral import pixel_directions
from ..surface import SurfacePoints
from ..surface.sky import SIZE, SkyMasks, unpacked

SMALLEST_COSINE = 0.3
"""Of points that are sampled: nearer the rim, pixels mix the surface with what is beside it."""
COARSE = 16
"""Cells along a side of the sky that lights the grey ball."""
FEWEST = 30
"""Points that a frame must share with others to be judged."""


def irradiance(light: Environment, points: SurfacePoints, sky: SkyMasks) -> F64:
    """What arrives at each point F64[M, 3] from the part of the sky that it sees, integrated over cells."""
    cells = pixel_directions(SIZE).reshape(-1, 3)
    radiance = light.octahedral(SIZE).reshape(-1, 3).astype(np.float64)
    weight = np.maximum(points.normal.astype(np.float64) @ cells.T, 0.0)
    masked = np.flatnonzero(sky.of_texel >= 0)
    weight[masked] *= unpacked(sky.words[sky.of_texel[masked]])
    return np.asarray(weight @ radiance * (4 * np.pi / len(cells)))


def sampled(photograph: Photograph, camera: Camera, points: SurfacePoints, seen: Bool) -> F64:
    """Radiance F64[M], mean of the channels, where the photograph shows a point well; NaN elsewhere."""
    found = np.full(len(points), np.nan)
    away = camera.position - points.position
    facing = dot(points.normal.astype(np.float64), unit(away)) > SMALLEST_COSINE
    at = np.flatnonzero(seen & facing)
    if not len(at):
        return found
    uv, _ = camera.project(points.position[at])
    # OpenCV counts pixels from the first one's centre. Its maps have at most 32767 columns.
    x, y = (uv - 0.5).astype(np.float32)[:, None].transpose(2, 0, 1)

    def look(image: F32) -> F64:
        return np.asarray(
            cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float64
        )

    radiance = look(photograph.radiance.mean(axis=-1)).ravel()
    alpha = look(photograph.alpha).ravel()
    whole = look(photograph.valid.astype(np.float32)).ravel()
    kept = (whole > 0.999) & (alpha > 0.99)
    found[at[kept]] = radiance[kept] / alpha[kept]
    return found


@dataclass(frozen=True, eq=False)
class Exposures:
    """``albedo``: pooled radiance over that of a white Lambertian surface in the same light (None where
    nothing is seen); ``factor`` [k]: each frame against the others, 1 in the middle, NaN where too few
    points are shared."""

    albedo: float | None
    factor: F64


def exposures(radiance: F64, white: F64) -> Exposures:
    """Compare [k, M] radiances, NaN where not seen, with those of a white surface [k, M].

    The frames' factors and the points' values are medians of each other's quotients in turn, so that a
    frame's own error does not lean on the others' values.
    """
    seen = np.isfinite(radiance) & (white > 0)
    total = float(white[seen].sum())
    albedo = float(radiance[seen].sum()) / total if total > 0 else None
    quotient = np.full(radiance.shape, np.nan)
    good = seen & (radiance > 0)
    quotient[good] = np.log(radiance[good] / white[good])
    shared = np.isfinite(quotient).sum(axis=0) >= 2
    quotient = quotient[:, shared]
    judged = np.isfinite(quotient).sum(axis=1) >= FEWEST
    factor = np.full(len(radiance), np.nan)
    if judged.sum() < 2:
        return Exposures(albedo, factor)
    quotient = quotient[judged]
    quotient = quotient[:, np.isfinite(quotient).sum(axis=0) >= 2]
    if not quotient.shape[1] or not np.isfinite(quotient).any(axis=1).all():
        return Exposures(albedo, factor)
    own = np.zeros(len(quotient))
    for _ in range(20):
        value = np.nanmedian(quotient - own[:, None], axis=0)
        own = np.nanmedian(quotient - value, axis=1)
        own -= np.median(own)
    factor[judged] = np.exp(own)
    return Exposures(albedo, factor)


def balls(light: Environment, camera: Camera, size: int) -> tuple[F32, F32, F32]:
    """A mirror ball and a grey ball (albedo 0.5) at the object as a camera sees them from afar.

    Returns:
        mirror F32[size, size, 3] and grey, linear, and their coverage F32[size, size].
    """
    axis = (np.arange(size) + 0.5) / (size / 2) - 1
    x, y = np.meshgrid(axis, -axis)
    r = np.hypot(x, y)
    alpha = np.clip((1 - r) * size / 2 + 0.5, 0, 1).astype(np.float32)
    shrunk = np.minimum(1, 0.999 / np.maximum(r, 1e-9))
    x, y = x * shrunk, y * shrunk
    normal_in_camera = np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)
    world_from_camera = camera.world_from_camera[:3, :3]
    normal = normal_in_camera @ world_from_camera.T
    viewer = world_from_camera[:, 2]
    mirrored = 2 * (normal @ viewer)[..., None] * normal - viewer
    # The cosine is so wide that cells of 13 degrees serve; finer ones would take a gigabyte.
    cells = pixel_directions(COARSE).reshape(-1, 3).astype(np.float32)
    radiance = light.octahedral(COARSE).reshape(-1, 3)
    weight = np.maximum(normal.reshape(-1, 3).astype(np.float32) @ cells.T, 0.0)
    grey = (weight @ radiance * (0.5 * 4 / len(cells))).reshape(size, size, 3)
    shown = [(image * alpha[..., None]).astype(np.float32) for image in (light.lookup(mirrored), grey)]
    return shown[0], shown[1], alpha


def white_radiance(lights: Sequence[Environment], points: SurfacePoints, sky: SkyMasks) -> F64:
    """Radiance [k, M] of a white Lambertian surface under each frame's light; equal lights are done once."""
    rows: dict[int, F64] = {}
    for light in lights:
        if id(light) not in rows:
            rows[id(light)] = irradiance(light, points, sky).mean(axis=-1) / np.pi
    return np.stack([rows[id(light)] for light in lights])

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
from ..octahedral import pixel_directions, square_from_direction
from ..surface import SurfacePoints
from ..surface.sky import SIZE, SkyMasks, unpacked

SMALLEST_COSINE = 0.3
"""Of points that are sampled: nearer the rim, pixels mix the surface with what is beside it."""
COARSE = 16
"""Cells along a side of the sky that lights the grey ball."""
BLURS = (4, 8, 16)
"""Cells along a side of the sky that stand for gloss of three kinds, of about 50, 26 and 13 degrees."""
SHARES = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Of gloss, against a white matte surface's light."""
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
    points are shared; ``sure`` [k]: three quarters of a frame's points say so too, by a tenth at least."""

    albedo: float | None
    factor: F64
    sure: Bool


def exposures(radiance: F64, white: F64, gloss: Sequence[F64] = ()) -> Exposures:
    """Compare [k, M] radiances, NaN where not seen, with those of a white surface [k, M].

    Gloss makes a point brighter in one view than in another: of the ``gloss`` (radiance [k, M] along the
    mirrored direction, each blurred otherwise), the one and its share that explain the differences best are
    added to the white surface's. A frame's exposure cannot be mistaken for it: the share is all frames'.
    """
    seen = np.isfinite(radiance) & (white > 0)
    total = float(white[seen].sum())
    albedo = float(radiance[seen].sum()) / total if total > 0 else None
    unknown = Exposures(albedo, np.full(len(radiance), np.nan), np.zeros(len(radiance), bool))
    seen &= radiance > 0
    seen[seen.sum(axis=1) < FEWEST] = False
    seen[:, seen.sum(axis=0) < 2] = False
    judged = seen.sum(axis=1) >= FEWEST
    seen[~judged] = False
    seen[:, seen.sum(axis=0) < 2] = False
    if judged.sum() < 2 or (seen[judged].sum(axis=1) < FEWEST // 2).any():
        return unknown
    shared = seen.any(axis=0)
    here = np.ix_(judged, shared)
    models = [white] + [white + share * mirrored for mirrored in gloss for share in SHARES]
    best: tuple[float, F64, F64] | None = None
    for model in models:
        with np.errstate(divide="ignore", invalid="ignore"):
            quotient = np.where(seen, np.log(radiance / model), np.nan)[here]
        own, left = _frames_and_points(quotient)
        spread = float(np.nanmedian(np.abs(left - own[:, None])))
        if best is None or spread < best[0]:
            best = spread, own, left
    assert best is not None
    _, own, left = best
    factor, sure = unknown.factor, unknown.sure
    factor[judged] = np.exp(own)
    low, high = np.nanquantile(left, (0.25, 0.75), axis=1)
    sure[judged] = (low > np.log(1.1)) | (high < -np.log(1.1))
    return Exposures(albedo, factor, sure)


def _frames_and_points(quotient: F64) -> tuple[F64, F64]:
    """Logarithms of frames' factors [k], and each point's quotient over its own value [k, M].

    Both are medians of each other's quotients in turn, so that one frame's error does not lean on the others.
    """
    own = np.zeros(len(quotient))
    for _ in range(20):
        value = np.nanmedian(quotient - own[:, None], axis=0)
        own = np.nanmedian(quotient - value, axis=1)
        own -= np.median(own)
    return own, quotient - value


def mirrored_radiance(
    lights: Sequence[Environment], cameras: Sequence[Camera], points: SurfacePoints
) -> list[F64]:
    """Radiance [k, M] from where a mirror at each point would show each camera, in cells of three sizes."""
    normal = points.normal.astype(np.float64)
    found = []
    for size in BLURS:
        rasters = {id(light): light.octahedral(size).mean(axis=-1).astype(np.float64) for light in lights}
        rows = []
        for light, camera in zip(lights, cameras, strict=True):
            viewer = unit(camera.position - points.position)
            d = 2 * dot(normal, viewer)[:, None] * normal - viewer
            column, row = np.minimum((square_from_direction(unit(d)) * size).astype(int), size - 1).T
            rows.append(rasters[id(light)][row, column])
        found.append(np.stack(rows))
    return found


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

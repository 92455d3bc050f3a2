# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Sampling one photograph at the texels it shows (the paper's resampling, section 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F32, F64, I64, Bool, dot, norm
from swatchwork.capture import Camera, Photograph
from swatchwork.observe.pixels import PixelMap
from swatchwork.surface import Atlas, each_of

# A bilinear footprint reaches 2.1 pixels, and a surface seen at cosine c stretches it by 1 / c. On igea-merl,
# 4.5 for 3 keeps 0.6 % more samples and lets through a tenfold error (0.34 for 0.03) across fine steps.
REACH = 3.0
SMALLEST_COSINE = 0.05
# A chord of a smooth patch is square to the mean of its ends' normals (exactly so on a sphere); one that
# leans by more than this sine spans a step. Facets and half a pixel of play are allowed for.
LEAN = 0.2
PLAY = 0.5
# Cosine between normals below which two points are not one smooth surface.
ALIKE = 0.3
# Share of the bilinear weight, times coverage, that must lie on the texel's own surface.
KEPT = 0.5
# Bilinear weights below this neither count nor spoil a sample.
NEGLIGIBLE = 1e-3


def sample(
    atlas: Atlas, texel: I64, camera: Camera, pixels: PixelMap, photograph: Photograph
) -> tuple[F32, Bool]:
    """Radiance of visible texels in one photograph.

    Each sample is the bilinear mean, over those of the four pixels around the texel's image that show the
    same patch of surface, of premultiplied radiance divided by that of coverage. A sample is dropped where
    less than half of the weight is left, or where one of those pixels is clipped or outside the mask.
    Without alpha, pixels that the mesh does not fill count as another surface.

    Args:
        texel: I64[T], texels that the camera sees.

    Returns:
        radiance F32[T, 3], kept Bool[T].
    """
    has_alpha = bool((photograph.alpha < 1).any())
    radiance, kept = np.empty((len(texel), 3), dtype=np.float32), np.empty(len(texel), dtype=bool)

    def fill(part: slice) -> None:
        radiance[part], kept[part] = _sampled(atlas, texel[part], camera, pixels, photograph, has_alpha)

    each_of(fill, len(texel))
    return radiance, kept


def _sampled(
    atlas: Atlas, texel: I64, camera: Camera, pixels: PixelMap, photograph: Photograph, has_alpha: bool
) -> tuple[F32, Bool]:
    patch = _patch(atlas, texel, camera)
    uv_px, _ = camera.project(patch.x)
    corner = np.floor(uv_px - 0.5)
    part = uv_px - 0.5 - corner
    radiance, cover = np.zeros((len(texel), 3)), np.zeros(len(texel))
    spoilt = np.zeros(len(texel), dtype=bool)
    for right in (0, 1):
        for down in (0, 1):
            column, row = (corner + np.array([right, down])).astype(np.int64).T
            weight = np.where(right, part[:, 0], 1 - part[:, 0]) * np.where(down, part[:, 1], 1 - part[:, 1])
            inside = (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
            pixel = np.where(inside, row * camera.width + column, 0)
            same = inside & (weight > NEGLIGIBLE) & ~pixels.blocked[pixel]
            same &= pixels.cover[pixel] > (0 if has_alpha else 1 - 1e-9)
            for point, facing in ((pixels.near, pixels.near_normal), (pixels.far, pixels.far_normal)):
                same &= _continues(patch, point[pixel], facing[pixel])
            spoilt |= same & ~photograph.valid.ravel()[pixel]
            weight = np.where(same, weight, 0.0)
            radiance += weight[:, None] * photograph.radiance.reshape(-1, 3)[pixel]
            cover += weight * photograph.alpha.ravel()[pixel]
    kept = (cover >= KEPT) & ~spoilt
    return (radiance / np.maximum(cover, 1e-6)[:, None]).astype(np.float32), kept


@dataclass(frozen=True)
class _Patch:
    """The surface around texels as one camera sees it: ``x``, ``normal`` F64[T, 3], of the triangles;
    ``cosine`` F64[T] of the normal with the viewer; ``pixel`` F64[T], a pixel's width at x (world units)."""

    x: F64
    normal: F64
    cosine: F64
    pixel: F64
    viewer: F64


def _patch(atlas: Atlas, texel: I64, camera: Camera) -> _Patch:
    x, normal, viewer = atlas.position(texel), atlas.geometric_normal(texel), camera.position
    to_viewer = viewer - x
    distance = norm(to_viewer)
    pixel = distance / np.sqrt(camera.fx * camera.fy)
    return _Patch(x, normal, dot(normal, to_viewer) / distance, pixel, viewer)


def _continues(patch: _Patch, point: F64, facing: F64) -> Bool:
    """Whether points [T, 3], with normals ``facing``, that pixels show continue the patch; NaN does not."""
    away = point - patch.x
    distance = norm(away)
    # The better-facing of the two decides: behind a rim lies, as a rule, a surface that faces the viewer.
    to_viewer = patch.viewer - point
    there = dot(facing, to_viewer) / norm(to_viewer)
    reach = REACH * patch.pixel / np.maximum(np.maximum(patch.cosine, there), SMALLEST_COSINE)
    lean = np.abs(dot(away, patch.normal + facing)) / 2
    return np.asarray(
        (distance <= reach)
        & (lean <= LEAN * distance + PLAY * patch.pixel)
        & (dot(facing, patch.normal) > ALIKE)
    )

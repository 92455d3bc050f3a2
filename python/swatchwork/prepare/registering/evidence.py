# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Silhouettes and clicked pairs as terms of the joint refinement, beside the features."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture import Camera
from swatchwork.prepare.registering.contours import ImageEdges, contour_terms
from swatchwork.prepare.registering.motion import motion_between, projected
from swatchwork.prepare.registering.pairs import Pairs
from swatchwork.prepare.registering.sliding import Extra
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene

CONTOUR_PX = 0.3
"""Standard deviation of a mask's border at least; more, where it lies farther from the mesh's."""
CONTOUR_COUNT = 30.0
"""Independent measurements that a silhouette is worth: a mask errs alike over long stretches."""
BIAS_PX = 1.0
"""Standard deviation of how much too large or too small a mask is all around, which it tells of distance."""
REACH_PX = 8.0
CLICK_PX = 2.0
"""Standard deviation of a clicked point."""
NOTHING = (np.zeros(0), np.zeros((0, 6)))


def clicked(pairs: Mapping[str, Pairs], sigma_px: float = CLICK_PX) -> Extra:
    """The pairs of each photograph, by its name, with the standard deviation of a point of the image."""

    def terms(name: str, camera: Camera) -> tuple[F64, F64]:
        if name not in pairs:
            return NOTHING
        of = pairs[name]
        uv_px, by_step, _ = projected(camera, of.x_in_world)
        seen = np.isfinite(uv_px[:, 0])
        off, by_step = (uv_px - of.uv_px)[seen], by_step[seen]
        return off.ravel() / sigma_px, by_step.reshape(-1, 6) / sigma_px

    return terms


def silhouettes(scene: RayScene, views: Sequence[View], cameras: Mapping[str, Camera]) -> Extra:
    """The silhouettes of the views that have a region and a camera, linear in the motion from that camera.

    Finding contours takes thousands of rays: do it anew where poses have come to rest, not at each step.
    """
    found = {
        view.name: _silhouette(scene, view, cameras[view.name])
        for view in views
        if view.region is not None and view.name in cameras
    }

    def terms(name: str, camera: Camera) -> tuple[F64, F64]:
        if name not in found:
            return NOTHING
        residual, by_step = found[name]
        return residual + by_step @ motion_between(cameras[name], camera), by_step

    return terms


def _silhouette(scene: RayScene, view: View, camera: Camera) -> tuple[F64, F64]:
    terms = contour_terms(scene, ImageEdges.of(view), camera, REACH_PX)
    chosen = terms.outer & (terms.weight > 0)
    if not chosen.any():
        return NOTHING
    weight, residual, by_step = terms.weight[chosen], terms.residual_px[chosen], terms.by_step[chosen]
    # White noise and a common bias: the mean has the larger variance of the two together.
    worth = min(CONTOUR_COUNT, float(weight.sum()))
    sigma = max(CONTOUR_PX, terms.rms_px)
    dulled = 1 - 1 / np.sqrt(1 + worth * (BIAS_PX / sigma) ** 2)
    residual = residual - dulled * np.average(residual, weights=weight)
    by_step = by_step - dulled * np.average(by_step, axis=0, weights=weight)
    scale = np.sqrt(weight * worth / weight.sum()) / sigma
    return scale * residual, scale[:, None] * by_step

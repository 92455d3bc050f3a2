# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Metashape's frame lens (formulas in `metashape`), taken to ours, which has fewer terms.

b2, k3, k4, p3 and p4 are not ours. Where they move no pixel of the image by DROPPED_PX they are left out, or
else f, b1, cx, cy, k1, k2, p1 and p2 are fitted to the whole polynomial over the image, by least squares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from swatchwork.arrays import F64

OURS = ("f", "b1", "cx", "cy", "k1", "k2", "p1", "p2")
OTHERS = ("b2", "k3", "k4", "p3", "p4")
DROPPED_PX = 0.05
"""Half of what a good calibration is known to."""
FITTED_PX = 0.1
GRID = 33
"""Points along each side of the image, borders included; the polynomials are smooth between them."""


@dataclass(frozen=True)
class OurLens:
    """Metashape's numbers of the terms that we have, and how far they are from all of them, over the image.

    Attributes:
        values: by Metashape's names.
        off_px: the largest distance of a point from where the whole polynomial puts it; infinite where that
            folds within the image.
        fitted: whether they are other than given.
    """

    values: dict[str, float]
    off_px: float
    fitted: bool


def our_lens(given: Mapping[str, float], width: int, height: int) -> OurLens:
    """``given`` has all of OURS and OTHERS; ``off_px`` above FITTED_PX says that ours cannot stand for it."""
    own = {key: given[key] for key in OURS}
    if not any(given[key] for key in OTHERS):
        return OurLens(own, 0.0, fitted=False)
    uv = np.stack(np.meshgrid(np.linspace(0, width, GRID), np.linspace(0, height, GRID)), axis=-1)
    target = uv.reshape(-1, 2) - [width / 2, height / 2]
    xy = _rays(given, target)
    if xy is None:
        return OurLens(own, np.inf, fitted=False)
    off = _farthest(own, xy, target)
    if off < DROPPED_PX:
        return OurLens(own, off, fitted=False)

    def left(values: F64) -> F64:
        return np.asarray((_image(dict(zip(OURS, values, strict=True)), xy) - target).ravel())

    start = np.array([own[key] for key in OURS])
    found = least_squares(left, start, x_scale=[own["f"]] * 4 + [1.0] * 4, xtol=1e-14, ftol=1e-14)
    own = {key: float(value) for key, value in zip(OURS, found.x, strict=True)}
    return OurLens(own, _farthest(own, xy, target), fitted=True)


def _image(lens: Mapping[str, float], xy: F64) -> F64:
    """[P, 2] pixels from the image's middle, of directions x = X / Z, y = Y / Z."""
    x, y = xy.T
    s = x * x + y * y
    k1, k2, k3, k4, p1, p2, p3, p4 = (lens.get(f"{a}{i}", 0.0) for a in "kp" for i in (1, 2, 3, 4))
    radial = 1 + s * (k1 + s * (k2 + s * (k3 + s * k4)))
    tangential = 1 + s * (p3 + s * p4)
    u = x * radial + (p1 * (s + 2 * x * x) + 2 * p2 * x * y) * tangential
    v = y * radial + (p2 * (s + 2 * y * y) + 2 * p1 * x * y) * tangential
    f, b2 = lens["f"], lens.get("b2", 0.0)
    return np.stack([lens["cx"] + u * (f + lens["b1"]) + v * b2, lens["cy"] + v * f], axis=-1)


def _rays(lens: Mapping[str, float], target: F64) -> F64 | None:
    """Where `_image` is ``target``, by Newton's method from the pinhole; None where it folds on the way."""
    if not (lens["f"] > 0 and lens["f"] + lens["b1"] > 0):
        return None
    xy = (target - [lens["cx"], lens["cy"]]) / [lens["f"] + lens["b1"], lens["f"]]
    step = 1e-6
    with np.errstate(all="ignore"):
        for _ in range(30):
            slope = np.stack(
                [
                    (_image(lens, xy + step * axis) - _image(lens, xy - step * axis)) / (2 * step)
                    for axis in np.eye(2)
                ],
                axis=-1,
            )
            if not np.isfinite(slope).all() or (np.linalg.det(slope) <= 0).any():
                return None
            xy = xy - np.linalg.solve(slope, (_image(lens, xy) - target)[..., None])[..., 0]
        found = np.abs(_image(lens, xy) - target).max() < 1e-6
    return xy if found else None


def _farthest(lens: Mapping[str, float], xy: F64, target: F64) -> float:
    return float(np.linalg.norm(_image(lens, xy) - target, axis=-1).max())

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The sensor's noise: given, or estimated from the photographs themselves.

A radiance L has variance read^2 + gain L: what reading the sensor adds, and the photons' own (Foi, Trimeche,
Katkovnik and Egiazarian 2008). Both are seen where the picture is smooth: second differences along both axes
are blind to planes, and have 36 times the variance of noise (Immerkaer 1996). Texture and highlights only add
to that, so that each level of brightness is believed where it is smoothest. A share of the radiance, as
multiplicative noise and faint texture leave, is fitted beside the two and dropped: it is alike at all texels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.optimize import nnls

from ..arrays import F32, F64, I64, Bool, Float
from ..capture import Photograph
from ..errors import InputError

GAIN_OF_MASK = 36.0
"""Sum of the squares of [1, -2, 1] x [1, -2, 1], second differences along both axes."""
LEVELS = 12
"""Bins of brightness in a photograph, each with as many pixels."""
PATCH = 6
"""Side of the patches among which the smoothest are looked for, in pixels."""
MOST = 6000
"""Patches of a photograph that are looked at."""
FULL = 0.8
"""Share of a patch's pixels that have to be data."""
SMOOTHEST = 0.25
"""Quantile of the patches' variances, at each level, that is believed."""
OF_NORMAL = 0.317
"""That quantile of the patches' median squares, over the variance, of normal noise."""
FEWEST = 16
"""Patches that a photograph has to have."""
COMPARABLE = 0.05
"""Relative noise of a texel up to which it counts in full."""
CONCERNED = 0.05
"""Share of the texels from which noise is a concern."""
LEAST_SHARE = 1e-3
INTERPOLATED = 4 / 9
"""Variance of a bilinear sample over a pixel's, in the mean over the places between pixels."""


@dataclass(frozen=True)
class NoiseModel:
    """``read``: standard deviation in units of radiance; ``gain``: variance a unit of radiance."""

    read: float
    gain: float

    def __post_init__(self) -> None:
        for name in ("read", "gain"):
            value = getattr(self, name)
            if not 0 <= value < np.inf:
                raise InputError(
                    f"{name} = {value}",
                    expected="0 or more, in units of the photographs' radiance",
                    hint="Give noise as READ,GAIN: a radiance L has variance READ^2 + GAIN L.",
                )

    def variance(self, radiance: Float) -> F64:
        """Of a pixel's channel."""
        return np.asarray(self.read**2 + self.gain * np.maximum(radiance, 0), dtype=np.float64)


def noise_levels(photograph: Photograph) -> F64:
    """Levels of brightness and variances there, [B, 2], of a photograph, where it has enough patches."""
    strips = _strips(
        photograph.valid & (photograph.alpha > 1 - 1e-6) & (photograph.radiance > 0).any(axis=-1)
    )
    if strips is None:
        return np.zeros((0, 2))
    rows, clear = strips
    inside = _patches(np.asarray(sliding_window_view(clear, (3, 3), axis=(1, 2)).all(axis=(-1, -2))))
    full = inside.mean(axis=1) >= FULL
    if not full.any():
        return np.zeros((0, 2))
    found = []
    for c in range(3):
        strip = photograph.radiance[..., c][rows].astype(np.float64)
        square = np.diff(np.diff(strip, 2, axis=1), 2, axis=2) ** 2 / GAIN_OF_MASK
        # Medians within a patch, for spikes are no noise.
        level, variance = (
            np.nanmedian(np.where(inside[full], _patches(of)[full], np.nan), axis=1)
            for of in (strip[:, 1:-1, 1:-1], square)
        )
        found.append(np.stack([level, variance / OF_NORMAL], axis=1))
    patches = np.concatenate(found)
    if len(patches) < FEWEST:
        return np.zeros((0, 2))
    patches = patches[np.argsort(patches[:, 0])]
    bins = np.array_split(patches, min(LEVELS, len(patches) // (FEWEST // 2)))
    return np.array([[np.median(of[:, 0]), np.quantile(of[:, 1], SMOOTHEST)] for of in bins])


def fitted_noise(levels: Sequence[F64]) -> NoiseModel | None:
    """The model of all photographs' levels, by relative least squares; None where there are none."""
    every = np.concatenate([np.zeros((0, 2)), *levels])
    if not len(every):
        return None
    level, variance = every.T
    # Digital zeros and saturated plains have no variance to tell of.
    floor = max(1e-3 * float(np.median(variance)), 1e-30)
    scale = 1 / np.maximum(variance, floor)
    columns = np.stack([np.ones_like(level), level, level**2], axis=1)
    unit = np.maximum(np.abs(columns).max(axis=0), 1e-30)
    found, _ = nnls(columns / unit * scale[:, None], variance * scale)
    read2, gain, _ = found / unit
    return NoiseModel(float(np.sqrt(read2)), float(gain))


def _strips(clear: Bool) -> tuple[I64, Bool] | None:
    """Rows [S, PATCH + 2] of evenly spread strips of patches, and ``clear`` there; None where none fits."""
    height, width = clear.shape
    strips, across = (height - 2) // PATCH, (width - 2) // PATCH
    if strips < 1 or across < 1:
        return None
    chosen = np.arange(0, strips, -(-strips * across // MOST))
    rows = 1 + PATCH * chosen[:, None] + np.arange(-1, PATCH + 1)
    return rows, clear[rows]


def _patches(strips: Float | Bool) -> NDArray[Any]:
    """[B, PATCH^2]: the patches of strips [S, PATCH, W]; what is left at the right is not used."""
    across = strips.shape[2] // PATCH
    whole = strips[:, :, : across * PATCH].reshape(len(strips), PATCH, across, PATCH)
    return whole.swapaxes(1, 2).reshape(-1, PATCH**2)


def noise_shares(model: NoiseModel, radiance: F32, offsets: I64) -> F64:
    """What each texel [M] should count by its noise, the most 1.

    A texel counts in full while its samples' noise is below what models leave anyway (``COMPARABLE``), and by
    inverse variance beyond. Where that concerns few texels all count in full. What that gains is measured by
    scripts/measure/robust.py, part ``weighed``. How many views see a texel is no weight: Eq. 5 sums over them
    relative to their energy, and a texel that few see is as much of the surface.

    Args:
        radiance: [P, 3] measured, not weighted; ``offsets`` [M + 1].
    """
    views = np.diff(offsets)
    energy = np.add.reduceat((radiance.astype(np.float64) ** 2).sum(axis=1), offsets[:-1]) / views
    variance = np.add.reduceat(model.variance(radiance).sum(axis=1), offsets[:-1]) / views * INTERPOLATED
    share = np.clip(COMPARABLE**2 * energy / np.maximum(variance, 1e-30), LEAST_SHARE, 1.0)
    return share if (share < 1).mean() >= CONCERNED else np.ones(len(views))

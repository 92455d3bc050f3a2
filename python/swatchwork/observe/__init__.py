# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Observe: photographs resampled onto the atlas, and the rendering operator of what was observed."""

from swatchwork.observe.noise import NoiseModel, noise_shares
from swatchwork.observe.observations import Observations, observe
from swatchwork.observe.rendering import Lights, Pairs, Rendering, Weighting, stratified
from swatchwork.observe.small import SmallPicture

__all__ = [
    "Lights",
    "NoiseModel",
    "Observations",
    "Pairs",
    "Rendering",
    "SmallPicture",
    "Weighting",
    "noise_shares",
    "observe",
    "stratified",
]

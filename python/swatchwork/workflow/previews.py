# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Pictures to look at, toned as the paper's figures."""

from __future__ import annotations

import numpy as np

from ..arrays import F32, U8
from ..light import Environment
from ..report import display

EXPOSURE = 0.5
"""Display value, before gamma, of radiance equal to the light's mean."""


def preview(pixels: F32, light: Environment) -> U8:
    """Premultiplied linear RGBA [H, W, 4] as 8-bit straight RGBA: gamma 2.2, exposure by the light's mean."""
    mean = float(np.mean(light.mean_radiance))
    return display(pixels[..., :3], pixels[..., 3], EXPOSURE / max(mean, 1e-12))

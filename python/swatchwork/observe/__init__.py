# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Observe: photographs resampled onto the atlas, and the rendering operator of what was observed."""

from swatchwork.observe.observations import Observations, observe
from swatchwork.observe.rendering import Pairs, Rendering, Weighting, environments_of, stratified

__all__ = ["Observations", "Pairs", "Rendering", "Weighting", "environments_of", "observe", "stratified"]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Analysis: how many views, where to stand, and where a result is to be trusted (paper, section 5)."""

from .conditioning import (
    BLENDED,
    NOISE,
    Conditioning,
    Views,
    blend_spectra,
    condition_numbers,
    conditioning,
    singular_values,
)
from .confidence import fit_error_model, spread_of_representatives
from .directions import LEAST, Directions, directional_responses, in_local_frames
from .planning import Criterion, Plan, Prior, next_best_views, prior_of, uniform_views

__all__ = [
    "BLENDED",
    "LEAST",
    "NOISE",
    "Conditioning",
    "Criterion",
    "Directions",
    "Plan",
    "Prior",
    "Views",
    "blend_spectra",
    "condition_numbers",
    "conditioning",
    "directional_responses",
    "fit_error_model",
    "in_local_frames",
    "next_best_views",
    "prior_of",
    "singular_values",
    "spread_of_representatives",
    "uniform_views",
]

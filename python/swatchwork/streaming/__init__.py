# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Streaming: the solver on a subset of the texels, the blend of all of them by tiles, in bounded memory."""

from .agreement import Agreement, agreement, only
from .budget import Budget
from .frames import diagnose
from .subset import VIEWED, solve_on_subset
from .suspects import Diagnosis, Evidence, FrameOptions, FrameScale
from .tiles import TexelBlend, blend_every_texel

__all__ = [
    "VIEWED",
    "Agreement",
    "Budget",
    "Diagnosis",
    "Evidence",
    "FrameOptions",
    "FrameScale",
    "TexelBlend",
    "agreement",
    "blend_every_texel",
    "diagnose",
    "only",
    "solve_on_subset",
]

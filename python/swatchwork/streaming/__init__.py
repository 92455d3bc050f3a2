# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Streaming: the solver on a subset of the texels, the blend of all of them by tiles, in bounded memory."""

from .budget import Budget
from .subset import VIEWED, solve_on_subset
from .tiles import TexelBlend, blend_every_texel

__all__ = ["VIEWED", "Budget", "TexelBlend", "blend_every_texel", "solve_on_subset"]

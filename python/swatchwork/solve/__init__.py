# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The sparse solver (section 4): representatives, blends, and how many of each.

Knows matrices, not scenes: generic responses s* and measurements s_hat at texels in, representatives
and sparse blend weights out, with a status and the history of the search.
"""

from __future__ import annotations

from .alternation import Alternation, alternate
from .blending import Blend, Search, SparseBlend, blend, sparse_blend
from .options import SolveOptions
from .penalties import Penalties
from .problem import Problem
from .quick import quick
from .search import resume, solve
from .solution import Solution, Step

__all__ = [
    "Alternation",
    "Blend",
    "Penalties",
    "Problem",
    "Search",
    "Solution",
    "SolveOptions",
    "SparseBlend",
    "Step",
    "alternate",
    "blend",
    "quick",
    "resume",
    "solve",
    "sparse_blend",
]

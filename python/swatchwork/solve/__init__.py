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
from .robust import resume_robustly, solve_robustly
from .robust_start import robust_start
from .search import resume, solve
from .seconding import seconded
from .solution import Outliers, Solution, Step
from .trimming import Trimmed, settled_blend, trimmed_blend

__all__ = [
    "Alternation",
    "Blend",
    "Outliers",
    "Penalties",
    "Problem",
    "Search",
    "Solution",
    "SolveOptions",
    "SparseBlend",
    "Step",
    "Trimmed",
    "alternate",
    "blend",
    "quick",
    "resume",
    "resume_robustly",
    "robust_start",
    "seconded",
    "settled_blend",
    "solve",
    "solve_robustly",
    "sparse_blend",
    "trimmed_blend",
]

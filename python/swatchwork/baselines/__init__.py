# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The methods that the paper was compared with, and the paper's own, behind one interface."""

from __future__ import annotations

from .clustering import Clustering
from .global_linear import GlobalLinear
from .goldman import Goldman
from .lobes import single_lobe
from .method import Measurements, Method, Recovered
from .parametric import PerTexelLobe, fit_reflectance, single_lobe_basis
from .per_texel import PerTexel
from .sparse import NoSparseBlend, SparseAsPossible

__all__ = [
    "Clustering",
    "GlobalLinear",
    "Goldman",
    "Measurements",
    "Method",
    "NoSparseBlend",
    "PerTexel",
    "PerTexelLobe",
    "Recovered",
    "SparseAsPossible",
    "fit_reflectance",
    "single_lobe",
    "single_lobe_basis",
]

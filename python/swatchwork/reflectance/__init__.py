# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Generic BRDFs, from which representatives are combined (paper, section 4)."""

from __future__ import annotations

from swatchwork.reflectance.basis import (
    DIFFUSE_KERNELS,
    GenericBasis,
    Lobe,
    basis_by_name,
    extended,
    paper,
)
from swatchwork.reflectance.microfacets import (
    DIFFUSE_SHAPES,
    beckmann,
    diffuse_value,
    masking_value,
    reflected_light,
    schlick,
)

__all__ = [
    "DIFFUSE_KERNELS",
    "DIFFUSE_SHAPES",
    "GenericBasis",
    "Lobe",
    "basis_by_name",
    "beckmann",
    "diffuse_value",
    "extended",
    "masking_value",
    "paper",
    "reflected_light",
    "schlick",
]

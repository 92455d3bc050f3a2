# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The rendering operator: responses of generic BRDFs and of representatives (Eqs. 1, 13, 14)."""

from __future__ import annotations

from swatchwork.response.operator import (
    compiled,
    generic_responses,
    instruction_sets,
    representative_responses,
)
from swatchwork.response.rings import DEFAULT_QUADRATURE, Quadrature, Rings, log_rings

__all__ = [
    "DEFAULT_QUADRATURE",
    "Quadrature",
    "Rings",
    "compiled",
    "generic_responses",
    "instruction_sets",
    "log_rings",
    "representative_responses",
]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Interreflection: light that reaches a point by way of the object itself."""

from .bounce import Reflecting, bounced, bounces_of
from .light import IndirectLight
from .share import IndirectShare, indirect_share
from .surroundings import PLACES, Surroundings, surroundings

__all__ = [
    "PLACES",
    "IndirectLight",
    "IndirectShare",
    "Reflecting",
    "Surroundings",
    "bounced",
    "bounces_of",
    "indirect_share",
    "surroundings",
]

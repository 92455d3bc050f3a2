# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where photographs were taken from, in the world of the object's mesh (paper, section 6)."""

from swatchwork.prepare.registering.motion import apart, moved, projected
from swatchwork.prepare.registering.pairs import Pairs, read_pairs, write_pairs
from swatchwork.prepare.registering.posing import Posed, default_tolerance_px, pose_from_pairs
from swatchwork.prepare.registering.view import View

__all__ = [
    "Pairs",
    "Posed",
    "View",
    "apart",
    "default_tolerance_px",
    "moved",
    "pose_from_pairs",
    "projected",
    "read_pairs",
    "write_pairs",
]

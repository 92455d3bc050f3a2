# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where photographs were taken from, in the world of the object's mesh (paper, section 6)."""

from swatchwork.prepare.registering.aligning import Aligned, align_to_mesh
from swatchwork.prepare.registering.bundle import Bundle, refine
from swatchwork.prepare.registering.growing import Grown, Placed, grow
from swatchwork.prepare.registering.motion import apart, moved, projected
from swatchwork.prepare.registering.rematching import rematched
from swatchwork.prepare.registering.resection import Resection, resect
from swatchwork.prepare.registering.sliding import Extra
from swatchwork.prepare.registering.structure import Structure, structure_from_motion
from swatchwork.prepare.registering.tracks import Features, Tracks, features, find_tracks, matches
from swatchwork.prepare.registering.view import View

__all__ = [
    "Aligned",
    "Bundle",
    "Extra",
    "Features",
    "Grown",
    "Placed",
    "Resection",
    "Structure",
    "Tracks",
    "View",
    "align_to_mesh",
    "apart",
    "features",
    "find_tracks",
    "grow",
    "matches",
    "moved",
    "projected",
    "refine",
    "rematched",
    "resect",
    "structure_from_motion",
]

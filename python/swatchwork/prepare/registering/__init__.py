# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where photographs were taken from, in the world of the object's mesh (paper, section 6)."""

from swatchwork.prepare.registering.bundle import Bundle, refine
from swatchwork.prepare.registering.first import Clues
from swatchwork.prepare.registering.growing import Grown, Placed, grow
from swatchwork.prepare.registering.motion import apart, moved, projected
from swatchwork.prepare.registering.onto_mesh import Aligned, align_to_mesh
from swatchwork.prepare.registering.pairs import Pairs, read_pairs, write_pairs
from swatchwork.prepare.registering.posing import Posed, default_tolerance_px, pose_from_pairs
from swatchwork.prepare.registering.register import FrameFit, Others, Registered, register
from swatchwork.prepare.registering.resection import Resection, resect
from swatchwork.prepare.registering.sliding import Extra
from swatchwork.prepare.registering.structure import Structure, structure_from_motion
from swatchwork.prepare.registering.tracks import Features, Tracks, features, find_tracks, matches
from swatchwork.prepare.registering.view import View

__all__ = [
    "Aligned",
    "Bundle",
    "Clues",
    "Extra",
    "Features",
    "FrameFit",
    "Grown",
    "Others",
    "Pairs",
    "Placed",
    "Posed",
    "Registered",
    "Resection",
    "Structure",
    "Tracks",
    "View",
    "align_to_mesh",
    "apart",
    "default_tolerance_px",
    "features",
    "find_tracks",
    "grow",
    "matches",
    "moved",
    "pose_from_pairs",
    "projected",
    "read_pairs",
    "refine",
    "register",
    "resect",
    "structure_from_motion",
    "write_pairs",
]

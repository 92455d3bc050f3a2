# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where photographs were taken from, in the world of the object's mesh (paper, section 6)."""

from swatchwork.prepare.registering.bundle import Bundle, refine
from swatchwork.prepare.registering.contours import ImageEdges, contour_terms, depth_contours
from swatchwork.prepare.registering.first import Clues
from swatchwork.prepare.registering.growing import grow
from swatchwork.prepare.registering.motion import apart, moved, projected
from swatchwork.prepare.registering.on_board import board_poses
from swatchwork.prepare.registering.onto_mesh import align_to_mesh
from swatchwork.prepare.registering.outlining import pose_from_outline
from swatchwork.prepare.registering.pairs import Pairs, read_pairs, write_pairs
from swatchwork.prepare.registering.placing import place_mesh
from swatchwork.prepare.registering.posing import Posed, default_tolerance_px, pose_from_pairs
from swatchwork.prepare.registering.refining import Refined, iou, refine_by_contours
from swatchwork.prepare.registering.register import Others, Registered, register
from swatchwork.prepare.registering.rematching import rematched
from swatchwork.prepare.registering.resection import resect
from swatchwork.prepare.registering.spheres import sphere_camera, sphere_in_rig
from swatchwork.prepare.registering.structure import Structure, structure_from_motion
from swatchwork.prepare.registering.tracks import Features, Tracks, features, find_tracks, matches
from swatchwork.prepare.registering.view import View

__all__ = [
    "Bundle",
    "Clues",
    "Features",
    "ImageEdges",
    "Others",
    "Pairs",
    "Posed",
    "Refined",
    "Registered",
    "Structure",
    "Tracks",
    "View",
    "align_to_mesh",
    "apart",
    "board_poses",
    "contour_terms",
    "default_tolerance_px",
    "depth_contours",
    "features",
    "find_tracks",
    "grow",
    "iou",
    "matches",
    "moved",
    "place_mesh",
    "pose_from_outline",
    "pose_from_pairs",
    "projected",
    "read_pairs",
    "refine",
    "refine_by_contours",
    "register",
    "rematched",
    "resect",
    "sphere_camera",
    "sphere_in_rig",
    "structure_from_motion",
    "write_pairs",
]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where photographs were taken from, in the world of the object's mesh (paper, section 6)."""

from swatchwork.prepare.registering.contours import (
    Contours,
    ContourTerms,
    ImageEdges,
    contour_terms,
    depth_contours,
)
from swatchwork.prepare.registering.motion import apart, moved, projected
from swatchwork.prepare.registering.pairs import Pairs, read_pairs, write_pairs
from swatchwork.prepare.registering.placing import BoardPoses, Placed, board_poses, place_mesh
from swatchwork.prepare.registering.posing import Posed, default_tolerance_px, pose_from_pairs
from swatchwork.prepare.registering.refining import Refined, iou, refine_by_contours
from swatchwork.prepare.registering.spheres import SpherePose, region_outline, sphere_camera
from swatchwork.prepare.registering.view import View

__all__ = [
    "BoardPoses",
    "ContourTerms",
    "Contours",
    "ImageEdges",
    "Pairs",
    "Placed",
    "Posed",
    "Refined",
    "SpherePose",
    "View",
    "apart",
    "board_poses",
    "contour_terms",
    "default_tolerance_px",
    "depth_contours",
    "iou",
    "moved",
    "place_mesh",
    "pose_from_pairs",
    "projected",
    "read_pairs",
    "refine_by_contours",
    "region_outline",
    "sphere_camera",
    "write_pairs",
]

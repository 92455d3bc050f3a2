# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Synthetic problems and captures with known truth, for tests, benchmarks, experiments and the demo."""

from .blends import blend_pattern, dense_weights
from .captures import SyntheticCapture, simulate_capture
from .environments import KINDS, procedural_environment
from .faults import slip_exposure, turn_light, turn_pose
from .materials import (
    Lobe,
    Recipe,
    four_materials,
    ggx_basis,
    ggx_mixture,
    in_basis,
    in_ggx,
    many_materials,
    satin_materials,
)
from .measured import MeasuredBrdf, material_names, read_merl_binary, read_neural_brdf, read_npf
from .outliers import spoil_capture, spoiled
from .photographs import Subject, photograph
from .problem import Pairs, SyntheticProblem, two_of_four, visible_pairs
from .quadrature import measured_responses
from .shapes import SHAPES, shape
from .spheres import KernelMaterials, MeasuredMaterials, Sphere, SphereCapture, nrms
from .viewpoints import camera_towards, look_at, random_directions, ring_directions

__all__ = [
    "KINDS",
    "SHAPES",
    "KernelMaterials",
    "Lobe",
    "MeasuredBrdf",
    "MeasuredMaterials",
    "Pairs",
    "Recipe",
    "Sphere",
    "SphereCapture",
    "Subject",
    "SyntheticCapture",
    "SyntheticProblem",
    "blend_pattern",
    "camera_towards",
    "dense_weights",
    "four_materials",
    "ggx_basis",
    "ggx_mixture",
    "in_basis",
    "in_ggx",
    "look_at",
    "many_materials",
    "material_names",
    "measured_responses",
    "nrms",
    "photograph",
    "procedural_environment",
    "random_directions",
    "read_merl_binary",
    "read_neural_brdf",
    "read_npf",
    "ring_directions",
    "satin_materials",
    "shape",
    "simulate_capture",
    "slip_exposure",
    "spoil_capture",
    "spoiled",
    "turn_light",
    "turn_pose",
    "two_of_four",
    "visible_pairs",
]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Materials for other programs: glTF, Mitsuba, Blender, MaterialX, maps."""

from .blender import write_blender
from .fitting import StandardFit, fit_standard
from .folder import check_free, export_folder, is_export_folder
from .gltf import check_glb_free, glb_bytes, glb_file
from .maps import write_maps
from .materialx import write_materialx
from .mitsuba import write_mitsuba
from .standard import Standard
from .surroundings import UP, Surroundings, Up
from .textures import Padding

__all__ = [
    "UP",
    "Padding",
    "Standard",
    "StandardFit",
    "Surroundings",
    "Up",
    "check_free",
    "check_glb_free",
    "export_folder",
    "fit_standard",
    "glb_bytes",
    "glb_file",
    "is_export_folder",
    "write_blender",
    "write_maps",
    "write_materialx",
    "write_mitsuba",
]

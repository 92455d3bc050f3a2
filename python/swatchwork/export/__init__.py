# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Materials for other programs: glTF, Mitsuba, Blender, MaterialX, maps."""

from .blender import write_blender
from .fitting import StandardFit, fit_standard
from .folder import check_free, export_folder, is_export_folder
from .gltf import glb_bytes, glb_file
from .maps import write_maps
from .materialx import write_materialx
from .mitsuba import write_mitsuba
from .standard import Standard
from .surroundings import Surroundings
from .textures import Padding

__all__ = [
    "Padding",
    "Standard",
    "StandardFit",
    "Surroundings",
    "check_free",
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

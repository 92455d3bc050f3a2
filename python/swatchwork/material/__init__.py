# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The result: a spatially-varying material and the folder it is kept in (design, section 4)."""

from .folder import SCHEMA_VERSION, is_material_folder, read_material, whole_folder, write_material
from .maps import MaterialMaps, material_maps, normal_albedo
from .material import BasisRecord, Material

__all__ = [
    "SCHEMA_VERSION",
    "BasisRecord",
    "Material",
    "MaterialMaps",
    "is_material_folder",
    "material_maps",
    "normal_albedo",
    "read_material",
    "whole_folder",
    "write_material",
]

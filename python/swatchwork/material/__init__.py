# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The result: a spatially-varying material and the folder it is kept in (design, section 4)."""

from .folder import SCHEMA_VERSION, is_material_folder, read_material, write_material
from .maps import LUMINANCE, MaterialMaps, expected_error, material_maps, normal_albedo
from .material import BasisRecord, Material
from .trust import LEAST, ErrorModel, confidence_of, dense, features, neighbourhood_of_windows

__all__ = [
    "LEAST",
    "LUMINANCE",
    "SCHEMA_VERSION",
    "BasisRecord",
    "ErrorModel",
    "Material",
    "MaterialMaps",
    "confidence_of",
    "dense",
    "expected_error",
    "features",
    "is_material_folder",
    "material_maps",
    "neighbourhood_of_windows",
    "normal_albedo",
    "read_material",
    "write_material",
]

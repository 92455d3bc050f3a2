# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Surface: meshes, their atlas of texels, and what sees what."""

from swatchwork.surface.atlas import Atlas, build_atlas, default_resolution, fill_gutter, padded
from swatchwork.surface.files import buffers_of, read_mesh
from swatchwork.surface.mesh import Mesh, mesh_from_arrays, write_mesh_obj
from swatchwork.surface.points import SurfacePoints, points_in_sight, sky_of_points, surface_points
from swatchwork.surface.rays import GRAZING, Hit, RayScene, each_of, sees
from swatchwork.surface.sky import SkyMasks, sky_masks, turned
from swatchwork.surface.sphere import sphere_mesh
from swatchwork.surface.unwrap import has_injective_uv, parametrised, unwrap, uv_problem

__all__ = [
    "GRAZING",
    "Atlas",
    "Hit",
    "Mesh",
    "RayScene",
    "SkyMasks",
    "SurfacePoints",
    "buffers_of",
    "build_atlas",
    "default_resolution",
    "each_of",
    "fill_gutter",
    "has_injective_uv",
    "mesh_from_arrays",
    "padded",
    "parametrised",
    "points_in_sight",
    "read_mesh",
    "sees",
    "sky_masks",
    "sky_of_points",
    "sphere_mesh",
    "surface_points",
    "turned",
    "unwrap",
    "uv_problem",
    "write_mesh_obj",
]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Surface: meshes, their atlas of texels, and what sees what."""

from swatchwork.surface.atlas import Atlas, build_atlas, default_resolution, fill_gutter, padded
from swatchwork.surface.files import buffers_of, read_mesh
from swatchwork.surface.mesh import Mesh, mesh_from_arrays, write_mesh_obj
from swatchwork.surface.points import SurfacePoints, points_in_sight, sky_of_points, surface_points
from swatchwork.surface.rays import GRAZING, Hit, RayScene, each_of, facing, sees
from swatchwork.surface.sky import LIFT, SkyMasks, places_of, shared_samples, sky_masks, turned, unpacked
from swatchwork.surface.sky import SIZE as SKY_SIDE
from swatchwork.surface.sphere import sphere_mesh
from swatchwork.surface.unwrap import has_injective_uv, parametrised, unwrap, uv_problem

__all__ = [
    "GRAZING",
    "LIFT",
    "SKY_SIDE",
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
    "facing",
    "fill_gutter",
    "has_injective_uv",
    "mesh_from_arrays",
    "padded",
    "parametrised",
    "places_of",
    "points_in_sight",
    "read_mesh",
    "sees",
    "shared_samples",
    "sky_masks",
    "sky_of_points",
    "sphere_mesh",
    "surface_points",
    "turned",
    "unpacked",
    "unwrap",
    "uv_problem",
    "write_mesh_obj",
]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A script that builds the scene in Blender, and the files it reads; nothing of Blender is imported here."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..arrays import F64
from ..capture import Camera, write_exr, write_exr_channels
from ..material import Material
from ..relight import output_names
from ..surface import Mesh, write_mesh_obj
from .fitting import StandardFit
from .folder import write_json
from .mitsuba import script
from .standard import F0, Standard
from .surroundings import BLENDER_FROM_MITSUBA, Surroundings, latitude_longitude, warn_of_lenses
from .textures import Padding


def write_blender(
    folder: Path, material: Material, fit: StandardFit, padding: Padding, frames: Surroundings
) -> None:
    """Write open_in_blender.py, its maps, mesh.obj, light and scene.json.

    The script's node tree follows Schlick's formula by n.o, the fitted model by o.h: where lobes are wide
    and seen at grazing incidence the two differ, which the fit's stated loss does not hold.
    """
    p, of = fit.parameters, fit.blend_of_texel
    for name, values in terms(p).items():
        write_exr(folder / f"{name}.exr", padding.image(values[of]), half=True)
    rough = padding.image(p.roughness[of].astype(np.float16))
    write_exr_channels(folder / "roughness.exr", {"Y": rough})
    write_mesh_obj(
        folder / "mesh.obj", Mesh(material.vertices, material.faces, material.normals, material.uv)
    )
    lights = []
    for i, light in enumerate(frames.lights):
        raster, world_from_mitsuba = latitude_longitude(light)
        write_exr(folder / f"environment_{i}.exr", raster.radiance)
        turn = world_from_mitsuba @ BLENDER_FROM_MITSUBA.T
        lights.append({"file": f"environment_{i}.exr", "world_from_environment": turn.tolist()})
    warn_of_lenses(frames.cameras, square=False)
    names = output_names(list(frames.names))
    listed = [
        {"name": name, "light": light, **_camera(camera)}
        for name, light, camera in zip(names, frames.light_of_frame, frames.cameras, strict=True)
    ]
    write_json(folder / "scene.json", {"lights": lights, "frames": listed})
    (folder / "open_in_blender.py").write_text(script("open_in_blender.py"), encoding="utf-8")


def terms(p: Standard) -> dict[str, F64]:
    """Maps [T, 3] of the fitted model's terms: what a node tree multiplies and adds.

    With r = (1 - cosine)^5, the lobe reflects normal + (grazing - normal) r, and beneath it there is
    diffuse (1 - (R + (G - R) r)) / pi, with R and G the red and green of dielectric: only the dielectric's
    share of the lobe takes light from what is beneath, for under a metal there is nothing.
    """
    m, w = p.metallic[:, None], p.specular[:, None]
    f0 = np.minimum(F0 * p.specular_colour, 1)
    return {
        "diffuse": (1 - m) * p.base_colour,
        "normal_reflectance": m * p.base_colour + (1 - m) * w * f0,
        "grazing_reflectance": np.broadcast_to(m + (1 - m) * w, f0.shape),
        "dielectric": np.concatenate([w * f0.max(axis=1, keepdims=True), w, np.zeros_like(w)], axis=1),
    }


def _camera(c: Camera) -> dict[str, object]:
    return {
        "width": c.width,
        "height": c.height,
        "fx": c.fx,
        "fy": c.fy,
        "cx": c.cx,
        "cy": c.cy,
        "world_from_camera": c.world_from_camera.tolist(),
    }

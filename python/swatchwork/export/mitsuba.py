# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A Mitsuba 3 scene whose BSDF plugin evaluates our model exactly: same kernels, same blends, same light.

Blend weights are textures of three representatives each, bilinear as in `relight`. Cameras are pinholes of
square pixels: others are warned of.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import F64
from ..capture import Camera, write_exr
from ..material import LUMINANCE, Material
from ..progress import SILENT, Progress
from ..reflectance import DIFFUSE_KERNELS, GenericBasis
from ..relight import output_names
from ..surface import Mesh, write_mesh_obj
from .folder import write_json
from .surroundings import Surroundings, latitude_longitude, warn_of_lenses, with_rows_at_poles
from .textures import Padding, dense_weights

MITSUBA_FROM_OPENGL = np.diag([-1.0, 1.0, -1.0, 1.0])
"""Camera axes: Mitsuba's look along +z, with x to the left."""
LEAST_COSINE_SHARE = 0.15
"""Of the samples that go where the cosine sends them, whatever the lobes weigh."""


def write_mitsuba(
    folder: Path, material: Material, padding: Padding, frames: Surroundings, progress: Progress = SILENT
) -> None:
    """Write scene.xml, material.json, blends, mesh, light, frames.json, the plugin and render.py."""
    weights = dense_weights(material, padding)
    groups = -(-material.N // 3)
    with progress.stage("mitsuba scene", groups + len(frames.lights)) as task:
        for i in range(groups):
            image = np.zeros((*weights.shape[:2], 3), np.float32)
            part = weights[..., 3 * i : 3 * i + 3]
            image[..., : part.shape[-1]] = part
            write_exr(folder / f"blend_{i}.exr", image)
            task.advance()
        turns = []
        for i, light in enumerate(frames.lights):
            raster, world_from_mitsuba = latitude_longitude(light)
            write_exr(folder / f"environment_{i}.exr", with_rows_at_poles(raster))
            turns.append(world_from_mitsuba)
            task.advance()
    write_mesh_obj(
        folder / "mesh.obj", Mesh(material.vertices, material.faces, material.normals, material.uv)
    )
    write_json(folder / "material.json", kernel_table(material))
    names = output_names(list(frames.names))
    listed = [
        {
            "name": name,
            "environment": f"environment_{light}.exr",
            "world_from_environment": _row_major(_homogeneous(turns[light])),
        }
        for name, light in zip(names, frames.light_of_frame, strict=True)
    ]
    write_json(folder / "frames.json", {"frames": listed})
    warn_of_lenses(frames.cameras, square=True)
    scene = _scene(groups, frames.cameras, listed[0], material)
    (folder / "scene.xml").write_text(scene, encoding="utf-8")
    for name in ("swatchwork_bsdf.py", "render.py"):
        (folder / name).write_text(script(name), encoding="utf-8")


def script(name: str) -> str:
    """A file of scripts/, for the export to hold a copy of."""
    return files(__package__).joinpath("scripts", name).read_text(encoding="utf-8")


def kernel_table(material: Material) -> dict[str, Any]:
    """What the plugin reads: kernels in use, each representative's coefficients, and how to sample it."""
    record = material.basis
    used = np.flatnonzero((material.representatives > 0).any(axis=(0, 2)))
    lobes = record.lobes
    sigmas = sorted({lobes[j][2] for j in used if j < len(lobes)})
    kernels: list[dict[str, Any]] = []
    for j in used:
        if j < len(lobes):
            masking, power, sigma = lobes[j]
            kernels.append({"masking": masking, "power": power, "sigma": sigmas.index(sigma)})
        else:
            kernels.append(
                {"diffuse": [list(pair) for pair in DIFFUSE_KERNELS[record.diffuse[j - len(lobes)]]]}
            )
    # Energy halfway between normal and grazing incidence.
    basis = GenericBasis.of(record)
    energy: F64 = (material.representatives @ LUMINANCE) * basis.albedo(0.5)
    representatives = []
    for n in range(material.N):
        shares = np.zeros(len(sigmas))
        for j in used[used < len(lobes)]:
            shares[sigmas.index(lobes[j][2])] += energy[n, j]
        rest = float(energy[n, len(lobes) :].sum())
        shares *= (1 - LEAST_COSINE_SHARE) / max(float(shares.sum()) + rest, 1e-30)
        rows = [
            [k, *map(float, material.representatives[n, j])]
            for k, j in enumerate(used)
            if material.representatives[n, j].any()
        ]
        representatives.append({"coefficients": rows, "sampling": shares.tolist()})
    return {
        "sigmas": sigmas,
        "maskings": sorted({lobes[j][0] for j in used if j < len(lobes)}),
        "kernels": kernels,
        "representatives": representatives,
    }


def _scene(groups: int, cameras: tuple[Camera, ...], first: dict[str, str], material: Material) -> str:
    textures = "\n".join(
        f"""            <texture type="bitmap" name="blend_{i}">
                <string name="filename" value="blend_{i}.exr"/>
                <boolean name="raw" value="true"/>
                <string name="filter_type" value="bilinear"/>
                <string name="wrap_mode" value="clamp"/>
            </texture>"""
        for i in range(groups)
    )
    sensors = "\n".join(_sensor(camera, material) for camera in cameras)
    return f"""<!-- Import swatchwork_bsdf.py before loading this; render.py does. -->
<scene version="3.0.0">
    <default name="depth" value="2"/>
    <default name="environment" value="{first["environment"]}"/>
    <default name="world_from_environment" value="{first["world_from_environment"]}"/>
    <integrator type="path">
        <integer name="max_depth" value="$depth"/>
        <boolean name="hide_emitters" value="true"/>
    </integrator>
{sensors}
    <emitter type="envmap">
        <string name="filename" value="$environment"/>
        <transform name="to_world"><matrix value="$world_from_environment"/></transform>
    </emitter>
    <shape type="obj">
        <string name="filename" value="mesh.obj"/>
        <bsdf type="swatchwork">
            <string name="filename" value="material.json"/>
{textures}
        </bsdf>
    </shape>
</scene>
"""


def _sensor(camera: Camera, material: Material) -> str:
    centre = (material.vertices.min(axis=0) + material.vertices.max(axis=0)) / 2
    distance = max(float(np.linalg.norm(camera.position - centre)), 1e-6)
    pose = _row_major(camera.world_from_camera @ MITSUBA_FROM_OPENGL)
    # Principal points are offsets from the middle, in parts of the film.
    x, y = 0.5 - camera.cx / camera.width, 0.5 - camera.cy / camera.height
    field = np.degrees(2 * np.arctan(camera.width / (2 * camera.fx)))
    return f"""    <sensor type="perspective">
        <string name="fov_axis" value="x"/>
        <float name="fov" value="{field:.12g}"/>
        <float name="principal_point_offset_x" value="{-x:.12g}"/>
        <float name="principal_point_offset_y" value="{-y:.12g}"/>
        <float name="near_clip" value="{1e-3 * distance:.9g}"/>
        <float name="far_clip" value="{1e3 * distance:.9g}"/>
        <transform name="to_world"><matrix value="{pose}"/></transform>
        <sampler type="multijitter"/>
        <film type="hdrfilm">
            <integer name="width" value="{camera.width}"/>
            <integer name="height" value="{camera.height}"/>
            <string name="pixel_format" value="rgba"/>
            <rfilter type="box"/>
        </film>
    </sensor>"""


def _homogeneous(rotation: F64) -> F64:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    return matrix


def _row_major(matrix: F64) -> str:
    return " ".join(f"{x:.15g}" for x in matrix.ravel())

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What is photographed, from where, and with what lens: a scanned mesh painted with photographed metal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from swatchwork.arrays import F32, F64, unit
from swatchwork.capture import Camera, EnvironmentSource, linear_from_srgb
from swatchwork.light import Environment, read_environment
from swatchwork.surface import Mesh, build_atlas, fill_gutter, padded, read_mesh, unwrap, write_mesh_obj

SCAN = "meshes/stanford-bunny.obj"
PAINT = "textures/rustymetal"
ATLAS = 1024
REPEATS = 0.5
"""Of the paint, over the radius of the object."""
LENS = Camera(1000, 750, 1103.0, 1106.5, 507.4, 368.9, np.eye(4), k1=-0.12, k2=0.05, p1=8e-4, p2=-5e-4)
AWAY = 3.0
"""Of the camera from the middle of the object, in its radii."""
BALL_RADIUS = 0.75
"""Of the mirror ball, in the object's radii."""
BALL_REFLECTANCE = 0.6
AIM_NOISE = 0.04
"""By which the camera is aimed off the middle, in radii: nobody aims exactly."""


@dataclass(frozen=True, eq=False)
class Subject:
    """A mesh with UVs and what is painted on it; images have v = 1 in the first row, numbers are linear."""

    mesh: Mesh
    base_color: F32
    roughness: F32
    metallic: F32


def subject(data: Path, folder: Path) -> Subject:
    """The scan, unwrapped (kept in ``folder/mesh.obj``), painted from three sides."""
    file = folder / "mesh.obj"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_mesh_obj(file, unwrap(read_mesh(data / SCAN)))
    mesh = read_mesh(file)
    atlas = build_atlas(mesh, ATLAS)
    position, normal = atlas.points(slice(None))
    centre, radius = mesh.bounds
    x = (position - centre) / radius * REPEATS
    near = padded(atlas)

    def painted(name: str, channels: int) -> F32:
        picture = cv2.imread(str(data / PAINT / f"{name}.jpg"))[..., ::-1].astype(np.float32) / 255
        picture = linear_from_srgb(picture) if channels == 3 else picture[..., :1]
        values = three_sided(np.ascontiguousarray(picture), x, normal).reshape(len(x), channels)
        image = np.zeros((ATLAS, ATLAS, channels), np.float32)
        image.reshape(-1, channels)[atlas.pixel] = values
        fill_gutter(image, atlas, near)
        return image

    return Subject(mesh, painted("albedo", 3), painted("roughness", 1), painted("metallic", 1))


def three_sided(picture: F32, x: F64, normal: F32) -> F32:
    """A repeating picture projected along the three axes, each where the surface faces it."""
    side = len(picture)
    share = np.abs(normal) ** 6
    share /= share.sum(axis=1, keepdims=True)
    total = np.zeros((len(x), picture.shape[2]), np.float32)
    for axis in range(3):
        at = np.mod(np.delete(x, axis, axis=1) + 0.31 * axis, 1).astype(np.float32) * side
        for start in range(0, len(x), 32_000):
            part = slice(start, start + 32_000)
            u, v = np.ascontiguousarray(at[part, :1]), np.ascontiguousarray(at[part, 1:])
            found = cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
            total[part] += share[part, axis : axis + 1] * found.reshape(len(u), -1)
    return total


def environment(data: Path, name: str) -> Environment:
    """One of the probes in ``envmaps/latlong``: Mitsuba's convention, half a turn about y."""
    file = data / "envmaps" / "latlong" / f"{name}_1024x512.hdr"
    return read_environment(EnvironmentSource(file, "mitsuba", np.diag([-1.0, 1.0, -1.0])))


def cameras(mesh: Mesh, count: int, seed: int, lens: Camera = LENS, turned: float = 0.0) -> list[Camera]:
    """Cameras around the object (y up) at varied heights; the third is a quarter turn from the first of 8."""
    rng = np.random.default_rng(seed)
    centre, radius = mesh.bounds
    found = []
    for i in range(count):
        azimuth = 2 * np.pi * (i + turned) / count + rng.normal() * 0.05
        height = np.deg2rad((12.0, 40.0, 24.0, 55.0)[i % 4] + rng.normal() * 3)
        d = np.array([np.cos(height) * np.sin(azimuth), np.sin(height), np.cos(height) * np.cos(azimuth)])
        eye = centre + d * radius * AWAY * (1 + 0.05 * rng.normal())
        aim = centre + rng.normal(size=3) * AIM_NOISE * radius
        found.append(replace(lens, world_from_camera=looking(eye, aim, roll_rad=0.03 * rng.normal())))
    return found


def looking(eye: F64, aim: F64, roll_rad: float = 0.0) -> F64:
    """Pose F64[4, 4] of a camera that looks at a point, y up but for a roll."""
    back = unit((eye - aim)[None])[0]
    right = unit(np.cross([0.0, 1.0, 0.0], back)[None])[0]
    up = np.cross(back, right)
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([c * right + s * up, c * up - s * right, back])
    pose[:3, 3] = eye
    return pose


def smaller(lens: Camera, factor: int) -> Camera:
    """A lens without distortion, and with fewer pixels: for pictures to compare with."""
    size = (lens.width // factor, lens.height // factor)
    return Camera(*size, lens.fx / factor, lens.fx / factor, size[0] / 2, size[1] / 2, np.eye(4))

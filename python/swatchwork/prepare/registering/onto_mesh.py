# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A world of structure from motion brought onto the mesh's: a rotation, a translation, and a scale.

A photograph posed in both worlds leaves the scale alone unknown. Each point that it sees asks for the one
that brings the point to where its ray first meets the mesh; most agree, and the rest are wrong. Then all
points are brought onto the surface, point to plane, by a similarity near that one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F64, dot, norm
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering.lifting import finite, lifted
from swatchwork.prepare.registering.structure import Structure
from swatchwork.surface import RayScene, surface_points

LEAST = 20
"""Points on the mesh, for a scale."""
WIDTH = 0.02
"""Scales (of the logarithm) that count as the same in the vote."""
AGREE = 0.3
"""Of the points that a placed photograph sees on the mesh, this share must agree on a scale."""
SAMPLES = 60_000
"""Points that stand for the surface; some hundredths of the radius apart at most."""
ROUNDS = 60
NEAR = 0.02
"""Points farther than this from the mesh, in radii, are not of it. The loss turns at a quarter of it."""


@dataclass(frozen=True, eq=False)
class Aligned:
    """Structure from motion in the mesh's world.

    Attributes:
        cameras: of all its photographs, by name.
        mesh_from_structure: F64[4, 4], rotation times ``scale``, and translation.
        scale: world units of the mesh in one of the structure's.
        points: F64[T, 3], its points in the mesh's world.
        off: F64[T], their distances to the mesh (world units), to the nearest sample's plane.
        near: the share of them within 2 % of the object's radius.
    """

    cameras: dict[str, Camera]
    mesh_from_structure: F64
    scale: float
    points: F64
    off: F64
    near: float


def align_to_mesh(scene: RayScene, structure: Structure, posed: Mapping[str, Camera]) -> Aligned:
    """The similarity that brings a structure's points onto the mesh.

    Args:
        posed: poses in the mesh's world, of at least one of the structure's photographs; the one whose points
            agree best on a scale leads.

    Raises:
        InputError: none of the posed photographs is in the structure, or their points agree on no scale.
    """
    shared = [name for name in posed if name in structure.cameras]
    if not shared:
        raise InputError(
            f"none of the placed photographs ({', '.join(posed) or 'there are none'}) is one that structure "
            f"from motion could join ({', '.join(structure.cameras)})",
            expected="one at least",
            hint="Place one of these by clicked pairs",
        )
    votes = [(*_scale(scene, structure, name, posed[name]), name) for name in shared]
    agreeing, seen, scale, name = max(votes, key=lambda vote: vote[0])
    if agreeing < max(LEAST, AGREE * seen):
        raise InputError(
            f"{agreeing} of {seen} points that {name} sees agree on a scale of its world",
            expected=f"{max(LEAST, int(np.ceil(AGREE * seen)))} or more",
            hint="Is its pose right, and the mesh the object's?",
        )
    start = _similarity(posed[name], structure.cameras[name], scale)
    found, points, off = _onto(scene, structure.points, start)
    size = float(np.cbrt(np.linalg.det(found[:3, :3])))
    cameras = {}
    for frame, camera in structure.cameras.items():
        pose = found @ camera.world_from_camera
        pose[:3, :3] /= size
        cameras[frame] = replace(camera, world_from_camera=pose)
    near = float((off < NEAR * scene.radius).mean())
    return Aligned(cameras, found, size, points, off, near)


def _scale(scene: RayScene, structure: Structure, name: str, camera: Camera) -> tuple[int, int, float]:
    """How many points that a photograph sees agree on a scale, of how many on the mesh; and the scale."""
    own = structure.cameras[name]
    mine = np.array([name in frames for frames in structure.frames], dtype=bool)
    x = structure.points[mine]
    uv_px = own.project(x)[0]
    uv_px, away = uv_px[finite(uv_px)], norm(x - own.position)[finite(uv_px)]
    lift = lifted(scene, camera, uv_px)
    ratio = np.log(norm(lift.x[lift.sure] - camera.position) / away[lift.sure])
    if not len(ratio):
        return 0, 0, 1.0
    ratio = np.sort(ratio)
    # The fullest window.
    inside = np.searchsorted(ratio, ratio + WIDTH, side="right") - np.arange(len(ratio))
    first = int(inside.argmax())
    window = ratio[first : first + int(inside[first])]
    return len(window), len(ratio), float(np.exp(np.median(window)))


def _similarity(camera: Camera, own: Camera, scale: float) -> F64:
    """mesh_from_structure [4, 4], of a photograph's poses in both."""
    rotation = camera.world_from_camera[:3, :3] @ own.world_from_camera[:3, :3].T
    found = np.eye(4)
    found[:3, :3] = scale * rotation
    found[:3, 3] = camera.position - scale * rotation @ own.position
    return found


def _onto(scene: RayScene, points: F64, start: F64) -> tuple[F64, F64, F64]:
    """The similarity near ``start`` of least robust distances; points F64[T, 3] by it, distances F64[T]."""
    samples = surface_points(scene.meshes[0], SAMPLES)
    tree = cKDTree(samples.position)
    found, width = start, NEAR * scene.radius
    for _ in range(ROUNDS):
        x = points @ found[:3, :3].T + found[:3, 3]
        _, nearest = tree.query(x)
        normal = samples.upright[nearest]
        error = dot(x - samples.position[nearest], normal)
        weight = 1 / (1 + (error / (width / 4)) ** 2) * (np.abs(error) < 4 * width)
        # Turns, moves and growth about the object's middle, in like units.
        arm = x - scene.centre
        slope = np.column_stack([np.cross(arm, normal), normal * scene.radius, dot(arm, normal)])
        matrix = (slope * weight[:, None]).T @ slope
        # A surface of revolution leaves a turn open: it stays where the photograph has it.
        matrix += 1e-4 * np.trace(matrix) / 7 * np.eye(7)
        step = -np.linalg.solve(matrix, slope.T @ (weight * error))
        change = np.eye(4)
        change[:3, :3] = np.exp(step[6]) * Rotation.from_rotvec(step[:3]).as_matrix()
        change[:3, 3] = scene.centre + scene.radius * step[3:6] - change[:3, :3] @ scene.centre
        found = change @ found
        if np.abs(step).max() < 1e-7:
            break
    x = points @ found[:3, :3].T + found[:3, 3]
    _, nearest = tree.query(x)
    off = np.abs(dot(x - samples.position[nearest], samples.upright[nearest]))
    return found, x, off

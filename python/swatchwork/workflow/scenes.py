# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What analysis and planning look at: a capture's object, a mesh from a file, or a simple shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import cKDTree

from ..arrays import F64, U8, fibonacci_sphere
from ..capture import Camera, Capture
from ..errors import InputError
from ..light import Environment
from ..report import heat
from ..simulate import camera_towards, look_at, shape
from ..surface import Mesh, RayScene, SkyMasks, SurfacePoints, read_mesh, sky_of_points, surface_points
from .relighting import given_environment, occluder_meshes

POINTS = 3000
"""That stand for the surface."""
SHAPES = ("plane", "cap", "hemisphere", "sphere")
UP = np.array([0.0, 0.0, 1.0])
OVERVIEW_FROM = np.array([0.55, -0.75, 0.45])
NONE = np.zeros((0, 3))
"""No directions."""


@dataclass(frozen=True, eq=False)
class Object:
    """An object with points on it, and what blocks light and sight."""

    name: str
    scene: RayScene
    points: SurfacePoints

    @classmethod
    def of_mesh(
        cls, name: str, mesh: Mesh, occluders: Sequence[Mesh] = (), count: int = POINTS, seed: int = 0
    ) -> Object:
        """Spread points over a mesh."""
        return cls(name, RayScene([mesh, *occluders]), surface_points(mesh, count, seed))

    @cached_property
    def sky(self) -> SkyMasks:
        """The points' self-shadowing."""
        return sky_of_points(self.scene, self.points)

    @property
    def radius(self) -> float:
        """Of the ball about the object's centre, world units."""
        return float(self.scene.radius)

    @property
    def centre(self) -> F64:
        """World."""
        return np.asarray(self.scene.centre, np.float64)

    def camera(self, direction: F64, size: int, distance: float) -> Camera:
        """A camera that sees the whole object from a direction, ``distance`` in radii of it."""
        found = camera_towards(direction, size, self.radius, distance)
        pose = look_at(self.centre + direction * distance * self.radius, self.centre)
        return Camera(size, size, found.fx, found.fy, found.cx, found.cy, pose)


def object_of(
    mesh: str | PathLike[str] | None,
    shape_name: str | None,
    occluders: Sequence[str | PathLike[str]] = (),
    count: int = POINTS,
    seed: int = 0,
) -> Object:
    """The object of a mesh file or of a name among ``SHAPES``. Raises InputError where neither is given."""
    blocking = [read_mesh(path) for path in occluders]
    if mesh is not None:
        return Object.of_mesh(Path(mesh).name, read_mesh(mesh), blocking, count, seed)
    if shape_name not in SHAPES:
        raise InputError(
            "no object is given" if shape_name is None else f"no shape {shape_name!r}",
            expected=f"a capture, --mesh FILE, or --shape {', '.join(SHAPES)}",
        )
    sphere = shape("sphere", 96)
    if shape_name == "sphere":
        return Object.of_mesh("sphere", sphere, blocking, count, seed)
    if shape_name == "plane":
        square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
        return Object.of_mesh("plane", Mesh(square, faces, np.tile(UP, (4, 1)), None), blocking, count, seed)
    # Normals of a solid angle of pi, or of 2 pi, about z.
    lowest = 0.5 if shape_name == "cap" else 0.0
    height = sphere.vertices[sphere.faces].mean(axis=1)[:, 2]
    part = Mesh(sphere.vertices, sphere.faces[height > lowest], sphere.normals, None)
    return Object.of_mesh(shape_name, part, blocking, count, seed)


def object_of_capture(capture: Capture, count: int = POINTS, seed: int = 0) -> Object:
    """The object that a capture names. Raises InputError where it names none."""
    if capture.mesh_path is None:
        raise InputError("names no mesh", file=capture.file, expected='a "mesh" key')
    mesh = read_mesh(capture.mesh_path)
    return Object.of_mesh(capture.mesh_path.name, mesh, occluder_meshes(capture), count, seed)


def environments_of(files: Sequence[str | PathLike[str]], conventions: Sequence[str]) -> list[Environment]:
    """Environments by file; one convention serves all, or each has its own."""
    if len(conventions) not in (1, len(files)):
        raise InputError(
            f"{len(conventions)} --convention for {len(files)} --environment",
            expected="one for all, or one each",
            hint="Say blender, mitsuba or debevec-angular",
        )
    each = list(conventions) * (len(files) if len(conventions) == 1 else 1)
    found = [given_environment(file, convention) for file, convention in zip(files, each, strict=True)]
    return [light for light in found if light is not None]


def candidate_directions(count: int, lowest_degrees: float) -> F64:
    """About ``count`` directions [V, 3], evenly over the part of the sphere above an elevation."""
    lowest = np.sin(np.radians(lowest_degrees))
    share = (1 - lowest) / 2
    everywhere = fibonacci_sphere(max(count, round(count / max(share, 0.02))))
    return np.asarray(everywhere[everywhere[:, 2] >= lowest])


def overview(
    thing: Object,
    values: F64,
    top: float,
    directions: F64 = NONE,
    taken: F64 = NONE,
    side: F64 = OVERVIEW_FROM,
    size: int = 560,
) -> U8:
    """The object's points by a value [M] as a heat map, and numbered dots where cameras stand.

    The camera looks on the object from a ``side``; cameras are drawn at a common distance, those behind the
    object fainter; ``taken`` are directions of photographs at hand, without numbers.
    """
    view = side / np.linalg.norm(side)
    camera = thing.camera(view, size, 7.0)
    # Room for the dots, where there are any.
    focal, middle = camera.fx / (1.75 if len(directions) + len(taken) else 1.05), size / 2
    wide = Camera(size, size, focal, focal, middle, middle, camera.world_from_camera)
    column, line = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    rays = wide.rays(np.stack([column, line], axis=-1).reshape(-1, 2))
    hit = thing.scene.first_hit(np.broadcast_to(wide.position, rays.shape), rays)
    on = np.flatnonzero(hit.mesh == 0)
    mesh = thing.scene.meshes[0]
    at = np.einsum("sc,scx->sx", hit.bary[on], mesh.vertices[mesh.faces[hit.face[on]]])
    near = cKDTree(thing.points.position).query(at)[1]
    image = np.zeros(size * size)
    image[on] = values[near]
    mask = np.zeros(size * size, bool)
    mask[on] = True
    pixels = heat(image.reshape(size, size), mask.reshape(size, size), top)
    canvas = np.full((size, size, 3), 250, np.uint8)
    alpha = pixels[..., 3:] / 255.0
    canvas = (pixels[..., :3] * alpha + canvas * (1 - alpha)).astype(np.uint8)
    canvas = np.ascontiguousarray(canvas)
    shown = [(d, "", (120, 120, 120)) for d in taken]
    shown += [(d, str(i + 1), (30, 90, 200)) for i, d in enumerate(directions)]
    for direction, label, colour in sorted(shown, key=lambda s: float(s[0] @ view)):
        where = thing.centre + direction * 1.45 * thing.radius
        towards = thing.centre + direction * 1.15 * thing.radius
        (x, y), (u, v) = wide.project(np.stack([where, towards]))[0]
        if direction @ view < 0:
            colour = (colour[0] // 2 + 125, colour[1] // 2 + 125, colour[2] // 2 + 125)
        start, end = (int(x), int(y)), (int(u), int(v))
        cv2.line(canvas, start, end, colour, 1, cv2.LINE_AA)
        cv2.circle(canvas, start, 9, colour, -1, cv2.LINE_AA)
        width = cv2.getTextSize(label, cv2.FONT_HERSHEY_SIMPLEX, 0.36, 1)[0][0]
        corner = (start[0] - width // 2, start[1] + 4)
        cv2.putText(canvas, label, corner, cv2.FONT_HERSHEY_SIMPLEX, 0.36, (255, 255, 255), 1, cv2.LINE_AA)
    return canvas

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Ray casting against the object and what blocks it (Embree, robust mode), and which texels a camera sees."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from swatchwork.arrays import F32, F64, I32, Bool, dot, norm, unit
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.surface.atlas import Atlas
from swatchwork.surface.mesh import Mesh

# Rays start this far off their surface, in radii of the object. Embree computes in f32 on coordinates
# scaled to the unit ball, where an ulp is 6e-8: the offset is far above its rounding, far below any detail.
OFFSET = 1e-5
# Below this cosine a texel counts as unseen (design 2).
GRAZING = 0.03
CHUNK = 1 << 16
BYTES_OF_THE_FIRST = 160 << 20
"""Of address space that Embree takes for a process's first scene: 131 MB, with one core as with two."""
BYTES_A_FACE = 500
"""Of Embree's tree, while it is built; generous."""
LOWEST_COSINE = 0.02
"""Interpolated normals that turn away from a viewer who sees the surface are bent back to this n.o."""


@dataclass(frozen=True)
class Hit:
    """First hits of R rays: ``mesh`` I32[R], -1 for none; ``face`` I32[R] of that mesh; ``bary`` F64[R, 3];
    ``t`` F64[R], the distance in units of the direction's length (inf for none)."""

    mesh: I32
    face: I32
    bary: F64
    t: F64


class RayScene:
    """The object, first of ``meshes``, and its occluders.

    Rays are given in world units. They are cast in f32 on a scene scaled to the object's unit ball, so the
    precision does not depend on the capture's units or origin. Threads share the work.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        if not meshes:
            raise InputError("a scene needs the object's mesh")
        self.meshes = tuple(meshes)
        self.centre, self.radius = meshes[0].bounds
        _need_memory(BYTES_A_FACE * sum(len(mesh.faces) for mesh in meshes))
        _need_memory_of_the_first()
        self._scene = EmbreeScene(robust=True)
        for mesh in meshes:
            TriangleMesh(
                self._scene,
                self.in_unit_ball(mesh.vertices),
                np.ascontiguousarray(mesh.faces, dtype=np.int32),
            )
        # The scene is built at its first query, which must not be made by two threads at once.
        self.cast(np.zeros((1, 3)), np.ones((1, 3)), np.ones(1), "OCCLUDED")

    @cached_property
    def face_normal(self) -> F64:
        """Unit normals [F, 3] of the object's triangles."""
        return unit(self.meshes[0].crosses)

    @property
    def epsilon(self) -> float:
        """World distance by which rays that leave a surface should be lifted off it."""
        return OFFSET * self.radius

    def occluded(self, origin: F64, direction: F64, far: float | F64 = np.inf) -> Bool:
        """Bool[R]: whether anything lies within ``far`` (in lengths of ``direction``) along each ray [R, 3].

        A single direction [1, 3] serves all origins.
        """
        far = np.broadcast_to(np.asarray(far, dtype=np.float64), len(origin))
        parts = each_of(
            lambda part: self.cast(origin[part], _take(direction, part), far[part], "OCCLUDED"), len(origin)
        )
        return np.concatenate([np.zeros(0, dtype=np.int32), *parts]) >= 0

    def first_hit(self, origin: F64, direction: F64) -> Hit:
        """The nearest hit of each ray, origin and direction [R, 3]."""

        def cast(part: slice) -> Any:
            count = len(origin[part])
            return self.cast(origin[part], _take(direction, part), np.full(count, np.inf), "INTERSECT")

        parts = each_of(cast, len(origin))

        def joined(name: str) -> Any:
            return np.concatenate([np.zeros(0, dtype=np.float32), *(part[name] for part in parts)])

        mesh = joined("geomID").astype(np.int32)
        u, v = joined("u").astype(np.float64), joined("v").astype(np.float64)
        none = mesh < 0
        return Hit(
            mesh=mesh,
            face=np.where(none, -1, joined("primID")).astype(np.int32),
            bary=np.stack([1 - u - v, u, v], axis=1),
            t=np.where(none, np.inf, joined("tfar").astype(np.float64)),
        )

    def in_unit_ball(self, x_in_world: F64) -> F32:
        """Points [P, 3] in the coordinates that rays are cast in: the object's ball is the unit ball."""
        return np.ascontiguousarray((x_in_world - self.centre) / self.radius, dtype=np.float32)

    def occluded_in_unit_ball(self, origin: F32, direction: F32) -> Bool:
        """Like ``occluded`` without a limit, for points already ``in_unit_ball``; in the caller's thread."""
        return np.asarray(self._scene.run(origin, direction, query="OCCLUDED") >= 0)

    def cast(self, origin: F64, direction: F64, far: F64, query: str) -> Any:
        """Embree's answer to an OCCLUDED or INTERSECT query, in the caller's thread."""
        # Directions are divided by the radius too, so distances keep the caller's units.
        limit = np.minimum(far, 1e36).astype(np.float32)
        return self._scene.run(
            self.in_unit_ball(origin),
            np.ascontiguousarray(direction / self.radius, dtype=np.float32),
            dists=limit,
            query=query,
            output=True if query == "INTERSECT" else None,
        )


def each_of(work: Callable[[slice], Any], count: int, at_once: int = CHUNK) -> list[Any]:
    """What ``work`` returns for each chunk of ``count`` rows, in order; threads share the chunks."""
    chunks = [slice(start, min(start + at_once, count)) for start in range(0, count, at_once)]
    if len(chunks) < 2:
        return [work(part) for part in chunks]
    with ThreadPoolExecutor(os.cpu_count() or 1) as threads:
        return list(threads.map(work, chunks))


def _take(direction: F64, part: slice) -> F64:
    return direction if len(direction) == 1 else direction[part]


def sees(scene: RayScene, atlas: Atlas, camera: Camera) -> Bool:
    """Bool[M]: which texel centres the camera sees.

    The triangle faces the camera, the shading normal does with a cosine above 0.03, the point projects
    inside the image, and the segment to the camera is free of the object and of occluders.
    """
    seen: Bool = np.zeros(len(atlas), dtype=bool)
    corner = atlas.mesh.vertices[atlas.mesh.faces[:, 0]]
    towards = dot(atlas.face_normal, camera.position - corner) > 0

    def look(part: slice) -> None:
        texel = part.start + np.flatnonzero(towards[atlas.face[part]])
        position, normal = atlas.points(texel)
        seen[texel] = in_sight(scene, camera, position, normal, atlas.geometric_normal(texel))

    each_of(look, len(atlas))
    return seen


def in_sight(scene: RayScene, camera: Camera, position: F64, normal: F32, upright: F64) -> Bool:
    """Bool[T]: which points [T, 3] of triangles that face the camera it sees.

    ``normal`` is of shading, ``upright`` the triangle's; the rules are those of `sees`.
    """
    seen: Bool = np.zeros(len(position), dtype=bool)
    to_camera = camera.position - position
    facing = np.flatnonzero(dot(normal, to_camera) > GRAZING * norm(to_camera))
    uv_px, depth = camera.project(position[facing])
    inside = (uv_px >= 0).all(axis=1) & (uv_px < (camera.width, camera.height)).all(axis=1) & (depth > 0)
    facing = facing[inside]
    origin = position[facing] + scene.epsilon * upright[facing]
    # A direction as long as the segment: the camera is at t = 1.
    hidden = scene.cast(origin, camera.position - origin, np.ones(len(origin)), "OCCLUDED") >= 0
    seen[facing] = ~hidden
    return seen


def facing(normal: F64, to_viewer: F64) -> F64:
    """Normals [S, 3], those with n.o below 0.02 bent towards the viewer until it is that."""
    cosine = np.einsum("sx,sx->s", normal, to_viewer)[:, None]
    along = unit(normal - cosine * to_viewer)
    bent = LOWEST_COSINE * to_viewer + np.sqrt(1 - LOWEST_COSINE**2) * along
    return np.where(cosine < LOWEST_COSINE, bent, normal)


def _need_memory(count: int) -> None:
    """Raise MemoryError where so many bytes cannot be had: Embree does not ask, and crashes without them."""
    np.empty(count, dtype=np.uint8)


@cache
def _need_memory_of_the_first() -> None:
    """As `_need_memory`, for what a process's first scene begins with."""
    _need_memory(BYTES_OF_THE_FIRST)

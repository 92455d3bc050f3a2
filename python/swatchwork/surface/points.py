# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Points spread over a mesh: what stands for the surface where no atlas is needed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F32, F64, I32, Bool, norm, unit
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.octahedral import pixel_directions
from swatchwork.surface.mesh import Mesh
from swatchwork.surface.rays import RayScene, each_of, in_sight
from swatchwork.surface.sky import BELOW, SIZE, SkyMasks, hidden_cells, packed


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """M points, each of which stands for the same area of the surface."""

    position: F64
    """[M, 3] world."""
    normal: F32
    """[M, 3] unit shading normals."""
    upright: F64
    """[M, 3] unit normals of their triangles."""
    face: I32
    """[M]"""

    def __len__(self) -> int:
        return len(self.position)


def surface_points(mesh: Mesh, count: int, seed: int = 0) -> SurfacePoints:
    """``count`` points: a random one of each equal share of the area, in the order of the mesh's triangles.

    Raises:
        InputError: the mesh has no area.
    """
    cross = mesh.crosses
    area = np.linalg.norm(cross, axis=1) / 2
    total = np.cumsum(area)
    if not total[-1] > 0:
        raise InputError("the mesh has no area", expected="triangles that are not all degenerate")
    rng = np.random.default_rng([seed, 6])
    place = (np.arange(count) + rng.random(count)) / count * total[-1]
    face = np.minimum(np.searchsorted(total, place, side="right"), len(area) - 1)
    # Uniform over the triangle.
    root, v = np.sqrt(rng.random(count)), rng.random(count)
    bary = np.stack([1 - root, root * (1 - v), root * v], axis=-1)
    corners = mesh.faces[face]
    upright = unit(cross[face])
    normal = np.einsum("mc,mcx->mx", bary, mesh.normals[corners])
    normal = np.where(norm(normal)[:, None] > 0.5, unit(normal), upright)
    position = np.einsum("mc,mcx->mx", bary, mesh.vertices[corners])
    return SurfacePoints(position, normal.astype(np.float32), upright, face.astype(np.int32))


def points_in_sight(scene: RayScene, points: SurfacePoints, camera: Camera) -> Bool:
    """Bool[M]: which points the camera sees, by the same rules as texels (see `sees`)."""
    seen: Bool = np.zeros(len(points), dtype=bool)

    def look(part: slice) -> None:
        towards = np.einsum(
            "mx,mx->m", points.upright[part], camera.position - points.position[part], optimize=True
        )
        at = part.start + np.flatnonzero(towards > 0)
        seen[at] = in_sight(scene, camera, points.position[at], points.normal[at], points.upright[at])

    each_of(look, len(points))
    return seen


def sky_of_points(scene: RayScene, points: SurfacePoints) -> SkyMasks:
    """Each point's own mask of the sky; one that hides nothing is not kept."""
    cells = pixel_directions(SIZE).reshape(-1, 3).astype(np.float32)
    words = np.empty((len(points), SIZE), dtype=np.uint64)

    def trace(part: slice) -> None:
        asked = packed(points.normal[part] @ cells.T > -BELOW)
        words[part] = ~hidden_cells(scene, points.position[part], points.upright[part], cells, asked)

    each_of(trace, len(points), at_once=32)
    hides = ~(words == np.uint64(0xFFFFFFFFFFFFFFFF)).all(axis=1)
    return SkyMasks(words[hides], np.where(hides, np.cumsum(hides) - 1, -1).astype(np.int32))

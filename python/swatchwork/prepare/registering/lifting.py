# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From the image onto the mesh: where the rays of image points first meet the object, and how surely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F64, Bool, dot, norm, unit
from swatchwork.capture import Camera
from swatchwork.surface import RayScene
from swatchwork.surface.rays import Hit

GRAZING = 0.15
"""Below this cosine of ray and surface, an error of a pixel is one of seven or more on the surface."""
AROUND_PX = 2.0
"""Rays this far around a point must meet the same smooth patch of surface."""
STEP = 4.0
"""How far from the tangent plane they may meet it, in multiples of their distance sideways."""
SAME_SURFACE = 2e-3
"""Two hits nearer than this share of the object's radius are of one surface, not of one behind another."""


@dataclass(frozen=True, eq=False)
class Lift:
    """Image points on the mesh.

    Attributes:
        x: F64[P, 3], in the world; NaN where the ray misses the object or an occluder is before it.
        normal: F64[P, 3], unit shading normals, towards the camera.
        cosine: F64[P], of the ray and the triangle; 0 where the object is missed.
        sure: Bool[P], neither grazing nor near a jump in depth.
    """

    x: F64
    normal: F64
    cosine: F64
    sure: Bool


def lifted(scene: RayScene, camera: Camera, uv_px: F64) -> Lift:
    """Where the rays through image points [P, 2] first meet the object."""
    d = camera.rays(uv_px)
    seen = finite(d)
    d = np.where(seen[:, None], d, camera.rays(np.array([[camera.cx, camera.cy]])))
    origin = np.broadcast_to(camera.position, d.shape)
    hit = scene.first_hit(origin, d)
    met = seen & (hit.mesh == 0)
    x, normal, upright = on_mesh(scene, hit)
    x[~met] = np.nan
    cosine = np.where(met, np.abs(dot(upright, d)), 0.0)
    normal = np.where(dot(normal, d)[:, None] > 0, -normal, normal)
    sure = met & (cosine >= GRAZING)
    for step in AROUND_PX * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]):
        beside = camera.rays(uv_px + step)
        beside = np.where(np.isfinite(beside), beside, d)
        other = scene.first_hit(origin, beside)
        ahead = dot(upright, beside)
        with np.errstate(divide="ignore", invalid="ignore"):
            plane = dot(upright, d) / ahead * hit.t
            sideways = norm(beside - d) * hit.t
            sure &= (other.mesh == 0) & (np.abs(other.t - plane) < STEP * sideways)
    return Lift(x, normal, cosine, sure)


def finite(x: F64) -> Bool:
    """Bool[P]: which rows of [P, n] have no NaN and no infinity."""
    return np.asarray(np.isfinite(x).all(axis=1))


def on_mesh(scene: RayScene, hit: Hit) -> tuple[F64, F64, F64]:
    """Points, unit shading normals and unit normals of the triangles [R, 3] of hits on the object.

    Of hits on nothing or on another mesh the values mean nothing.
    """
    mesh = scene.meshes[0]
    face = np.where(hit.mesh == 0, hit.face, 0)
    corner = mesh.faces[face]
    x = np.einsum("rc,rcx->rx", hit.bary, mesh.vertices[corner])
    upright = scene.face_normal[face]
    normal = unit(np.einsum("rc,rcx->rx", hit.bary, mesh.normals[corner]))
    # A shading normal far off its triangle's (a rim, a fold) is no tangent plane.
    return x, np.where(dot(normal, upright)[:, None] > 0.5, normal, upright), upright


def dropped(scene: RayScene, x: F64, normal: F64) -> tuple[F64, F64, Bool]:
    """Points [P, 3] moved along their normals onto the object.

    Returns:
        the nearest points of the object on the lines through x along ``normal``, its shading normals there,
        on the side of those given, and Bool[P], whether there are any.
    """
    best_t = np.full(len(x), np.inf)
    found, upright = x.copy(), normal.copy()
    # Start a little off the surface: from within rounding of it, a ray may start on either side.
    back = 10 * scene.epsilon
    for side in (1.0, -1.0):
        hit = scene.first_hit(x + side * back * normal, -side * normal)
        on, shading, _ = on_mesh(scene, hit)
        away = np.abs(hit.t - back)
        nearer = (hit.mesh == 0) & (away < best_t)
        best_t = np.where(nearer, away, best_t)
        found[nearer], upright[nearer] = on[nearer], shading[nearer]
    upright = np.where(dot(upright, normal)[:, None] < 0, -upright, upright)
    return found, upright, np.isfinite(best_t)


def visible(scene: RayScene, camera: Camera, x: F64) -> Bool:
    """Bool[P]: whether points [P, 3] on the object are what the camera sees along their rays."""
    towards = x - camera.position
    uv_px, _ = camera.project(x)
    inside = (uv_px >= 0).all(axis=1) & (uv_px < (camera.width, camera.height)).all(axis=1)
    hit = scene.first_hit(np.broadcast_to(camera.position, x.shape), towards)
    short = (1 - hit.t) * norm(towards)
    return np.asarray(inside & (hit.mesh >= 0) & (short < SAME_SURFACE * scene.radius))

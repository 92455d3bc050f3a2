# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Closed shapes of about unit radius, with smooth normals and injective UVs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import F64, unit
from ..surface import Mesh

SHAPES = ("sphere", "peanut", "blob", "knot", "plate")
MARGIN = 0.01
"""Rim of the UV square left empty, for filters."""


def shape(name: str, rows: int = 64) -> Mesh:
    """A shape by name, its grid ``rows`` high.

    ``sphere`` is the unit sphere; ``peanut`` a gently curved shape with a waist; ``blob`` two bumpy lobes
    with a waist, which shadow each other; ``knot`` a trefoil tube, which also hides itself; ``plate`` a round
    slab, a third as thick as wide and with rounded edges, on its edge. Normals are exact, not the facets'.
    """
    if name == "sphere":
        return _star(lambda d: np.ones(len(d)), rows)
    if name == "peanut":
        return _star(_peanut_radius, rows)
    if name == "blob":
        return _star(_blob_radius, rows)
    if name == "knot":
        return _knot(rows)
    if name == "plate":
        return _star(_plate_radius, rows)
    raise ValueError(f"no shape {name!r}; expected one of {', '.join(SHAPES)}")


def _peanut_radius(d: F64) -> F64:
    dent = np.sin(3 * d[:, 0] + 1) * np.sin(2.5 * d[:, 1] + 0.5) * np.sin(2 * d[:, 2] + 1)
    return np.asarray(0.55 + 0.42 * d[:, 0] ** 2 + 0.05 * dent, dtype=np.float64)


def _blob_radius(d: F64) -> F64:
    bumps = np.sin(7 * d[:, 0] + 1) * np.sin(6 * d[:, 1]) * np.sin(7 * d[:, 2] + 2)
    return np.asarray(0.38 + 0.55 * d[:, 0] ** 2 + 0.06 * bumps, dtype=np.float64)


def _plate_radius(d: F64) -> F64:
    """|x / 0.35|^4 + (y^2 + z^2)^2 = 1: flat faces look along x, away from the poles of the grid."""
    return np.asarray(((d[:, 0] / 0.35) ** 4 + (d[:, 1] ** 2 + d[:, 2] ** 2) ** 2) ** -0.25, dtype=np.float64)


def _star(radius: Callable[[F64], F64], rows: int) -> Mesh:
    """A star-shaped surface: a latitude-longitude grid of twice as many columns, a fan at each pole."""
    cols = 2 * rows
    row, col = np.meshgrid(np.arange(rows + 1), np.arange(cols + 1), indexing="ij")
    # A pole's vertices sit over the middle of their triangle.
    shift = np.where((row == 0) | (row == rows), 0.5, 0.0)
    u, v = (col + shift) / cols, 1 - row / rows
    theta, phi = np.pi * row / rows, 2 * np.pi * (col % cols + shift) / cols
    d = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    d = np.where(((row == 0) | (row == rows))[..., None], np.sign(np.cos(theta))[..., None] * [0, 0, 1], d)
    d = d.reshape(-1, 3)
    faces = []
    for j in range(rows):
        top, bottom = j * (cols + 1) + np.arange(cols), (j + 1) * (cols + 1) + np.arange(cols)
        if j > 0:
            faces.append(np.stack([top, bottom, top + 1], axis=-1))
        if j < rows - 1:
            # Under the upper pole the fan's vertices stand for both ends of the missing edge.
            faces.append(np.stack([top + 1 if j > 0 else top, bottom, bottom + 1], axis=-1))
    keep = np.concatenate(faces)
    return _used(
        d * radius(d)[:, None], keep, _star_normals(radius, d), np.stack([u.ravel(), v.ravel()], axis=-1)
    )


def _star_normals(radius: Callable[[F64], F64], d: F64) -> F64:
    """Gradient of |x| - radius(x / |x|) at the surface, by central differences."""
    x = d * radius(d)[:, None]

    def level(points: F64) -> F64:
        length = np.linalg.norm(points, axis=1)
        return np.asarray(length - radius(points / length[:, None]))

    step = 1e-5
    gradient = [level(x + step * axis) - level(x - step * axis) for axis in np.eye(3)]
    return unit(np.stack(gradient, axis=-1))


def _knot(rows: int) -> Mesh:
    """A trefoil (2, 3) torus knot's tube; u runs along it, v around it."""
    around, along = rows, 6 * rows
    i, j = np.meshgrid(np.arange(along + 1), np.arange(around + 1), indexing="ij")

    def centre(t: F64) -> F64:
        r = 0.55 + 0.22 * np.cos(3 * t)
        return np.stack([r * np.cos(2 * t), r * np.sin(2 * t), -0.32 * np.sin(3 * t)], axis=-1)

    t = 2 * np.pi * (np.arange(along + 1) % along) / along
    tangent = unit(centre(t + 1e-5) - centre(t - 1e-5))
    # A frame from the torus's own direction outward: it closes on itself after the last turn.
    hub = np.stack([0.55 * np.cos(2 * t), 0.55 * np.sin(2 * t), 0 * t], axis=-1)
    side = centre(t) - hub
    side = unit(side - np.einsum("tx,tx->t", side, tangent)[:, None] * tangent)
    other = np.cross(tangent, side)
    s = 2 * np.pi * (np.arange(around + 1) % around) / around
    normal = side[:, None] * np.cos(s)[:, None] + other[:, None] * np.sin(s)[:, None]
    vertices = centre(t)[:, None] + 0.16 * normal
    a = (i * (around + 1) + j)[:-1, :-1].ravel()
    right, up = a + around + 1, a + 1
    faces = np.concatenate([np.stack([a, right, up], axis=-1), np.stack([right, right + 1, up], axis=-1)])
    uv = np.stack([i / along, j / around], axis=-1)
    return _used(vertices.reshape(-1, 3), faces, normal.reshape(-1, 3), uv.reshape(-1, 2))


def _used(vertices: F64, faces: np.ndarray, normals: F64, uv: F64) -> Mesh:
    """Drop vertices that no face uses, shrink the UVs by the margin, and wind faces outward."""
    used, renumbered = np.unique(faces, return_inverse=True)
    faces = renumbered.reshape(-1, 3)
    vertices, normals, uv = vertices[used], normals[used], MARGIN + (1 - 2 * MARGIN) * uv[used]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inward = np.einsum("fx,fx->f", np.cross(b - a, c - a), normals[faces].sum(axis=1)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(vertices, faces.astype(np.int32), normals, uv)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A sphere's mesh, for objects that need no scan."""

from __future__ import annotations

import numpy as np

from swatchwork.errors import InputError
from swatchwork.surface.mesh import Mesh

ROWS = 128
"""Of faces from pole to pole. The corners of a face, `a` = pi / rows wide and high, lie on the sphere, and
its middle a^2 / 4 of the radius within it: 0.05 px of a radius of 350."""
MARGIN = 0.01
"""Rim of the UV square left empty, for filters."""


def sphere_mesh(radius: float, rows: int = ROWS) -> Mesh:
    """A sphere about the origin, poles along z, with exact normals and injective UVs.

    Args:
        radius: world units.
        rows: faces from pole to pole; twice as many go round.

    Raises:
        InputError: the radius is no length.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise InputError(f"the sphere's radius is {radius:g}", expected="a positive length")
    columns = 2 * rows
    row, column = np.meshgrid(np.arange(rows + 1), np.arange(columns + 1), indexing="ij")
    # A pole's vertices sit over the middle of their triangle.
    pole = (row == 0) | (row == rows)
    shift = np.where(pole, 0.5, 0.0)
    theta, phi = np.pi * row / rows, 2 * np.pi * (column % columns + shift) / columns
    width = np.where(pole, 0.0, np.sin(theta))
    normals = np.stack([width * np.cos(phi), width * np.sin(phi), np.cos(theta)], axis=-1).reshape(-1, 3)
    uv = np.stack([(column + shift) / columns, 1 - row / rows], axis=-1).reshape(-1, 2)
    top = (row * (columns + 1) + column)[:-1, :-1]
    below = top + columns + 1
    faces = np.concatenate(
        [
            np.stack([top, below, below + 1], axis=-1)[: rows - 1].reshape(-1, 3),
            np.stack([top, below + 1, top + 1], axis=-1)[1:].reshape(-1, 3),
        ]
    )
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    return Mesh(radius * normals[used], faces, normals[used], MARGIN + (1 - 2 * MARGIN) * uv[used])

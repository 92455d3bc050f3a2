# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Which texel centres lie in which triangle of the UV plane, by scanlines, without a loop over triangles."""

from __future__ import annotations

import numpy as np

from swatchwork.arrays import F64, I32, I64


def _spread(first: I64, count: I64) -> tuple[I64, I64]:
    """For each i, ``count[i]`` numbers from ``first[i]`` on: (i repeated, the numbers)."""
    owner = np.repeat(np.arange(len(count)), count)
    start = np.cumsum(count) - count
    return owner, first[owner] + np.arange(len(owner)) - start[owner]


def covered_centres(uv: F64, faces: I32, resolution: int) -> tuple[I64, I64, I64]:
    """Every (face, row, column) whose texel centre lies in the face; row 0 is v = 1.

    Spans are half open and edge crossings are computed alike from both sides, so that triangles which
    share an edge divide the centres between them: none is lost, none is counted twice. A centre that
    appears twice therefore means overlapping UVs. Texels outside [0, 1]^2 are left out.

    Args:
        uv: [V, 2]; faces: [F, 3]; resolution: texels along each side.
    """
    # In texel units, y downward, centres on integers.
    x = uv[:, 0] * resolution - 0.5
    y = (1 - uv[:, 1]) * resolution - 0.5
    cx, cy = x[faces], y[faces]
    first = np.clip(np.ceil(cy.min(axis=1)), 0, resolution).astype(np.int64)
    last = np.clip(np.ceil(cy.max(axis=1)), 0, resolution).astype(np.int64)
    face, row = _spread(first, last - first)

    # Intersect each scanline with the two edges that straddle it.
    left = np.full(len(face), np.inf)
    right = np.full(len(face), -np.inf)
    for i in range(3):
        xa, ya, xb, yb = cx[:, i], cy[:, i], cx[:, (i + 1) % 3], cy[:, (i + 1) % 3]
        swap = (ya > yb) | ((ya == yb) & (xa > xb))
        xa, xb = np.where(swap, xb, xa), np.where(swap, xa, xb)
        ya, yb = np.where(swap, yb, ya), np.where(swap, ya, yb)
        slope = (xb - xa) / np.where(yb > ya, yb - ya, 1.0)
        hit = (ya[face] <= row) & (row < yb[face])
        at = xa[face] + (row - ya[face]) * slope[face]
        left = np.where(hit, np.minimum(left, at), left)
        right = np.where(hit, np.maximum(right, at), right)

    begin = np.clip(np.ceil(left), 0, resolution)
    end = np.clip(np.ceil(right), 0, resolution)
    count = np.where(end > begin, end - begin, 0).astype(np.int64)
    line, column = _spread(np.where(count > 0, begin, 0).astype(np.int64), count)
    return face[line], row[line], column


def barycentric(uv: F64, corners: I32, at: F64) -> F64:
    """Barycentric coordinates [P, 3] of UV points [P, 2] in triangles of corners [P, 3], moved into them."""
    a, b, c = (uv.take(corners[:, i], axis=0) for i in range(3))
    (bx, by), (cx, cy), (px, py) = (b - a).T, (c - a).T, (at - a).T
    doubled = bx * cy - by * cx
    scale = 1 / np.where(doubled != 0, doubled, 1.0)
    second, third = (px * cy - py * cx) * scale, (bx * py - by * px) * scale
    result = np.clip(np.stack([1 - second - third, second, third], axis=1), 0, 1)
    return np.asarray(result / result.sum(axis=1, keepdims=True))

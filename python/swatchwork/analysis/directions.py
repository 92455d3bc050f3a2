# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Directional light, to hold natural light against (paper, Fig. 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F32, F64, I64
from ..octahedral import square_from_direction
from ..reflectance import GenericBasis
from ..surface import SkyMasks

LEAST = 0.03
"""Cosine below which a light, or a view, counts as below the horizon."""


@dataclass(frozen=True, eq=False)
class Directions:
    """One distant light of irradiance pi (on a surface that faces it) a view."""

    of_view: F64
    """[k, 3] unit directions to the light, world."""

    def responses(
        self, basis: GenericBasis, normal: F32, to_viewer: F64, view: I64, sky: SkyMasks, point: I64
    ) -> F32:
        """Responses [P, J]; 0 where the light is below the horizon or hidden."""
        i = self.of_view[view]
        found = directional_responses(basis, np.asarray(normal, np.float64), to_viewer, i)
        found[~_sees_sky(sky, point, i)] = 0
        return found.astype(np.float32)


def directional_responses(basis: GenericBasis, normal: F64, to_viewer: F64, to_light: F64) -> F64:
    """Responses [P, J] of the kernels to a light of irradiance pi (on a surface that faces it) a pair.

    Unit directions [P, 3], world; 0 where light or viewer is below the horizon (a cosine of LEAST).
    """
    cosine, seen = (np.einsum("px,px->p", normal, d) for d in (to_light, to_viewer))
    lit = np.flatnonzero((cosine > LEAST) & (seen > LEAST))
    found = np.zeros((len(normal), basis.kernels))
    local_i, local_o = in_local_frames(normal[lit], to_light[lit], to_viewer[lit])
    found[lit] = np.pi * cosine[lit, None] * basis.evaluate(local_i, local_o)
    return found


def _sees_sky(sky: SkyMasks, point: I64, direction: F64) -> np.ndarray:
    """Whether a point's mask is open in a direction [P]."""
    row = sky.of_texel[point]
    found = np.ones(len(point), bool)
    masked = np.flatnonzero(row >= 0)
    if len(masked):
        size = sky.words.shape[1]
        square = square_from_direction(direction[masked].astype(np.float32))
        column, line = np.minimum((square * size).astype(np.int64), size - 1).T
        bits = sky.words[row[masked], line] >> column.astype(np.uint64)
        found[masked] = (bits & np.uint64(1)).astype(bool)
    return found


def in_local_frames(n: F64, i: F64, o: F64) -> tuple[F64, F64]:
    """Directions [P, 3] in frames with the normal as z."""
    axis = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    x = np.cross(n, axis)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    frame = np.stack([x, np.cross(n, x), n], axis=1)
    return np.einsum("pab,pb->pa", frame, i), np.einsum("pab,pb->pa", frame, o)

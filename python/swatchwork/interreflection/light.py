# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Light that the object sends to itself, and what it adds to responses.

At each place it is a small environment, black where the sky is. The rendering operator's rings integrate any
BRDF over it, as over the sky, with fewer lookups: it has no detail finer than a cell. A response under both
is the sum of the two. So the material of a point is solved under all the light that reaches it; only what the
rest of the object sends there is taken from the material as it was known before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._native import Pyramid
from ..arrays import F32, I32, I64, Float
from ..response import Quadrature, log_rings
from ..surface import each_of
from .surroundings import SIDE, Surroundings

BLURRED = Quadrature(
    layers=(log_rings(0.01, 0.3, 6, 6), log_rings(0.01, 0.5, 8, 8), log_rings(0.03, 1.5, 8, 16)),
    bounds=(0.036, 0.125),
    bins=np.geomspace(0.006, 2.0, 60),
)
"""A tenth of the operator's lookups."""
RUNS_AT_ONCE = 32


@dataclass(frozen=True)
class IndirectLight:
    """Radiance that places receive from the object, under each of G lights."""

    around: Surroundings
    radiance: F32
    """[G, E, 3] of each cell, where the object hides it."""
    of_frame: I32
    """[k] light of each frame."""

    def under(self, frame: int) -> IndirectLight:
        """That of one frame alone, which is then frame 0."""
        light = int(self.of_frame[frame])
        return IndirectLight(self.around, self.radiance[light : light + 1], np.zeros(1, np.int32))

    def responses(
        self,
        frame: I32,
        texel: I32 | I64,
        normal: Float,
        to_viewer: Float,
        columns: int,
        respond: Callable[..., F32],
    ) -> F32:
        """What this light adds to the responses [P, columns, 3] of pairs.

        Args:
            frame: [P] of each pair; ``texel`` [P] says whose surroundings it shares.
            normal: [P, 3], and ``to_viewer``: unit, world.
            respond: of a pyramid, normals, viewers and ``quadrature``, as ``generic_responses`` takes them.
        """
        out = np.zeros((len(frame), columns, 3), np.float32)
        place = self.around.place_of[texel]
        lit = np.flatnonzero(place >= 0)
        key = self.of_frame[frame[lit]].astype(np.int64) * len(self.around) + place[lit]
        order = np.argsort(key, kind="stable")
        key, lit = key[order], lit[order]
        starts = np.flatnonzero(np.diff(key, prepend=-1))
        ends = np.append(starts[1:], len(key))
        n, o = (np.ascontiguousarray(v[lit], np.float32) for v in (normal, to_viewer))

        def fill(part: slice) -> None:
            for start, end in zip(starts[part], ends[part], strict=True):
                pyramid = self.environment(*divmod(int(key[start]), len(self.around)))
                run = slice(start, end)
                out[lit[run]] = respond(pyramid, n[run], o[run], quadrature=BLURRED)

        each_of(fill, len(starts), RUNS_AT_ONCE)
        return out

    def environment(self, light: int, place: int) -> Pyramid:
        """What a place receives from the object, as an environment in the world."""
        around = self.around
        cells = slice(around.offsets[place], around.offsets[place + 1])
        base = np.zeros((SIDE * SIDE, 3), np.float32)
        base[around.cell[cells]] = around.share[cells, None] * self.radiance[light, cells]
        return Pyramid(base.reshape(SIDE, SIDE, 3))

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Log-polar rings of half-vectors, over which a Beckmann lobe integrates in closed form (Eq. 9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F64, U32
from swatchwork.errors import InputError


@dataclass(frozen=True, eq=False)
class Rings:
    """A partition of the half-vectors about the normal by t = tan(angle to the normal).

    Args:
        edges: inner bounds between rings [R - 1], rising; the first ring is the disc inside
            ``edges[0]``, the last one reaches to infinity.
        azimuths: samples on each ring [R], even.

    Raises:
        InputError: where the shapes disagree, edges do not rise or azimuths are odd.
    """

    edges: F64
    azimuths: U32

    def __post_init__(self) -> None:
        rising = self.edges.size > 0 and self.edges[0] > 0 and bool((np.diff(self.edges) > 0).all())
        if not rising or self.azimuths.size != self.edges.size + 1:
            raise InputError("rings", expected="R - 1 rising positive edges and R azimuth counts")
        if (self.azimuths < 2).any() or (self.azimuths % 2).any():
            raise InputError(f"azimuths {self.azimuths}", expected="even numbers of at least 2")

    @property
    def tangents(self) -> F64:
        """Where each ring is sampled [R]: its geometric middle; disc and last ring near their edge."""
        inner, outer = self.edges[0] / np.sqrt(2.0), self.edges[-1] * np.sqrt(2.0)
        return np.concatenate([[inner], np.sqrt(self.edges[:-1] * self.edges[1:]), [outer]])

    @property
    def solid_angles(self) -> F64:
        """Half-vector solid angle of one sample of each ring [R], in steradians."""
        cosines = np.concatenate([[1.0], 1.0 / np.sqrt(1.0 + self.edges**2), [0.0]])
        return 2.0 * np.pi * -np.diff(cosines) / self.azimuths

    def weights(self, sigma: float) -> F64:
        """Probability [R] that a facet of Beckmann roughness ``sigma`` lies on each ring; sums to 1."""
        beyond = np.concatenate([[1.0], np.exp(-((self.edges / sigma) ** 2)), [0.0]])
        return -np.diff(beyond)


def log_rings(count: int, azimuths: int, innermost: float = 4e-4, outermost: float = 1.6) -> Rings:
    """``count`` rings with edges logarithmic between two tangents, all with as many azimuths."""
    edges = np.geomspace(innermost, outermost, count - 1)
    return Rings(edges, np.full(count, azimuths, np.uint32))


DEFAULT_RINGS = log_rings(64, 24)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Log-polar rings of half-vectors, over which a Beckmann lobe integrates in closed form (Eq. 9).

Three layers of rings serve three bands of roughness. Sharp lobes look up the whole environment.
Broader ones look up an environment without its brightest spots, which a few hundred lookups would
catch or miss, and sum over those spots as point lights; the broadest leave out weaker spots too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F64, I64
from swatchwork.errors import InputError


@dataclass(frozen=True, eq=False)
class Rings:
    """A partition of the half-vectors about the normal by t = tan(angle to the normal).

    Args:
        edges: inner bounds between rings [R - 1], rising; the first ring is the disc inside
            ``edges[0]``, the last one reaches to infinity.
        azimuths: samples on each ring [R], even.
        blur: area that a lookup is filtered over, in parts of the environment that a sample stands
            for, before rounding to half a level sharper on average.

    Raises:
        InputError: where the shapes disagree, edges do not rise or azimuths are odd.
    """

    edges: F64
    azimuths: I64
    blur: float = 1.0

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
        """Half-vector solid angle [R] of one sample of each ring, in steradians, times ``blur``."""
        cosines = np.concatenate([[1.0], 1.0 / np.sqrt(1.0 + self.edges**2), [0.0]])
        return 2.0 * np.pi * self.blur * -np.diff(cosines) / self.azimuths

    def weights(self, sigma: float) -> F64:
        """Probability [R] that a facet of Beckmann roughness ``sigma`` lies on each ring; sums to 1."""
        beyond = np.concatenate([[1.0], np.exp(-((self.edges / sigma) ** 2)), [0.0]])
        return -np.diff(beyond)


def log_rings(innermost: float, outermost: float, count: int, azimuths: int, *, blur: float = 1.0) -> Rings:
    """``count`` rings with edges logarithmic between two tangents, and ``azimuths`` on each."""
    return Rings(np.geomspace(innermost, outermost, count - 1), np.full(count, azimuths), blur)


def _sharp_rings() -> Rings:
    """Rings of the sharp band: few azimuths where rings are smaller than a texel, many in the tails,
    where a window among the spots that only broader bands leave out may show."""
    edges = np.geomspace(4e-4, 0.12, 33)
    return Rings(edges, np.append(np.where(edges < 0.006, 6, np.where(edges < 0.018, 20, 48)), 48))


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Rings for three bands of roughness, and bins for the light of point lights.

    Args:
        layers: rings of the sharp, the middle and the broad band.
        bounds: roughness from which the middle and the broad band begin.
        bins: tangents [Q] by which light from point lights is kept, a constant factor apart.
    """

    layers: tuple[Rings, Rings, Rings]
    bounds: tuple[float, float]
    bins: F64

    @property
    def tangents(self) -> F64:
        """Where the rings of all layers are sampled [R]."""
        return np.concatenate([rings.tangents for rings in self.layers])

    @property
    def solid_angles(self) -> F64:
        """What their lookups are filtered over [R], in steradians of half-vectors."""
        return np.concatenate([rings.solid_angles for rings in self.layers])

    @property
    def azimuths(self) -> I64:
        """Samples on the rings of all layers [R]."""
        return np.concatenate([rings.azimuths for rings in self.layers])

    @property
    def layer(self) -> I64:
        """Layer of each ring [R]."""
        return np.repeat(np.arange(3), [rings.azimuths.size for rings in self.layers])

    @property
    def lookups(self) -> int:
        """Environment lookups a pair."""
        return int(self.azimuths.sum())

    def weights(self, sigma: float) -> F64:
        """Weights [R + 2 Q] of one roughness: over its layer's rings, and D (Eq. 9) at the bins of the
        strong and of the weak lights, where its layer leaves them out."""
        band = int(sigma >= self.bounds[0]) + int(sigma >= self.bounds[1])
        rings = [
            r.weights(sigma) if k == band else np.zeros(r.azimuths.size) for k, r in enumerate(self.layers)
        ]
        cosine2 = 1.0 / (1.0 + self.bins**2)
        density = np.exp(-((self.bins / sigma) ** 2)) / (np.pi * sigma**2 * cosine2**2)
        lights = [density * (band > k) for k in range(2)]
        return np.concatenate(rings + lights)


DEFAULT_QUADRATURE = Quadrature(
    layers=(
        _sharp_rings(),
        log_rings(0.007, 0.32, 22, 40),
        log_rings(0.025, 1.5, 20, 48, blur=3.0),
    ),
    bounds=(0.036, 0.125),
    bins=np.geomspace(0.006, 2.0, 60),
)
"""Few lookups that keep every kernel within 1.5 %, and those of sigma below 0.1 within 0.7 %, of brute force
under real probes, at 1200 pairs (scripts/measure/forward_model.py)."""

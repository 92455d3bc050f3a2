# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A sphere of known material at the level of surface points, without images: the paper's synthetic object.

Its materials are any: weights of a generic basis, or measured reflectances. What a method sees of it is a
`SphereCapture`; how well the method did is told by the same points under other light, from other views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from ..arrays import F32, F64, I32, I64, Float, unit
from ..light import Environment
from ..reflectance import GenericBasis
from ..response import generic_responses, representative_responses
from .measured import MeasuredBrdf
from .problem import Pairs, visible_pairs
from .quadrature import measured_responses


class Materials(Protocol):
    """N materials that can be lit."""

    def responses(self, light: Environment, normal: F64, to_viewer: F64) -> F64:
        """Radiance [P, N, 3] of each at points with unit normals [P, 3] from directions [P, 3]."""


@dataclass(frozen=True)
class KernelMaterials:
    """Materials within a generic basis."""

    basis: GenericBasis
    representatives: F64
    """[N, J, 3]"""

    def responses(self, light: Environment, normal: F64, to_viewer: F64) -> F64:
        found = representative_responses(self.basis, self.representatives, light.pyramid(), normal, to_viewer)
        return found.astype(np.float64)


@dataclass(frozen=True)
class MeasuredMaterials:
    """Materials without parameters."""

    brdfs: Sequence[MeasuredBrdf]
    tables: dict[int, F32] = field(default_factory=dict, repr=False)
    """What was tabulated of them."""

    def responses(self, light: Environment, normal: F64, to_viewer: F64) -> F64:
        return measured_responses(self.brdfs, light, normal, to_viewer, self.tables)


@dataclass(frozen=True, eq=False)
class Sphere:
    """The unit sphere, with a blend of materials at every point."""

    materials: Materials
    normal: F64
    """[M, 3] unit normals, which are the positions too."""
    weights: F64
    """[M, N] blend weights of the truth."""

    def radiance(self, light: Environment, pairs: Pairs) -> F64:
        """What the pairs' viewers see [P, 3]."""
        found = self.materials.responses(
            light, pairs.normal.astype(np.float64), pairs.to_viewer.astype(np.float64)
        )
        return np.asarray(np.einsum("pn,pnc->pc", self.weights[pairs.texel], found, optimize=True))

    def captured(
        self, light: Environment, views: F64, basis: GenericBasis, noise_percent: float = 0.0, seed: int = 0
    ) -> SphereCapture:
        """Measurements from views [k, 3]; each is multiplied by 1 + p / 100 N(0, 1)."""
        pairs = visible_pairs(self.normal, views)
        rng = np.random.default_rng([seed, 4])
        radiance = self.radiance(light, pairs)
        radiance = radiance * (1 + noise_percent / 100 * rng.normal(size=radiance.shape))
        return SphereCapture(basis, light, self.normal, pairs, radiance.astype(np.float32))


@dataclass(frozen=True, eq=False)
class SphereCapture:
    """What is known of a sphere: normals, light, and the measurements of all visible pairs."""

    basis: GenericBasis
    """The basis that a method may use."""
    light: Environment
    normal: F64
    """[M, 3]"""
    pairs: Pairs
    radiance: F32
    """[P, 3]"""

    @property
    def views(self) -> int:
        """k, up to the last that sees any of it."""
        return int(self.pairs.view.max()) + 1

    @cached_property
    def seen(self) -> I64:
        """Texels that some view sees."""
        return np.flatnonzero(np.diff(self.pairs.offsets) > 0)

    @property
    def offsets(self) -> I64:
        """[len(seen) + 1]: the pairs of each seen texel."""
        return np.concatenate([[0], np.cumsum(np.diff(self.pairs.offsets)[self.seen])])

    @cached_property
    def responses(self) -> F32:
        """[P, J, 3] generic responses (Eq. 13)."""
        return generic_responses(self.basis, self.light.pyramid(), self.pairs.normal, self.pairs.to_viewer)

    @cached_property
    def nearest_seen(self) -> I32:
        """[M]: for each texel, the place in ``seen`` of the nearest seen one."""
        from scipy.spatial import cKDTree

        return np.asarray(cKDTree(self.normal[self.seen]).query(self.normal)[1], dtype=np.int32)


def nrms(a: F64, b: F64, normal: Float, to_viewer: Float) -> float:
    """NRMS of radiance [P, 3] against a reference, each pair by the pixels it covers: by n.o."""
    cosine = np.einsum("px,px->p", unit(normal), unit(to_viewer))[:, None]
    return float(np.sqrt((cosine * (a - b) ** 2).sum() / (cosine * b**2).sum()))

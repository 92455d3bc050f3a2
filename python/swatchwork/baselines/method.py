# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What every method is given and what it returns: the same for ours and for those it is compared with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from ..arrays import F32, F64, I64
from ..reflectance import GenericBasis
from ..solve import Problem
from ..streaming import VIEWED


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measurements at M texels and what each generic kernel would have given there."""

    basis: GenericBasis
    responses: F32
    """[P, J, 3] generic responses (Eq. 13)."""
    radiance: F32
    """[P, 3] measured radiance."""
    offsets: I64
    """[M + 1]: the pairs of texel x are offsets[x] to offsets[x + 1]; every texel has some."""

    @cached_property
    def problem(self) -> Problem:
        """The data of Eq. 5; its ``gamma`` [M] weights squared errors as relative ones."""
        albedo = np.stack([self.basis.albedo(n_o) for n_o in VIEWED])
        return Problem(self.responses, self.radiance, self.offsets, albedo=albedo)

    @property
    def texels(self) -> int:
        """M"""
        return len(self.offsets) - 1

    @cached_property
    def texel(self) -> I64:
        """[P] texel of each pair."""
        return np.repeat(np.arange(self.texels), np.diff(self.offsets))


@dataclass(frozen=True, eq=False)
class Recovered:
    """The reflectance of M texels: sum over N of weights times representatives, in a generic basis."""

    basis: GenericBasis
    representatives: F64
    """[N, J, 3]"""
    weights: F64
    """[M, N]; whether they are convex or sparse is the method's."""
    materials: int
    """How many materials the method says there are."""
    status: str
    found: Mapping[str, float] = field(default_factory=dict)
    """What else it found, by name."""


class Method(Protocol):
    """A way from measurements to reflectance."""

    @property
    def name(self) -> str:
        """In tables."""
        ...

    def recover(self, measurements: Measurements) -> Recovered:
        """The reflectance of every texel."""


def single_kernels(kernels: int) -> F64:
    """[3 J, J, 3]: a representative for each kernel in each channel, kernel by kernel."""
    found = np.zeros((kernels, 3, kernels, 3))
    for j in range(kernels):
        for c in range(3):
            found[j, c, j, c] = 1.0
    return found.reshape(3 * kernels, kernels, 3)

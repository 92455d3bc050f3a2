# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A recovered material: N representatives, and at every texel of the atlas a blend of n of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from ..arrays import F32, F64, I32, U8, U32, Bool
from ..errors import InputError
from .trust import ErrorModel

MOST_WEIGHT = 1e20
"""Of a kernel in a representative; beyond, its responses would leave 32 bits."""

MOST_SIGMA, MOST_POWER = 100.0, 100
"""Of a basis; what is used ends at a sigma of 1 and the power 5."""

WEIGHT_SUM_TOLERANCE = 1e-4
"""Weights are f32 and sum to 1 up to rounding (n times 6e-8); what is off by more was not a blend."""


@dataclass(frozen=True)
class BasisRecord:
    """The generic basis as plain values, with the names and meaning of `reflectance.GenericBasis`.

    Along J: for each masking, for each Fresnel exponent, for each sigma; then the diffuse kernels.
    """

    name: str
    sigmas: tuple[float, ...]
    maskings: tuple[str, ...]
    diffuse: tuple[str, ...]
    fresnel: tuple[int, ...] = (5, 0)
    """Exponents of the Fresnel terms (1 - o.h)^p."""

    @property
    def lobes(self) -> list[tuple[str, int, float]]:
        """Masking, Fresnel exponent and sigma of each specular kernel."""
        return [
            (masking, power, sigma)
            for masking in self.maskings
            for power in self.fresnel
            for sigma in self.sigmas
        ]

    @property
    def kernels(self) -> int:
        """J."""
        return len(self.maskings) * len(self.fresnel) * len(self.sigmas) + len(self.diffuse)


@dataclass(frozen=True, eq=False)
class Material:
    """An SVBRDF on a mesh.

    ``index`` and ``weight`` hold the blend of each atlas pixel, row 0 at v = 1. ``coverage`` is the number of
    views that saw a texel: 0 where none did (its blend is filled in from neighbours), -1 off the atlas.
    """

    basis: BasisRecord
    representatives: F64  # [N, J, 3]
    index: U8 | U32  # [H, W, n]
    weight: F32  # [H, W, n], sums to 1 on the atlas
    coverage: I32  # [H, W]
    residual: F32  # [H, W], |s_hat - s| / |s_hat|; NaN where not measured
    vertices: F64  # [V, 3]
    faces: I32  # [F, 3]
    normals: F64  # [V, 3], unit
    uv: F64  # [V, 2], v upward
    penalties: Mapping[str, float] = field(default_factory=dict)
    solver: Mapping[str, Any] = field(default_factory=dict)
    """Status, history and options of the solver, as JSON holds them."""
    trust: ErrorModel | None = None
    """What error to expect of a texel; None where no texel had two views to learn it from."""
    spread: F64 | None = None
    """[N] relative standard deviation of each representative's response, from the noise of the measurements:
    the others, and the blends, taken as known. None where nobody said."""
    inputs: Mapping[str, Any] = field(default_factory=dict)
    """Fingerprints of what the material was made from."""

    @property
    def n(self) -> int:
        """Representatives blended at a texel."""
        return int(self.index.shape[-1])

    @property
    def N(self) -> int:
        """Representatives of the object."""
        return int(self.representatives.shape[0])

    @property
    def on_atlas(self) -> Bool:
        """Bool[H, W]: pixels that are texels of the surface."""
        return self.coverage >= 0

    @property
    def shares(self) -> F64:
        """Share [N] of the surface's blend weight that each representative carries."""
        carried = np.zeros(self.N)
        for here, index, weight in zip(self.on_atlas, self.index, self.weight, strict=True):
            carried += np.bincount(index[here].ravel(), weight[here].ravel(), minlength=self.N)
        return carried / max(float(carried.sum()), 1e-30)

    def check(self, file: str | PathLike[str] | None = None) -> None:
        """Raise InputError, naming ``file``, where the parts disagree or break a constraint of Eq. 3 or 7."""
        _check_shapes(self, file)
        _check_numbers(self, file)
        sound = (self.representatives >= 0) & (self.representatives <= MOST_WEIGHT)
        if not sound.all():
            raise InputError(
                f"a representative has the weight {self.representatives[~sound][0]:g}",
                file=file,
                expected=f"0 to {MOST_WEIGHT:g}",
            )
        for row, (here, index, weight) in enumerate(zip(self.on_atlas, self.index, self.weight, strict=True)):
            # Off the atlas the blend is padding for filters, or nothing at all; still it must name something.
            if (index >= self.N).any():
                raise InputError(
                    f"blend index {int(index.max())}",
                    file=file,
                    expected=f"0 to {self.N - 1}, there are N={self.N}",
                )
            sums = weight.sum(axis=-1, dtype=np.float64)
            if not np.isfinite(sums[here]).all() or (weight[here] < -WEIGHT_SUM_TOLERANCE).any():
                raise InputError(
                    "a blend weight is negative or not finite", file=file, expected="weights in [0, 1]"
                )
            off = np.where(here, np.abs(sums - 1), 0)
            if off.max() > WEIGHT_SUM_TOLERANCE:
                column = int(off.argmax())
                raise InputError(
                    f"the blend weights at row {row}, column {column} sum to {sums[column]:.6g}",
                    file=file,
                    expected="1",
                )


def _check_numbers(m: Material, file: str | PathLike[str] | None) -> None:
    for name in ("vertices", "normals", "uv"):
        values = getattr(m, name)
        if not np.isfinite(values).all():
            raise InputError(f"{name} holds NaN or infinity", file=file, expected="finite numbers")
    if m.spread is not None and not (np.isfinite(m.spread).all() and (m.spread >= 0).all()):
        raise InputError("spread is negative or not finite", file=file, expected="0 or more")
    basis = m.basis
    if not basis.sigmas or not all(0 < sigma <= MOST_SIGMA for sigma in basis.sigmas):
        raise InputError(
            f"sigmas {basis.sigmas[:3]}", file=file, expected=f"roughnesses up to {MOST_SIGMA:g}"
        )
    if not all(0 <= power <= MOST_POWER for power in basis.fresnel):
        raise InputError(f"fresnel {basis.fresnel[:3]}", file=file, expected=f"exponents up to {MOST_POWER}")


def _check_shapes(m: Material, file: str | PathLike[str] | None) -> None:
    height, width, n = m.index.shape
    expected = {
        "representatives": (m.N, m.basis.kernels, 3),
        "weight": (height, width, n),
        "coverage": (height, width),
        "residual": (height, width),
        "normals": m.vertices.shape,
        "uv": (len(m.vertices), 2),
    }
    if m.spread is not None:
        expected["spread"] = (m.N,)
    for name, shape in expected.items():
        if getattr(m, name).shape != shape:
            raise InputError(f"{name} has shape {getattr(m, name).shape}", file=file, expected=str(shape))
    if len(m.faces) == 0 or m.faces.min() < 0 or m.faces.max() >= len(m.vertices):
        raise InputError(
            "the mesh has no faces, or one that names no vertex", file=file, expected="triangles"
        )

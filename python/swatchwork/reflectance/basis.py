# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Sets of generic kernels, as a seam: ``paper`` (section 4) and ``extended`` (grazing angles)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple, Protocol

import numpy as np

from swatchwork.arrays import F64, Float
from swatchwork.errors import InputError
from swatchwork.reflectance.microfacets import (
    beckmann,
    diffuse_value,
    masking_value,
    smith_alpha,
)

DIFFUSE_KERNELS: dict[str, tuple[tuple[str, str], ...]] = {
    "lambert": (("one", "one"),),
    "half": (("half", "half"),),
    "grazing5": (("fifth", "one"), ("one", "fifth")),
    "grazing10": (("tenth", "one"), ("one", "tenth")),
    "shade": (("shade", "shade"),),
}
"""Diffuse kernels by name: pi times the BRDF is the sum over the pairs (a, b) of a(n.i) b(n.o), with
shapes a and b of DIFFUSE_SHAPES. All are reciprocal. ``half`` is the diffuse term of Ashikhmin and Shirley
(2000)."""


class Lobe(NamedTuple):
    """One specular kernel: its masking term, the exponent of its Fresnel term and its roughness sigma."""

    masking: str
    power: int
    sigma: float


def _paper_sigmas() -> F64:
    """35 roughnesses, logarithmic in [0.001, 0.5]."""
    return np.geomspace(0.001, 0.5, 35)


class Record(Protocol):
    """A basis as plain values, named as in `GenericBasis`."""

    @property
    def name(self) -> str: ...
    @property
    def sigmas(self) -> tuple[float, ...]: ...
    @property
    def maskings(self) -> tuple[str, ...]: ...
    @property
    def diffuse(self) -> tuple[str, ...]: ...
    @property
    def fresnel(self) -> tuple[int, ...]: ...


@dataclass(frozen=True, eq=False)
class GenericBasis:
    """Generic BRDFs of one colour channel, the same for each.

    Kernels are ordered by masking, then Fresnel power, then sigma; diffuse kernels come last.

    Args:
        name: ``paper``, ``extended``, or a custom set's own name.
        sigmas: Beckmann roughnesses (Eq. 9).
        maskings: shadowing and masking terms, ``vgroove`` (Eq. 10) or ``smith:ALPHA``.
        diffuse: names of DIFFUSE_KERNELS.
        fresnel: exponents p of the Fresnel terms (1 - o.h)^p; 5 and 0 are Eq. 11 at tau = 0 and 1.

    Raises:
        InputError: on unknown names, or roughnesses that are not positive.
    """

    name: str
    sigmas: F64 = field(default_factory=_paper_sigmas)
    maskings: tuple[str, ...] = ("vgroove",)
    diffuse: tuple[str, ...] = ("lambert",)
    fresnel: tuple[int, ...] = (5, 0)

    @classmethod
    def of(cls, record: Record) -> GenericBasis:
        """The basis that plain values stand for, such as a material's."""
        return cls(record.name, np.array(record.sigmas), record.maskings, record.diffuse, record.fresnel)

    def __post_init__(self) -> None:
        for masking in self.maskings:
            if masking != "vgroove":
                smith_alpha(masking)
        for kernel in self.diffuse:
            if kernel not in DIFFUSE_KERNELS:
                raise InputError(f"diffuse kernel {kernel!r}", expected=f"one of {sorted(DIFFUSE_KERNELS)}")
        if not (np.isfinite(self.sigmas).all() and (self.sigmas > 0).all()):
            raise InputError(f"roughnesses {self.sigmas}", expected="finite values above 0")
        if len(set(self.fresnel)) != len(self.fresnel) or not all(0 <= p <= 9 for p in self.fresnel):
            raise InputError(f"Fresnel exponents {self.fresnel}", expected="different whole numbers, 0 to 9")

    @cached_property
    def lobes(self) -> tuple[Lobe, ...]:
        """The specular kernels, in order."""
        return tuple(
            Lobe(masking, power, float(sigma))
            for masking in self.maskings
            for power in self.fresnel
            for sigma in self.sigmas
        )

    @property
    def kernels(self) -> int:
        """Number of kernels a channel, J."""
        return len(self.lobes) + len(self.diffuse)

    def albedo(self, n_o: float) -> F64:
        """Directional albedo [J] of each kernel, for a viewer at the given cosine to the normal.

        Specular kernels by 64 x 64 half-vectors at the quantiles of their own distribution (Eq. 9), so that
        the sharpest is as well sampled as the widest; diffuse ones, which know no azimuth, by 64 cosines.
        """
        quantile = (np.arange(64) + 0.5) / 64
        phi = 2 * np.pi * quantile
        o = np.array([np.sqrt(1 - n_o**2), 0.0, n_o])
        found = np.empty(self.kernels)
        of_sigma: dict[float, list[int]] = {}
        for j, lobe in enumerate(self.lobes):
            of_sigma.setdefault(lobe.sigma, []).append(j)
        for sigma, kernels in of_sigma.items():
            t = sigma * np.sqrt(-np.log1p(-quantile))[:, None]
            n_h = 1 / np.sqrt(1 + t * t)
            h = np.stack(np.broadcast_arrays(t * n_h * np.cos(phi), t * n_h * np.sin(phi), n_h), axis=-1)
            o_h = h @ o
            n_i = 2 * o_h * h[..., 2] - n_o
            lit = (o_h > 0) & (n_i > 0)
            o_h, n_i, n_h = np.where(lit, o_h, 1), np.where(lit, n_i, 1), h[..., 2]
            for j in kernels:
                lobe = self.lobes[j]
                g = masking_value(lobe.masking, n_i, o[2:], o_h, n_h)
                value = g * (1 - np.minimum(o_h, 1)) ** lobe.power * o_h / (n_o * n_h)
                found[j] = np.where(lit, value, 0).mean()
        # Uniform over the projected hemisphere: the cosine and pi cancel.
        for j, name in enumerate(self.diffuse, len(self.lobes)):
            found[j] = np.pi * diffuse_value(DIFFUSE_KERNELS[name], np.sqrt(quantile), o[2:]).mean()
        return found

    def evaluate(self, i_in_local: Float, o_in_local: Float, kernels: Sequence[int] | None = None) -> F64:
        """BRDF values of all kernels (Eqs. 8 to 11, with F of o.h), the slow twin of the operator.

        Args:
            i_in_local: unit directions to the light [..., 3], normal (0, 0, 1).
            o_in_local: unit directions to the viewer [..., 3]; broadcasts with the former.
            kernels: which kernels to evaluate, in which order; all J by default.

        Returns:
            Values [..., J] per steradian; 0 where either direction is not above the surface.
        """
        i, o = np.broadcast_arrays(np.asarray(i_in_local, np.float64), np.asarray(o_in_local, np.float64))
        n_i, n_o = i[..., 2], o[..., 2]
        lit = (n_i > 0) & (n_o > 0)
        n_i, n_o = np.where(lit, n_i, 1.0), np.where(lit, n_o, 1.0)
        h = i + o
        h = h / np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), 1e-12)
        n_h, o_h = h[..., 2], np.sum(o * h, axis=-1)
        shadowed = {m: masking_value(m, n_i, n_o, o_h, n_h) / (4.0 * n_i * n_o) for m in self.maskings}
        fresnel = {power: (1.0 - np.clip(o_h, 0.0, 1.0)) ** power for power in self.fresnel}
        distribution = cache(lambda sigma: beckmann(n_h, sigma))
        chosen = range(self.kernels) if kernels is None else kernels
        values = np.empty((*n_i.shape, len(chosen)))
        for k, j in enumerate(chosen):
            if j < len(self.lobes):
                masking, power, sigma = self.lobes[j]
                values[..., k] = distribution(sigma) * shadowed[masking] * fresnel[power]
            else:
                name = self.diffuse[j - len(self.lobes)]
                values[..., k] = diffuse_value(DIFFUSE_KERNELS[name], n_i, n_o)
        return np.where(lit[..., None], values, 0.0)


@cache
def paper() -> GenericBasis:
    """The published basis: 35 roughnesses by two Fresnel terms with V-groove masking, and Lambert."""
    return GenericBasis("paper")


@cache
def extended() -> GenericBasis:
    """What measured materials need at grazing angles, found by measurement (docs/basis.md).

    Every third of the published roughnesses, two Smith maskings of fixed alpha, a Fresnel term between
    Schlick's two, and four more diffuse shapes. It does not contain ``paper``.
    """
    return GenericBasis(
        "extended",
        sigmas=_paper_sigmas()[::3],
        maskings=("smith:0.2", "smith:1"),
        diffuse=("lambert", "half", "grazing5", "grazing10", "shade"),
        fresnel=(5, 2, 0),
    )


def basis_by_name(name: str) -> GenericBasis:
    """The basis called ``name``.

    Raises:
        InputError: where there is none.
    """
    known = {"paper": paper, "extended": extended}
    if name not in known:
        raise InputError(f"basis {name!r}", expected=f"one of {', '.join(known)}")
    return known[name]()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Sets of generic kernels, as a seam: ``paper`` (section 4) and ``extended`` (grazing angles)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from swatchwork.arrays import F64, Float
from swatchwork.errors import InputError
from swatchwork.reflectance.microfacets import (
    beckmann,
    diffuse_value,
    masking_value,
    schlick,
    smith_alpha,
)

DIFFUSE_KERNELS: dict[str, tuple[float, float, float, float]] = {
    "lambert": (1, 0, 0, 0),
    "lambert_1mf": (1, -1, 0, 0),
    "lambert_f": (0, 1, 0, 0),
    "grazing_1mf": (0, 0, 1, -1),
    "grazing_f": (0, 0, 0, 1),
    "matte_1mf": (1, -1, -1, 1),
    "matte_f": (0, 1, 0, -1),
}
"""Diffuse kernels by name: pi times the BRDF is a + b f_o + c f_i + d f_i f_o, with f_v = (1 - n.v)^5."""


class Lobe(NamedTuple):
    """One specular kernel: its masking term, Fresnel tau and roughness sigma."""

    masking: str
    tau: int
    sigma: float


def _paper_sigmas() -> F64:
    """35 roughnesses, logarithmic in [0.001, 0.5]."""
    return np.geomspace(0.001, 0.5, 35)


@dataclass(frozen=True, eq=False)
class GenericBasis:
    """Generic BRDFs of one colour channel, the same for each.

    Kernels are ordered by masking, then tau (0, 1), then sigma; diffuse kernels come last.

    Args:
        name: ``paper``, ``extended``, or a custom set's own name.
        sigmas: Beckmann roughnesses (Eq. 9).
        maskings: shadowing and masking terms, ``vgroove`` (Eq. 10) or ``smith:ALPHA``.
        diffuse: names of DIFFUSE_KERNELS.
        sigmas_of: roughnesses of single maskings that differ from ``sigmas``.

    Raises:
        InputError: on unknown names, or roughnesses that are not positive.
    """

    name: str
    sigmas: F64 = field(default_factory=_paper_sigmas)
    maskings: tuple[str, ...] = ("vgroove",)
    diffuse: tuple[str, ...] = ("lambert",)
    sigmas_of: dict[str, F64] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for masking in self.maskings:
            if masking != "vgroove":
                smith_alpha(masking)
        for kernel in self.diffuse:
            if kernel not in DIFFUSE_KERNELS:
                raise InputError(f"diffuse kernel {kernel!r}", expected=f"one of {sorted(DIFFUSE_KERNELS)}")
        for masking in self.maskings:
            sigmas = self.sigmas_for(masking)
            if not (np.isfinite(sigmas).all() and (sigmas > 0).all()):
                raise InputError(f"roughnesses of {masking!r}: {sigmas}", expected="finite values above 0")

    def sigmas_for(self, masking: str) -> F64:
        """Roughnesses that kernels with this masking come in."""
        return np.asarray(self.sigmas_of.get(masking, self.sigmas), np.float64)

    @cached_property
    def lobes(self) -> tuple[Lobe, ...]:
        """The specular kernels, in order."""
        return tuple(
            Lobe(masking, tau, float(sigma))
            for masking in self.maskings
            for tau in (0, 1)
            for sigma in self.sigmas_for(masking)
        )

    @property
    def kernels(self) -> int:
        """Number of kernels a channel, J."""
        return len(self.lobes) + len(self.diffuse)

    def evaluate(
        self, i_in_local: Float, o_in_local: Float, kernels: Sequence[int] | None = None
    ) -> F64:
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
        fresnel = [schlick(o_h, tau) for tau in (0, 1)]
        distribution = cache(lambda sigma: beckmann(n_h, sigma))
        chosen = range(self.kernels) if kernels is None else kernels
        values = np.empty((*n_i.shape, len(chosen)))
        for k, j in enumerate(chosen):
            if j < len(self.lobes):
                masking, tau, sigma = self.lobes[j]
                values[..., k] = distribution(sigma) * shadowed[masking] * fresnel[tau]
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
    """The published basis, Smith masking of one fixed alpha, and a view-dependent diffuse pair."""
    return GenericBasis("extended", maskings=("vgroove", "smith:0.5"), diffuse=("lambert_1mf", "lambert_f"))


def basis_by_name(name: str) -> GenericBasis:
    """The basis called ``name``.

    Raises:
        InputError: where there is none.
    """
    known = {"paper": paper, "extended": extended}
    if name not in known:
        raise InputError(f"basis {name!r}", expected=f"one of {', '.join(known)}")
    return known[name]()

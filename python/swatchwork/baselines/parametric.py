# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Single-lobe parametric fits: to a whole measured reflectance (Ngan et al. 2005), or to a texel's pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np

from ..arrays import F64, Float
from ..reflectance import GenericBasis
from .lobes import single_lobe
from .method import Measurements, Recovered

STEEPEST_RAD = np.deg2rad(80.0)
"""Directions further from the normal are left out, as Ngan et al. do: measurements there are not reliable."""
SAMPLES = (60, 30, 12)
"""Of theta_h (by its square root, as MERL tables), theta_d and phi_d."""


class Reflectance(Protocol):
    """Anything with a BRDF."""

    def evaluate(self, i_in_local: Float, o_in_local: Float) -> F64:
        """Values [..., 3] per steradian."""


@cache
def single_lobe_basis() -> GenericBasis:
    """Cook-Torrance lobes of 90 roughnesses from 0.003 to 1 (steps of 7 %), and a Lambertian."""
    return GenericBasis("single-lobe", sigmas=np.geomspace(0.003, 1.0, 90))


def fit_reflectance(brdf: Reflectance) -> F64:
    """The single lobe nearest to a reflectance, a representative [J, 3] of ``single_lobe_basis``.

    The distance is Ngan et al.'s: squared differences of f cos_i over all pairs of directions up to 80
    degrees, by their solid angles, here over half and difference angles as MERL tables are sampled.
    """
    i, o, weight = _directions()
    values = brdf.evaluate(i, o) * i[:, 2:]
    kernels = single_lobe_basis().evaluate(i, o) * i[:, 2:]
    return single_lobe(single_lobe_basis(), kernels[..., None], values, weight)


@cache
def _directions() -> tuple[F64, F64, F64]:
    """Pairs of directions [R, 3] in the local frame, and the solid angles they stand for [R]."""
    rows, columns, turns = SAMPLES
    edge = (np.arange(rows + 1) / rows) ** 2 * (np.pi / 2)
    theta_h, width = (edge[1:] + edge[:-1]) / 2, np.diff(edge)
    theta_d = (np.arange(columns) + 0.5) / columns * (np.pi / 2)
    phi_d = (np.arange(turns) + 0.5) / turns * np.pi
    th, td, pd = (a.ravel() for a in np.meshgrid(theta_h, theta_d, phi_d, indexing="ij"))
    d = np.stack([np.sin(td) * np.cos(pd), np.sin(td) * np.sin(pd), np.cos(td)], axis=-1)
    # d is the light as seen from h: turned about y by theta_h, it is in the surface's frame.
    c, s = np.cos(th), np.sin(th)
    i = np.stack([c * d[:, 0] + s * d[:, 2], d[:, 1], c * d[:, 2] - s * d[:, 0]], axis=-1)
    h = np.stack([s, np.zeros_like(s), c], axis=-1)
    o = 2 * d[:, 2:] * h - i
    # d omega_i d omega_o = 4 cos(theta_d) d omega_h d omega_d.
    weight = 4 * np.cos(td) * np.sin(td) * np.sin(th) * np.repeat(width, columns * turns)
    kept = np.minimum(i[:, 2], o[:, 2]) > np.cos(STEEPEST_RAD)
    return i[kept], o[kept], weight[kept]


@dataclass(frozen=True)
class PerTexelLobe:
    """A single lobe of its own for each texel."""

    name: str = "single lobe a texel"

    def recover(self, measurements: Measurements) -> Recovered:
        m = measurements
        found = np.empty((m.texels, m.basis.kernels, 3))
        for x in range(m.texels):
            pairs = slice(m.offsets[x], m.offsets[x + 1])
            weight = np.ones(m.offsets[x + 1] - m.offsets[x])
            found[x] = single_lobe(m.basis, m.responses[pairs], m.radiance[pairs], weight)
        return Recovered(m.basis, found, np.eye(m.texels), m.texels, "converged")

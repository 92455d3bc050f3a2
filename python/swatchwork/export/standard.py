# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The metallic-roughness model of glTF 2.0 (appendix B) with KHR_materials_specular and KHR_materials_ior.

With s = (1 - o.h)^5, alpha = roughness^2, GGX's D and separable Smith G as the appendix has them:

    metal      = D V (c + (1 - c) s)
    dielectric = (1 - w max_c(F)) c / pi + w F D V,    F = f0 + (1 - f0) s
    f          = metallic * metal + (1 - metallic) * dielectric

where c is the base colour, w the specular factor, f0 = min(((ior - 1) / (ior + 1))^2 * specular colour, 1).
Rendered, it is linear in four integrals over the light: of the cosine, of s times it, and of the lobe
without and with s. They depend on roughness alone, so a table of them serves every material.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F64, Bool, Float, dot, unit
from ..light import Environment
from ..octahedral import pixel_directions
from ..reflectance import GenericBasis
from ..response import representative_responses
from ..simulate import ggx_mixture

IOR = 1.5
F0 = ((IOR - 1) / (IOR + 1)) ** 2
"""Reflectance at normal incidence of a dielectric whose specular colour is white: 0.04."""
CELLS = 64
"""Along the octahedral square over which diffuse light is summed."""
LEVELS = np.geomspace(0.001, 1.0, 49)
"""GGX alphas of the tables, 15 % apart: roughness, their root, is resolved to 4 %."""


@dataclass(frozen=True, eq=False)
class Standard:
    """Parameters of T surfaces; colours are linear."""

    base_colour: F64  # [T, 3]
    metallic: F64  # [T]
    roughness: F64  # [T], perceptual: alpha is its square
    specular: F64  # [T]
    specular_colour: F64  # [T, 3], may exceed 1: a factor on F0

    def at(self, rows: Float | Bool) -> Standard:
        """Some of the surfaces."""
        return Standard(**{name: values[rows] for name, values in vars(self).items()})


def evaluate(p: Standard, i_in_local: Float, o_in_local: Float) -> F64:
    """BRDF values [T, 3] for directions [T, 3] or [3], normal (0, 0, 1); 0 below the surface."""
    i, o = np.broadcast_arrays(np.asarray(i_in_local, np.float64), np.asarray(o_in_local, np.float64))
    n_i, n_o = i[..., 2], o[..., 2]
    lit = (n_i > 0) & (n_o > 0)
    n_i, n_o = np.where(lit, n_i, 1.0), np.where(lit, n_o, 1.0)
    h = unit(i + o)
    alpha2 = p.roughness**4
    d = alpha2 / (np.pi * (h[..., 2] ** 2 * (alpha2 - 1) + 1) ** 2)
    v = 1 / (n_i + np.sqrt(alpha2 + (1 - alpha2) * n_i**2)) / (n_o + np.sqrt(alpha2 + (1 - alpha2) * n_o**2))
    lobe = (d * v)[..., None]
    s = ((1 - np.clip(dot(o, h), 0, 1)) ** 5)[..., None]
    f0, w, m = np.minimum(F0 * p.specular_colour, 1), p.specular[..., None], p.metallic[..., None]
    fresnel = f0 + (1 - f0) * s
    metal = lobe * (p.base_colour + (1 - p.base_colour) * s)
    beneath = (1 - w * fresnel.max(axis=-1, keepdims=True)) * p.base_colour / np.pi
    return np.where(lit[..., None], m * metal + (1 - m) * (beneath + w * fresnel * lobe), 0)


def integrals(light: Environment, normal: F64, to_viewer: F64) -> F64:
    """The four integrals [L, Q, 4, 3] at each of LEVELS for pairs [Q, 3], without self-shadowing."""
    arriving = light.octahedral(CELLS).reshape(-1, 3).astype(np.float64) * (4 / CELLS**2)
    towards = pixel_directions(CELLS).reshape(-1, 3)
    cosine = np.maximum(normal @ towards.T, 0)
    h = unit(towards[None] + to_viewer[:, None])
    s = (1 - np.clip(dot(h, to_viewer[:, None]), 0, 1)) ** 5
    found = np.empty((len(LEVELS), len(normal), 4, 3))
    found[:, :, 0], found[:, :, 1] = cosine @ arriving, (cosine * s) @ arriving
    for level, alpha in enumerate(LEVELS):
        # GGX is a mixture of Beckmann lobes, which the operator of the reconstruction integrates.
        sigmas = np.geomspace(alpha / 4, max(40.0, 40 * alpha), 96)
        basis = GenericBasis("ggx", sigmas, (f"smith:{alpha:.17g}",), ("lambert",))
        lobes = np.zeros((2, basis.kernels, 3))
        for kind, power in enumerate((0, 5)):
            first = basis.fresnel.index(power) * len(sigmas)
            lobes[kind, first : first + len(sigmas)] = ggx_mixture(alpha, sigmas)[:, None]
        whole, grazing = np.moveaxis(
            representative_responses(basis, lobes, light.pyramid(), normal, to_viewer), 1, 0
        )
        found[level, :, 2], found[level, :, 3] = whole - grazing, grazing
    return found


def coefficients(p: Standard) -> F64:
    """[T, 3, 4]: factors of the four integrals, whose sum is what surfaces look like."""
    w, m = p.specular[:, None], p.metallic[:, None]
    f0 = np.minimum(F0 * p.specular_colour, 1)
    most = f0.max(axis=1, keepdims=True)
    diffuse = (1 - m) * p.base_colour
    return np.stack(
        [
            diffuse * (1 - w * most),
            -diffuse * w * (1 - most),
            m * p.base_colour + (1 - m) * w * f0,
            np.broadcast_to(m + (1 - m) * w, f0.shape),
        ],
        axis=-1,
    )

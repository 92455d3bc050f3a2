# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Factors of the Cook-Torrance model (Eqs. 8 to 11), plain and slow.

All cosines are of unit directions with the normal, in the local frame n = (0, 0, 1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from swatchwork.arrays import F64, Float
from swatchwork.errors import InputError


def beckmann(n_dot_h: Float, sigma: float) -> F64:
    """Beckmann's distribution D(h) of roughness ``sigma`` (Eq. 9), per steradian."""
    cosine2 = np.maximum(np.asarray(n_dot_h, np.float64), 1e-9) ** 2
    tangent2 = (1.0 - np.minimum(cosine2, 1.0)) / cosine2
    return np.where(n_dot_h > 0, np.exp(-tangent2 / sigma**2) / (np.pi * sigma**2 * cosine2**2), 0.0)


def schlick(cosine: Float, tau: float = 0.0) -> F64:
    """Fresnel factor tau + (1 - tau)(1 - cosine)^5 (Eq. 11)."""
    rise = (1.0 - np.clip(np.asarray(cosine, np.float64), 0.0, 1.0)) ** 5
    return tau + (1.0 - tau) * rise


def masking_value(masking: str, n_dot_i: Float, n_dot_o: Float, o_dot_h: Float, n_dot_h: Float) -> F64:
    """Shadowing and masking G; none depends on roughness.

    ``vgroove`` is Eq. 10. ``smith:ALPHA`` is the separable Smith term of GGX with that fixed alpha,
    G1(i) G1(o) with G1(v) = 2 n.v / (n.v + sqrt(alpha^2 + (1 - alpha^2) (n.v)^2)).

    Raises:
        InputError: for another name.
    """
    i, o = np.asarray(n_dot_i, np.float64), np.asarray(n_dot_o, np.float64)
    if masking == "vgroove":
        open_side = 2.0 * n_dot_h * np.minimum(i, o) / np.where(o_dot_h > 0, o_dot_h, 1.0)
        return np.minimum(1.0, open_side)
    alpha2 = smith_alpha(masking) ** 2
    width_i = i + np.sqrt(alpha2 + (1.0 - alpha2) * i * i)
    width_o = o + np.sqrt(alpha2 + (1.0 - alpha2) * o * o)
    return 4.0 * i * o / (width_i * width_o)


def smith_alpha(masking: str) -> float:
    """Alpha of a masking named ``smith:ALPHA``.

    Raises:
        InputError: where the name is not of that form with alpha in (0, 1].
    """
    kind, _, value = masking.partition(":")
    try:
        alpha = float(value)
    except ValueError:
        alpha = 0.0
    if kind != "smith" or not 0.0 < alpha <= 1.0:
        raise InputError(f"masking {masking!r}", expected="'vgroove' or 'smith:ALPHA' with ALPHA in (0, 1]")
    return alpha


DIFFUSE_SHAPES: dict[str, Callable[[F64], F64]] = {
    "one": np.ones_like,
    "half": lambda c: 1.0 - (1.0 - 0.5 * c) ** 5,
    "fifth": lambda c: (1.0 - c) ** 5,
    "tenth": lambda c: (1.0 - c) ** 10,
    "shade": lambda c: 1.0 / (1.0 + c),
}
"""Functions of one cosine that diffuse kernels are products of, in the native operator's order."""


def diffuse_value(terms: tuple[tuple[str, str], ...], n_dot_i: Float, n_dot_o: Float) -> F64:
    """Diffuse BRDF: the sum over the terms (a, b) of a(n.i) b(n.o) / pi, shapes by name."""
    c_i, c_o = (np.clip(np.asarray(c, np.float64), 0.0, 1.0) for c in (n_dot_i, n_dot_o))
    return np.asarray(sum(DIFFUSE_SHAPES[a](c_i) * DIFFUSE_SHAPES[b](c_o) for a, b in terms) / np.pi)


def reflected_light(h: Float, o: Float) -> F64:
    """Direction i = 2 (o.h) h - o that a facet with normal ``h`` reflects to ``o`` [..., 3]."""
    h, o = np.asarray(h, np.float64), np.asarray(o, np.float64)
    return np.asarray(2.0 * np.sum(h * o, axis=-1, keepdims=True) * h - o, np.float64)

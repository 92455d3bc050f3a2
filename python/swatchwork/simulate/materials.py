# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Materials of known parameters, as weights of a generic basis [J, 3] (Eq. 7).

GGX lobes are weights too, of a wider basis: in slope space GGX is a mixture of Beckmann lobes,
D_ggx(alpha) = integral of D_beckmann(alpha / sqrt(E)) exp(-E) dE, so a dense set of sigmas over
several decades reproduces it, and truth outside the paper's range runs through the same operator.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from ..arrays import F64
from ..reflectance import GenericBasis


@dataclass(frozen=True)
class Lobe:
    """One specular lobe: colour [3] (at tau = 1), roughness sigma or alpha, Fresnel tau of Eq. 11."""

    colour: tuple[float, float, float]
    roughness: float
    tau: float


@dataclass(frozen=True)
class Recipe:
    """A plausible material: Lambertian albedo [3] and specular lobes."""

    name: str
    diffuse: tuple[float, float, float]
    lobes: tuple[Lobe, ...]


def four_materials(seed: int = 0) -> tuple[Recipe, ...]:
    """A plastic, a metal, a glossy paint and a coarse phenolic of random, well separated hues."""
    rng, hues = _hues(seed)
    near = partial(_near, rng)
    return (
        Recipe("plastic", _colour(hues[0], 0.7, 0.5), (Lobe(_white(0.8), near(0.06), 0.05),)),
        Recipe("metal", _white(0.0), (Lobe(_colour(hues[1], 0.5, 0.9), near(0.14), 0.8),)),
        Recipe(
            "paint",
            _colour(hues[2], 0.85, 0.2),
            (Lobe(_white(0.7), near(0.02), 0.04), Lobe(_colour(hues[2], 0.6, 0.35), near(0.3), 0.7)),
        ),
        Recipe("phenolic", _colour(hues[3], 0.8, 0.35), (Lobe(_white(0.9), near(0.2), 0.08),)),
    )


def satin_materials(seed: int = 0) -> tuple[Recipe, ...]:
    """A lacquer, a brushed metal, a glaze over an undercoat and a rubber, of roughness 0.08 to 0.3.

    Lobes this wide vary little over a pixel, so that photographs of a few hundred pixels sample them well.
    """
    rng, hues = _hues(seed)
    near = partial(_near, rng)
    return (
        Recipe("lacquer", _colour(hues[0], 0.7, 0.5), (Lobe(_white(0.8), near(0.12), 0.05),)),
        Recipe("brushed metal", _white(0.0), (Lobe(_colour(hues[1], 0.5, 0.9), near(0.16), 0.8),)),
        Recipe(
            "glaze",
            _colour(hues[2], 0.85, 0.2),
            (Lobe(_white(0.8), near(0.1), 0.06), Lobe(_colour(hues[2], 0.6, 0.3), near(0.24), 0.7)),
        ),
        Recipe("rubber", _colour(hues[3], 0.8, 0.3), (Lobe(_white(0.9), near(0.24), 0.06),)),
    )


def many_materials(count: int, seed: int = 0) -> tuple[Recipe, ...]:
    """``count`` distinct plastics, metals, glazes over an undercoat and matte ones, in turn.

    Hues keep a golden section of the circle apart, and values differ. Roughness spreads in equal ratios over
    a kind's range: 0.05 to 0.25 for plastics, 0.08 to 0.35 for metals, 0.05 to 0.1 over 0.2 to 0.4 for
    glazes, 0.25 to 0.45 for matte ones. Fresnel tau is a dielectric's at normal incidence, 0.03 to 0.08
    (refractive index 1.4 to 1.8), or a metal's, 0.7 to 0.9.
    """
    rng = np.random.default_rng([seed, 6])
    hues = (rng.uniform() + 0.618 * np.arange(count) + rng.uniform(-0.02, 0.02, count)) % 1
    kinds = 4
    of_kind = max(1, -(-count // kinds))
    # Roughness and value are shuffled apart, lest rank in the one tell the other.
    ranks = [[rng.permutation(of_kind) for _ in range(2)] for _ in range(kinds)]

    def recipe(i: int) -> Recipe:
        kind, turn = i % kinds, i // kinds
        rough, bright = ((ranks[kind][q][turn] + rng.uniform(0.25, 0.75)) / of_kind for q in range(2))
        hue, dielectric = float(hues[i]), float(rng.uniform(0.03, 0.08))

        def between(low: float, high: float) -> float:
            return float(low * (high / low) ** rough)

        if kind == 0:
            coat = Lobe(_white(0.8), between(0.05, 0.25), dielectric)
            return Recipe(f"plastic {turn}", _colour(hue, 0.7, 0.15 + 0.55 * bright), (coat,))
        if kind == 1:
            metal = Lobe(
                _colour(hue, 0.45, 0.5 + 0.45 * bright), between(0.08, 0.35), float(rng.uniform(0.7, 0.9))
            )
            return Recipe(f"metal {turn}", _white(0.0), (metal,))
        if kind == 2:
            coat = Lobe(_white(0.8), between(0.05, 0.1), dielectric)
            under = Lobe(_colour(hue, 0.6, 0.2 + 0.3 * bright), between(0.2, 0.4), 0.7)
            return Recipe(f"glaze {turn}", _colour(hue, 0.85, 0.1 + 0.2 * bright), (coat, under))
        matte = Lobe(_white(0.5), between(0.25, 0.45), dielectric)
        return Recipe(f"matte {turn}", _colour(hue, 0.6, 0.1 + 0.65 * bright), (matte,))

    return tuple(recipe(i) for i in range(count))


def _hues(seed: int) -> tuple[np.random.Generator, F64]:
    """Four random, well separated hues, and the generator for the rest."""
    rng = np.random.default_rng([seed, 2])
    return rng, (rng.uniform() + np.arange(4) / 4 + rng.uniform(-0.06, 0.06, 4)) % 1


def _colour(hue: float, saturation: float, value: float) -> tuple[float, float, float]:
    ramp = np.clip(np.abs((hue * 6 + np.array([0.0, 4.0, 2.0])) % 6 - 3) - 1, 0, 1)
    r, g, b = value * (1 - saturation + saturation * ramp)
    return float(r), float(g), float(b)


def _white(value: float) -> tuple[float, float, float]:
    return value, value, value


def _near(rng: np.random.Generator, value: float) -> float:
    return float(value * rng.uniform(0.8, 1.25))


def in_basis(recipes: tuple[Recipe, ...], basis: GenericBasis) -> F64:
    """Beckmann materials as weights [N, J, 3], each roughness moved to the nearest sigma of the basis."""
    found = np.zeros((len(recipes), basis.kernels, 3))
    sigmas = basis.sigmas
    for i, recipe in enumerate(recipes):
        _add_diffuse(found[i], recipe, basis)
        for lobe in recipe.lobes:
            s = int(np.argmin(np.abs(np.log(sigmas / lobe.roughness))))
            _add_lobe(found[i], lobe, np.eye(len(sigmas))[s], basis)
    return found


@cache
def ggx_basis(masking: str = "vgroove") -> GenericBasis:
    """The paper's kernels with 85 sigmas from 0.004 to 40: dense and wide enough to hold GGX lobes.

    ``masking`` is ``vgroove`` as in the paper, or ``smith:ALPHA``.
    """
    return GenericBasis("ggx-truth", np.geomspace(0.004, 40.0, 85), (masking,), ("lambert",))


def in_ggx(recipes: tuple[Recipe, ...], masking: str = "vgroove") -> F64:
    """The same materials with GGX lobes of alpha = roughness, as weights [N, J, 3] of `ggx_basis`."""
    basis = ggx_basis(masking)
    found = np.zeros((len(recipes), basis.kernels, 3))
    for i, recipe in enumerate(recipes):
        _add_diffuse(found[i], recipe, basis)
        for lobe in recipe.lobes:
            _add_lobe(found[i], lobe, ggx_mixture(lobe.roughness, basis.sigmas), basis)
    return found


def ggx_mixture(alpha: float, sigmas: F64) -> F64:
    """Weights [S] of log-spaced Beckmann sigmas whose sum is GGX of ``alpha``.

    With E = (alpha / sigma)^2 the density over log sigma is 2 E exp(-E); the trapezium rule converges
    faster than any power of the spacing.
    """
    e = (alpha / sigmas) ** 2
    return np.asarray(2 * e * np.exp(-e) * np.log(sigmas[1] / sigmas[0]), dtype=np.float64)


def _add_diffuse(weights: F64, recipe: Recipe, basis: GenericBasis) -> None:
    weights[len(basis.lobes) + basis.diffuse.index("lambert")] += recipe.diffuse


def _add_lobe(weights: F64, lobe: Lobe, mixture: F64, basis: GenericBasis) -> None:
    """Add to the kernels of the basis's first masking, of which ``mixture`` has one entry a sigma."""
    # Exponent 5 is tau = 0 in Eq. 11, exponent 0 is tau = 1.
    for power, share in ((5, 1 - lobe.tau), (0, lobe.tau)):
        first = basis.fresnel.index(power) * len(mixture)
        weights[first : first + len(mixture)] += mixture[:, None] * np.asarray(lobe.colour) * share

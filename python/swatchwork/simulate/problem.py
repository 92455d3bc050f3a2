# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Blends on a sphere at the level of texels, without images: design section 3's two-of-four experiment.

Measurements are exact responses of the truth at the texels (plus noise), so what a solver leaves is
the solver's own error, not sampling's.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import F32, F64, I32, I64, U32, Float, fibonacci_sphere, unit
from ..light import Environment
from ..reflectance import GenericBasis, paper
from ..response import generic_responses, representative_responses
from .blends import blend_pattern, dense_weights
from .environments import procedural_environment
from .materials import four_materials, ggx_basis, in_basis, in_ggx
from .viewpoints import DISTANCE, random_directions

MINIMUM_COSINE = 0.03
"""Pairs at grazing angles below this are left out, as observe does."""
TEST_VIEWS = 6


@dataclass(frozen=True)
class Pairs:
    """Visible (texel, view) pairs, texel by texel and in a texel by view."""

    texel: I32
    """[P] texel of each pair."""
    view: I32
    """[P] view of each pair."""
    normal: F32
    """[P, 3] unit normals in the world."""
    to_viewer: F32
    """[P, 3] unit directions to the camera in the world."""
    offsets: I64
    """[M + 1]: the pairs of texel x are offsets[x] : offsets[x + 1]."""


@dataclass(frozen=True)
class SyntheticProblem:
    """A problem for the solver, and what it should find."""

    basis: GenericBasis
    """The basis the responses are of."""
    normal: F64
    """[M, 3] texel normals; the object is the unit sphere, so positions too."""
    pairs: Pairs
    """The pairs measured; only texels that a view sees are part of the problem."""
    responses: F32
    """[P, J, 3] generic responses (Eq. 13) under the training light."""
    radiance: F32
    """[P, 3] measurements, noise included."""
    truth_basis: GenericBasis
    """Basis of the truth: `basis` itself, or a wider one for GGX."""
    truth_representatives: F64
    """[N, J', 3] in `truth_basis`."""
    truth_index: U32
    """[M, n]."""
    truth_weight: F64
    """[M, n], rows sum to 1."""
    novel_light: Environment
    novel_pairs: Pairs
    """All texels of the problem from views that were not measured."""
    novel_radiance: F64 = field(repr=False)
    """[P', 3] the truth under the novel light."""

    @property
    def offsets(self) -> I64:
        """[M + 1] row pointers of the pairs."""
        return self.pairs.offsets

    def novel(self, representatives: F64, index: U32, weight: Float) -> float:
        """Novel-light NRMS (a fraction) of representatives [N, J, 3] blended by index, weight [M, n]."""
        a = _radiance(self.basis, representatives, (index, weight), self.novel_light, self.novel_pairs)
        b = self.novel_radiance
        return float(np.sqrt(((a - b) ** 2).sum() / (b**2).sum()))


def two_of_four(
    k: int = 6,
    seed: int = 0,
    truth: str = "basis",
    *,
    noise_percent: float = 0.0,
    read_percent: float = 0.0,
    texels: int = 4000,
    basis: GenericBasis | None = None,
    materials: int = 4,
    blended: int = 2,
    sharp: bool = False,
    environment: Environment | None = None,
    novel_environment: Environment | None = None,
) -> SyntheticProblem:
    """A sphere that blends two of four materials at each texel, seen by k random views.

    Args:
        k: views, uniform over the sphere; fewer views of a seed are the first of more.
        seed: of materials, blend, views, noise and lights alike.
        truth: ``basis`` (representatives within the basis) or ``ggx`` (lobes that the basis lacks).
        noise_percent: each measurement is multiplied by 1 + p / 100 N(0, 1).
        read_percent: standard deviation of what is added to each measurement, in % of their median.
        texels: points spread over the sphere, of which those that a view sees are kept.
        basis: of the responses; the paper's by default.
        materials: N of the truth, at most 4.
        blended: n of the truth.
        sharp: patches with hard edges.
        environment: training light; a procedural room by default.
        novel_environment: light of the test; a procedural sky by default.
    """
    if truth not in ("basis", "ggx"):
        raise ValueError(f"truth is {truth!r}; expected 'basis' or 'ggx'")
    basis = basis or paper()
    light = environment or procedural_environment("room", seed)
    novel_light = novel_environment or procedural_environment("sky", seed + 1)
    normal = fibonacci_sphere(texels)
    pairs = visible_pairs(normal, random_directions(k, seed))
    normal = normal[np.unique(pairs.texel)]
    pairs = visible_pairs(normal, random_directions(k, seed))

    recipes = four_materials(seed)[:materials]
    truth_basis = ggx_basis() if truth == "ggx" else basis
    representatives = in_ggx(recipes) if truth == "ggx" else in_basis(recipes, basis)
    index, weight = blend_pattern(normal, materials=materials, blended=blended, seed=seed, sharp=sharp)

    responses = generic_responses(basis, light.pyramid(), pairs.normal, pairs.to_viewer)
    if truth == "ggx":
        radiance = _radiance(truth_basis, representatives, (index, weight), light, pairs)
    else:
        # From the very numbers the solver gets, so that a noise-free fit can be perfect.
        per_material = np.einsum("pjc,njc->pnc", responses, representatives, optimize=True)
        full = dense_weights(index, weight, materials)[pairs.texel]
        radiance = np.einsum("pn,pnc->pc", full, per_material)
    rng = np.random.default_rng([seed, 4])
    typical = float(np.median(radiance))
    radiance = radiance * (1 + noise_percent / 100 * rng.normal(size=radiance.shape))
    if read_percent:
        radiance = radiance + read_percent / 100 * typical * rng.normal(size=radiance.shape)

    # Views of another seed: none of them was measured.
    novel_pairs = visible_pairs(normal, random_directions(TEST_VIEWS, seed + 10_000))
    return SyntheticProblem(
        basis=basis,
        normal=normal,
        pairs=pairs,
        responses=responses,
        radiance=radiance.astype(np.float32),
        truth_basis=truth_basis,
        truth_representatives=representatives,
        truth_index=index,
        truth_weight=weight,
        novel_light=novel_light,
        novel_pairs=novel_pairs,
        novel_radiance=_radiance(truth_basis, representatives, (index, weight), novel_light, novel_pairs),
    )


def visible_pairs(normal: F64, view_directions: F64) -> Pairs:
    """Pairs of a unit sphere's points and cameras at DISTANCE; a convex shape hides nothing else."""
    to_viewer = unit(DISTANCE * view_directions[None] - normal[:, None])
    cosine = np.einsum("mkc,mc->mk", to_viewer, normal)
    texel, view = np.nonzero(cosine > MINIMUM_COSINE)
    offsets = np.searchsorted(texel, np.arange(len(normal) + 1))
    return Pairs(
        texel.astype(np.int32),
        view.astype(np.int32),
        normal[texel].astype(np.float32),
        to_viewer[texel, view].astype(np.float32),
        offsets.astype(np.int64),
    )


def _radiance(
    basis: GenericBasis, representatives: F64, blend: tuple[U32, Float], light: Environment, pairs: Pairs
) -> F64:
    s = representative_responses(basis, representatives, light.pyramid(), pairs.normal, pairs.to_viewer)
    full = dense_weights(blend[0], np.asarray(blend[1], np.float64), len(representatives))[pairs.texel]
    return np.asarray(np.einsum("pn,pnc->pc", full, s), dtype=np.float64)

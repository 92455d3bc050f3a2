# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The synthetic objects of section 7.1, on a sphere."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from ..arrays import F32, F64, fibonacci_sphere
from ..capture import read_image
from ..reflectance import GenericBasis
from ..simulate import (
    KernelMaterials,
    Lobe,
    MeasuredMaterials,
    Recipe,
    Sphere,
    blend_pattern,
    dense_weights,
    ggx_basis,
    in_basis,
    in_ggx,
)
from .data import FOUR, Data

COPPER = (
    Recipe("polished copper", (0.0, 0.0, 0.0), (Lobe((0.95, 0.64, 0.54), 0.1, 0.85),)),
    Recipe("worn copper", (0.02, 0.01, 0.01), (Lobe((0.8, 0.5, 0.4), 0.25, 0.8),)),
    Recipe("tarnish", (0.1, 0.05, 0.03), (Lobe((0.35, 0.22, 0.15), 0.2, 0.5),)),
    Recipe("verdigris", (0.12, 0.28, 0.2), (Lobe((0.3, 0.3, 0.3), 0.4, 0.06),)),
    Recipe("dark oxide", (0.03, 0.025, 0.02), (Lobe((0.5, 0.5, 0.5), 0.15, 0.05),)),
)
"""GGX lobes: plausible states of a copper plate, all outside the generic bases."""
ANCHORS = ((0.75, 0.1), (0.55, 0.4), (0.35, 0.25), (0.2, 0.9), (0.1, 0.6))
"""Rank of albedo and of roughness in the texture at which each of them lies."""
BLENDED = 3


def two_of_four(data: Data, texels: int, seed: int = 0) -> Sphere:
    """Four measured materials, two of them blended at every point: n = 2, N = 4 (Fig. 6)."""
    normal = fibonacci_sphere(texels)
    weights = dense_weights(*blend_pattern(normal, materials=4, blended=2, seed=seed), 4)
    return Sphere(MeasuredMaterials(data.merl(FOUR)), normal, weights)


def copper(data: Data, texels: int) -> Sphere:
    """A richly textured plate of five GGX materials, three blended at a point, in place of 'copper'.

    Wang et al.'s measured SVBRDF is not public. Where its materials lie follows the albedo and roughness of a
    photographed rusty metal plate if the data folder has one, random fields otherwise.
    """
    normal = fibonacci_sphere(texels)
    features = _texture(data, normal)
    distance = ((features[:, None] - np.array(ANCHORS)) ** 2).sum(axis=-1)
    order = np.argsort(distance, axis=1)[:, : BLENDED + 1]
    near = np.take_along_axis(distance, order, axis=1)
    # Nothing at the first one left out, so that weights are continuous.
    share = 1 / (near[:, :BLENDED] + 1e-3) - 1 / (near[:, BLENDED:] + 1e-3)
    index = order[:, :BLENDED].astype(np.uint32)
    weights = dense_weights(index, share / share.sum(axis=1, keepdims=True), len(COPPER))
    return Sphere(KernelMaterials(ggx_basis(), in_ggx(COPPER)), normal, weights)


def _texture(data: Data, normal: F64) -> F64:
    """Albedo and roughness [M, 2] at points of the sphere, each as its rank in [0, 1]."""
    folder = None if data.folder is None else data.folder / "textures" / "rustymetal"
    if folder is not None and (folder / "albedo.jpg").is_file() and (folder / "roughness.jpg").is_file():
        u = (np.arctan2(normal[:, 1], normal[:, 0]) / (2 * np.pi)) % 1
        v = np.arccos(np.clip(normal[:, 2], -1, 1)) / np.pi
        albedo, roughness = (
            _smooth(read_image(folder / f"{name}.jpg").linear.mean(axis=-1))
            for name in ("albedo", "roughness")
        )
        height, width = albedo.shape
        at = np.minimum((v * height).astype(int), height - 1), np.minimum((u * width).astype(int), width - 1)
        values = np.stack([albedo[at], roughness[at]], axis=-1).astype(np.float64)
    else:
        values = np.stack(
            [dense_weights(*blend_pattern(normal, materials=2, blended=2, seed=s), 2)[:, 0] for s in (1, 2)],
            axis=-1,
        )
    return np.asarray(values.argsort(axis=0).argsort(axis=0) / (len(normal) - 1))


def _smooth(image: F32) -> F32:
    """Blurred over 4 of its 1024 pixels a side, which takes the grain out of a photograph."""
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 4), dtype=np.float32)


def triangle(basis: GenericBasis, texels: int) -> Sphere:
    """Three generic materials mixed by barycentric coordinates of a spherical triangle: n = 3 (Fig. 7)."""
    recipes = (
        Recipe("red", (0.5, 0.08, 0.05), (Lobe((0.6, 0.6, 0.6), 0.05, 0.06),)),
        Recipe("green", (0.06, 0.4, 0.08), (Lobe((0.5, 0.7, 0.4), 0.12, 0.4),)),
        Recipe("blue", (0.05, 0.08, 0.45), (Lobe((0.7, 0.7, 0.8), 0.25, 0.1),)),
    )
    normal = fibonacci_sphere(texels)
    angle = 2 * np.pi * np.arange(3) / 3
    corners = np.stack([np.cos(angle), np.sin(angle), np.zeros(3)], axis=-1)
    # The sphere's shadow on the plane of the equator lies within the triangle: all three are everywhere.
    weights = (1 + normal @ corners.T) / 3
    return Sphere(KernelMaterials(basis, in_basis(recipes, basis)), normal, weights)


@lru_cache
def one_lobe_basis(sigma: float) -> GenericBasis:
    """The paper's kernels at one roughness."""
    return GenericBasis(f"sigma {sigma:g}", sigmas=np.array([sigma]))


def homogeneous(sigma: float, texels: int, tau: float = 0.06) -> Sphere:
    """A glossy sphere of one roughness, between the sigmas of the generic basis (Figs. 10, 11)."""
    basis = one_lobe_basis(sigma)
    recipe = Recipe("glossy", (0.2, 0.15, 0.1), (Lobe((0.8, 0.8, 0.8), sigma, tau),))
    weights = in_basis((recipe,), basis)
    return Sphere(KernelMaterials(basis, weights), fibonacci_sphere(texels), np.ones((texels, 1)))


def halves(sigma: float, taus: tuple[float, float], texels: int) -> Sphere:
    """Two materials that differ in tau alone, with one reflectance at normal incidence (Fig. 9)."""
    basis = one_lobe_basis(sigma)
    at_normal = 0.15
    recipes = tuple(
        Recipe(f"tau {tau:g}", (0.1, 0.1, 0.1), (Lobe((at_normal / tau,) * 3, sigma, tau),)) for tau in taus
    )
    normal = fibonacci_sphere(texels)
    left = (normal[:, 0] < 0).astype(np.float64)
    return Sphere(
        KernelMaterials(basis, in_basis(recipes, basis)), normal, np.stack([left, 1 - left], axis=1)
    )

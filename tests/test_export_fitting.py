# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The metallic-roughness model against quadrature, and its fit against materials that it holds exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swatchwork.arrays import F64, fibonacci_sphere
from swatchwork.export import Padding, fit_standard
from swatchwork.export.standard import F0, LEVELS, Standard, coefficients, evaluate, integrals
from swatchwork.light import Environment
from swatchwork.material import BasisRecord, Material
from swatchwork.reflectance import GenericBasis
from swatchwork.simulate import ggx_mixture, shape
from swatchwork.surface import build_atlas


def surfaces(count: int = 40, seed: int = 0) -> Standard:
    rng = np.random.default_rng(seed)
    return Standard(
        rng.uniform(size=(count, 3)),
        rng.uniform(size=count),
        rng.uniform(0.3, 1, count),
        rng.uniform(size=count),
        rng.uniform(0, 20, (count, 3)),
    )


def directions(count: int, seed: int) -> F64:
    found = np.random.default_rng([seed, 1]).normal(size=(count, 3))
    found[:, 2] = np.abs(found[:, 2])
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def test_dielectrics_and_metals_are_the_appendix_written_out() -> None:
    """One direction pair by hand: n = o = i, so that o.h = n.h = 1 and s = 0."""
    up = np.array([0.0, 0.0, 1.0])
    alpha = 0.25
    lobe = 1 / (np.pi * alpha**2) / 4
    p = Standard(np.array([[0.8, 0.5, 0.2]]), np.zeros(1), np.full(1, 0.5), np.ones(1), np.ones((1, 3)))
    assert np.allclose(evaluate(p, up, up), (1 - F0) * p.base_colour / np.pi + F0 * lobe)
    assert np.allclose(evaluate(replace(p, metallic=np.ones(1)), up, up), p.base_colour * lobe)


def test_metals_are_reciprocal_and_nothing_shines_from_below() -> None:
    p = surfaces()
    i, o = directions(40, 2), directions(40, 3)
    assert np.allclose(evaluate(p, i, o), evaluate(p, o, i), rtol=1e-12)
    assert not evaluate(p, i * [1, 1, -1], o).any()


def test_integrals_are_those_of_the_model() -> None:
    """Under a smooth light, against a sum over 40,000 directions."""
    height = 32
    v = np.arange(height)[:, None, None] / height
    light = Environment(
        np.broadcast_to(1.2 + np.cos(np.pi * v) * [0.5, 0.2, -0.3], (height, 64, 3)).astype(np.float32),
        "blender",
    )
    towards = fibonacci_sphere(40_000)
    towards = towards[towards[:, 2] > 0]
    normal = np.tile([0.0, 0.0, 1.0], (3, 1))
    viewer = np.array([[np.sqrt(1 - c * c), 0.0, c] for c in (0.3, 0.6, 0.95)])
    level = int(np.argmin(np.abs(LEVELS - 0.3)))
    table = integrals(light, normal, viewer)[level]
    p = surfaces(1, 5)
    p = replace(p, roughness=np.array([np.sqrt(LEVELS[level])]))
    found = np.einsum("ci,qic->qc", coefficients(p)[0], table)
    arriving = light.lookup(towards) * (4 * np.pi / 40_000 * towards[:, 2:])
    for q in range(3):
        many = p.at(np.zeros(len(towards), np.int64))
        wanted = (evaluate(many, towards, viewer[q]) * arriving).sum(axis=0)
        # The operator's rings keep a kernel within 1.5 %.
        assert np.allclose(found[q], wanted, rtol=0.02)


def ggx_material(p: Standard, resolution: int = 32) -> Material:
    """A ball that the model holds exactly, in stripes: a metal, a glossless diffuse surface and, if p has a
    third, one that is part metal and part glossless.
    """
    alpha = float(p.roughness[0] ** 2)
    sigmas = np.geomspace(alpha / 4, 40.0, 60)
    basis = GenericBasis("ggx", sigmas, (f"smith:{alpha:.17g}",), ("lambert",))
    metallic = [1.0, 0.0, *p.metallic[2:]]
    weights = np.zeros((len(metallic), basis.kernels, 3))
    mixture = ggx_mixture(alpha, sigmas)[:, None]
    for n, (m, colour) in enumerate(zip(metallic, p.base_colour, strict=True)):
        for power, share in ((5, 1 - colour), (0, colour)):
            first = basis.fresnel.index(power) * len(sigmas)
            weights[n, first : first + len(sigmas)] = m * mixture * share
        weights[n, -1] = (1 - m) * colour
    mesh = shape("sphere", 16)
    atlas = build_atlas(mesh, resolution)
    square = (resolution, resolution)
    coverage = np.full(square, -1, np.int32)
    coverage[atlas.row, atlas.col] = 1
    index = np.zeros((*square, 1), np.uint32)
    index[..., 0] = np.arange(resolution) * len(metallic) // resolution
    assert mesh.uv is not None
    return Material(
        BasisRecord(basis.name, tuple(sigmas.tolist()), basis.maskings, basis.diffuse, basis.fresnel),
        weights,
        index,
        np.ones((*square, 1), np.float32),
        coverage,
        np.zeros(square, np.float32),
        mesh.vertices,
        mesh.faces,
        mesh.normals,
        mesh.uv,
    )


def test_finds_what_the_model_holds() -> None:
    truth = surfaces(3, 7)
    level = int(np.argmin(np.abs(LEVELS - 0.2)))
    truth = replace(
        truth,
        metallic=np.array([1.0, 0.0, 0.4]),
        roughness=np.full(3, np.sqrt(LEVELS[level])),
        base_colour=np.array([[0.9, 0.6, 0.3], [0.2, 0.3, 0.5], [0.7, 0.5, 0.4]]),
        specular=np.zeros(3),
    )
    material = ggx_material(truth)
    fit = fit_standard(material)
    # What is left is quadrature, of the diffuse integral over cells above all.
    assert fit.fit_nrms < 0.02
    assert fit.loss_nrms < 0.02
    assert fit.clipped == 0
    stripe = material.index[material.on_atlas][:, 0]
    first, second, third = (int(fit.blend_of_texel[np.flatnonzero(stripe == n)[0]]) for n in range(3))
    p = fit.parameters
    assert p.metallic[first] > 0.9
    assert p.base_colour[first] == pytest.approx(truth.base_colour[0], abs=0.03)
    assert p.roughness[first] == pytest.approx(truth.roughness[0], rel=0.05)
    assert p.base_colour[second] == pytest.approx(truth.base_colour[1], rel=0.03)
    assert (p.specular[second] * np.minimum(F0 * p.specular_colour[second], 1)).max() < 0.01
    # Part metal says the same as a dielectric that reflects much, but for the little that one takes beneath.
    assert 0.1 < p.metallic[third] < 0.5
    assert coefficients(p)[third] == pytest.approx(coefficients(truth)[2], abs=0.03)
    assert p.roughness[third] == pytest.approx(truth.roughness[2], rel=0.05)


def test_gutters_show_the_nearest_texel() -> None:
    material = ggx_material(surfaces(2))
    padding = Padding.of(material)
    on = material.on_atlas
    image = padding.image(material.index[on][:, 0])
    assert (image[on] == material.index[..., 0][on]).all()
    row, col = np.argwhere(~on)[0]
    texels = np.argwhere(on)
    nearest = ((texels - [row, col]) ** 2).sum(axis=1)
    allowed = material.index[tuple(texels[nearest == nearest.min()].T)][:, 0]
    assert image[row, col] in allowed

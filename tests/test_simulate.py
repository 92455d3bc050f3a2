# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Synthetic truth: it must be what it says it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from swatchwork.arrays import fibonacci_sphere
from swatchwork.capture import read_capture, read_photograph
from swatchwork.reflectance import GenericBasis, paper
from swatchwork.response import representative_responses
from swatchwork.simulate import (
    KINDS,
    SHAPES,
    Recipe,
    blend_pattern,
    camera_towards,
    dense_weights,
    four_materials,
    ggx_basis,
    in_basis,
    in_ggx,
    many_materials,
    procedural_environment,
    random_directions,
    satin_materials,
    shape,
    simulate_capture,
    two_of_four,
)
from swatchwork.surface import uv_problem


@pytest.mark.parametrize("kind", KINDS)
def test_environments_are_seeded_and_of_high_dynamic_range(kind: str) -> None:
    light = procedural_environment(kind, seed=3, height=64)
    again = procedural_environment(kind, seed=3, height=64)
    assert np.array_equal(light.radiance, again.radiance)
    assert not np.array_equal(light.radiance, procedural_environment(kind, seed=4, height=64).radiance)
    # The row weights of generator and Environment differ by their quadrature of sin theta, 1e-4 at 64 rows.
    assert light.mean_radiance.mean() == pytest.approx(1, abs=1e-3)
    # The atelier is meant to be the softest: windows some ten times the walls.
    assert light.radiance.max() > (5 if kind == "atelier" else 15) * light.radiance.mean()
    assert light.radiance.min() >= 0
    # The same light at another height: small lamps move by parts of a pixel, 10 % of their energy.
    finer = procedural_environment(kind, seed=3, height=128)
    assert np.allclose(finer.mean_radiance, light.mean_radiance, rtol=0.1)


def test_fewer_views_are_the_first_of_more() -> None:
    assert np.array_equal(random_directions(3, seed=5), random_directions(12, seed=5)[:3])
    many = random_directions(20_000, seed=0)
    # Uniform over the sphere: means 0 and second moments 1/3, within four standard errors.
    assert np.abs(many.mean(axis=0)).max() < 4 * np.sqrt(1 / 3 / 20_000)
    assert np.abs((many**2).mean(axis=0) - 1 / 3).max() < 4 * np.sqrt(4 / 45 / 20_000)


def test_a_camera_sees_the_whole_sphere() -> None:
    camera = camera_towards(np.array([0.3, -0.5, 0.8]), 100)
    uv, depth = camera.project(fibonacci_sphere(5000))
    assert (depth > 0).all()
    assert 3 < uv.min() < 5
    assert 95 < uv.max() < 97


@pytest.mark.parametrize("sharp", [False, True])
@pytest.mark.parametrize("blended", [1, 2, 3])
def test_blends_are_convex_and_use_every_material(blended: int, sharp: bool) -> None:
    position = fibonacci_sphere(3000)
    index, weight = blend_pattern(position, blended=blended, seed=1, sharp=sharp)
    assert index.shape == weight.shape == (3000, blended)
    assert (weight >= 0).all()
    assert np.allclose(weight.sum(axis=1), 1, atol=1e-12)
    assert (np.sort(index, axis=1)[:, 1:] != np.sort(index, axis=1)[:, :-1]).all()
    assert (dense_weights(index, weight, 4).max(axis=0) > 0.5).all()


def test_smooth_blends_vary_continuously() -> None:
    base = fibonacci_sphere(2000)
    near = base + 1e-6 * np.random.default_rng(0).normal(size=base.shape)
    one, two = (dense_weights(*blend_pattern(x, seed=2), 4) for x in (base, near))
    # Fields move by about 2e-5 in such a step (frequency 14); a weight moves by that over the fields'
    # excess, which is small where three fields nearly agree. A jump would be of order 1.
    assert np.abs(one - two).max() < 0.02


def test_ggx_mixture_is_ggx() -> None:
    """Evaluate the mixture's BRDF against the closed form of a GGX lobe with the same G and F."""
    basis, recipe = ggx_basis(), four_materials(0)[1]
    (lobe,) = recipe.lobes
    o = np.array([0.6, 0.0, 0.8])
    phi = np.linspace(0, np.pi, 7)
    theta = np.linspace(0, 1.3, 9)[:, None]
    i = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1)
    mixture = basis.evaluate(i, o) @ in_ggx((recipe,))[0]
    h = (i + o) / np.linalg.norm(i + o, axis=-1, keepdims=True)
    n_h, o_h, n_i, n_o = h[..., 2], h @ o, i[..., 2], o[2]
    a2 = lobe.roughness**2
    d = a2 / (np.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
    g = np.minimum(1, np.minimum(2 * n_h * n_i / o_h, 2 * n_h * n_o / o_h))
    f = lobe.tau + (1 - lobe.tau) * (1 - o_h) ** 5
    expected = (d * g * f / (4 * n_i * n_o))[..., None] * lobe.colour
    # Sigmas above 40 are cut off: (alpha / 40)^2 of the energy; the trapezium rule leaves less.
    assert np.allclose(mixture, expected, rtol=1e-4)


@pytest.mark.parametrize("recipes", [four_materials(0), satin_materials(0)])
def test_a_wider_basis_holds_the_same_materials(recipes: tuple[Recipe, ...]) -> None:
    i, o = np.array([[0.6, 0.0, 0.8]]), np.array([[0.0, 0.28, 0.96]])
    wider = GenericBasis("wider", paper().sigmas, ("vgroove", "smith:0.5"), ("half", "lambert"), (5, 2, 0))
    one = np.einsum("pj,njc->npc", paper().evaluate(i, o), in_basis(recipes, paper()))
    two = np.einsum("pj,njc->npc", wider.evaluate(i, o), in_basis(recipes, wider))
    assert np.allclose(one, two, rtol=1e-9)


def test_truth_explains_its_own_measurements() -> None:
    p = two_of_four(k=3, seed=1, texels=400)
    assert p.novel(p.truth_representatives, p.truth_index, p.truth_weight) == 0
    s = representative_responses(
        p.basis,
        p.truth_representatives,
        two_of_four_light(1),
        p.pairs.normal,
        p.pairs.to_viewer,
    )
    full = dense_weights(p.truth_index, p.truth_weight, 4)[p.pairs.texel]
    again = np.einsum("pn,pnc->pc", full, s)
    # Kernels folded first or last: two orders of summing about 100 f32 terms.
    assert np.allclose(p.radiance, again, rtol=2e-5, atol=1e-6)
    assert (np.diff(p.offsets) >= 1).all()
    assert np.array_equal(np.repeat(np.arange(len(p.normal)), np.diff(p.offsets)), p.pairs.texel)


def two_of_four_light(seed: int) -> object:
    return procedural_environment("room", seed).pyramid()


def test_noise_is_multiplicative_and_of_the_stated_size() -> None:
    clean = two_of_four(k=6, texels=1000)
    noisy = two_of_four(k=6, texels=1000, noise_percent=3)
    ratio = noisy.radiance / clean.radiance - 1
    # About 6000 samples: a standard deviation within 4 standard errors, 4 * 0.03 / sqrt(12,000).
    assert ratio.std() == pytest.approx(0.03, abs=1.1e-3)
    assert abs(ratio.mean()) < 4 * 0.03 / np.sqrt(ratio.size)


def test_ggx_truth_lies_outside_the_basis_but_near() -> None:
    p = two_of_four(k=3, truth="ggx", texels=300)
    assert p.truth_representatives.shape[1] == p.truth_basis.kernels != p.basis.kernels
    inside = in_basis(four_materials(0), p.basis)
    # Beckmann for GGX of equal roughness: the long tails are missing, some ten percent.
    assert 0.02 < p.novel(inside, p.truth_index, p.truth_weight) < 0.4


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_closed_outward_and_injective(name: str) -> None:
    mesh = shape(name, 48)
    corner = mesh.vertices[mesh.faces]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    # A closed surface's area vectors cancel, to rounding.
    assert np.abs(cross.sum(axis=0)).max() < 1e-12 * np.abs(cross).sum() + 1e-15
    assert np.einsum("fx,fx->", cross, corner[:, 0]) > 0
    flat = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    # Exact normals and a face's own differ by what the surface turns within a face: the bumps, 20 degrees.
    assert np.einsum("fcx,fx->fc", mesh.normals[mesh.faces], flat).min() > np.cos(np.radians(25))
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    assert uv_problem(mesh) is None


def test_a_capture_reads_back_and_shows_the_truth(tmp_path: Path) -> None:
    made = simulate_capture(tmp_path / "a", rows=24, k=2, test_views=1, size=24, noise_percent=5)
    clean = simulate_capture(tmp_path / "b", rows=24, k=1, test_views=1, size=24)
    capture, test = read_capture(made.folder), read_capture(made.test_folder)
    assert [frame.name for frame in capture.frames] == ["images/0001.exr", "images/0002.exr"]
    assert len(test.frames) == 1
    one, two = read_photograph(capture.frames[0]), read_photograph(read_capture(clean.folder).frames[0])
    assert np.array_equal(one.alpha, two.alpha)
    inside = two.alpha > 0.5
    ratio = (one.radiance[inside] / two.radiance[inside]) - 1
    # About 900 samples: 4 standard errors of a standard deviation of 5 %.
    assert ratio.std() == pytest.approx(0.05, abs=4 * 0.05 / np.sqrt(2 * ratio.size))
    reference = [read_photograph(read_capture(c.test_folder).frames[0]).radiance for c in (made, clean)]
    assert np.array_equal(*reference)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_demos_pattern_shows_every_material(seed: int) -> None:
    index, weight = blend_pattern(shape("peanut", 64).vertices, seed=seed, patches=5.0)
    # Four materials at equal shares would have a quarter each; none is a trace that no search could find.
    assert dense_weights(index, weight, 4).mean(axis=0).min() > 0.1


@pytest.mark.parametrize("count", [1, 6, 18])
def test_many_materials_are_plausible_and_distinct(count: int) -> None:
    recipes = many_materials(count, seed=3)
    assert recipes == many_materials(count, seed=3)
    assert len({recipe.name for recipe in recipes}) == count
    for recipe in recipes:
        assert all(0.03 <= lobe.tau <= 0.08 or 0.7 <= lobe.tau <= 0.9 for lobe in recipe.lobes)
        assert all(0.05 <= lobe.roughness <= 0.45 for lobe in recipe.lobes)
        # No channel reflects more than falls on it at normal incidence, where a lobe's albedo is at most tau.
        albedo = np.array(recipe.diffuse) + sum(lobe.tau * np.array(lobe.colour) for lobe in recipe.lobes)
        assert albedo.max() < 1
    # Under a white furnace and a lamp no two look alike: representatives differ in colour or in width.
    flat = in_basis(recipes, paper()).reshape(count, -1)
    apart = np.linalg.norm(flat[:, None] - flat, axis=-1)[np.triu_indices(count, 1)]
    assert (apart > 0.1).all()


def test_a_wide_pattern_shows_all_of_many_materials_and_blends_as_told() -> None:
    index, weight = blend_pattern(fibonacci_sphere(20_000), materials=18, blended=5, seed=0, patches=5.0)
    assert dense_weights(index, weight, 18).mean(axis=0).min() > 1 / 18 / 4
    # The smallest of five weights is above a twentieth at a good part of the points.
    assert (weight.min(axis=1) > 0.05).mean() > 0.15

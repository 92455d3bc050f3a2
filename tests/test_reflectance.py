# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Generic BRDFs: the published set, the model's symmetries, and what a basis refuses."""

from __future__ import annotations

import numpy as np
import pytest

from swatchwork.arrays import unit
from swatchwork.errors import InputError
from swatchwork.reflectance import (
    DIFFUSE_KERNELS,
    GenericBasis,
    basis_by_name,
    beckmann,
    extended,
    masking_value,
    paper,
)


def upper_directions(count: int, seed: int) -> np.ndarray:
    d = unit(np.random.default_rng(seed).normal(size=(count, 3)))
    d[:, 2] = np.abs(d[:, 2])
    return d


def test_paper_is_the_published_set() -> None:
    basis = paper()
    assert basis.kernels == 71
    assert 3 * basis.kernels == 213
    assert basis.sigmas[0] == pytest.approx(0.001)
    assert basis.sigmas[-1] == pytest.approx(0.5)
    ratios = basis.sigmas[1:] / basis.sigmas[:-1]
    np.testing.assert_allclose(ratios, ratios[0])
    # Exponents 5 and 0 of the Fresnel term are tau = 0 and tau = 1.
    assert [(lobe.masking, lobe.power) for lobe in basis.lobes[::35]] == [("vgroove", 5), ("vgroove", 0)]


def test_kernels_follow_the_stated_order() -> None:
    for basis in (paper(), extended()):
        powers, count = len(basis.fresnel), len(basis.sigmas)
        for g, masking in enumerate(basis.maskings):
            for f, power in enumerate(basis.fresnel):
                for s in (0, count // 2, count - 1):
                    assert basis.lobes[(g * powers + f) * count + s] == (masking, power, basis.sigmas[s])
        assert basis.kernels == len(basis.maskings) * powers * count + len(basis.diffuse)


@pytest.mark.parametrize("sigma", [0.01, 0.1, 0.5])
def test_beckmann_facets_cover_the_surface(sigma: float) -> None:
    # Projected facet area is 1: integral of D n.h over the hemisphere, by t = tan(alpha).
    t = np.linspace(0, 8 * sigma, 20001)
    cosine = 1 / np.sqrt(1 + t * t)
    density = beckmann(cosine, sigma) * cosine * 2 * np.pi * t * cosine**3
    # exp(-64) is left out, and the trapezoid rule is good to the step's square.
    assert np.trapezoid(density, t) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("masking", ["vgroove", "smith:0.2", "smith:0.5", "smith:1"])
def test_masking_lies_between_0_and_1_and_is_reciprocal(masking: str) -> None:
    i, o = upper_directions(500, 1), upper_directions(500, 2)
    h = unit(i + o)
    n_h, o_h = h[:, 2], np.sum(o * h, axis=1)
    value = masking_value(masking, i[:, 2], o[:, 2], o_h, n_h)
    assert ((value >= 0) & (value <= 1)).all()
    np.testing.assert_allclose(value, masking_value(masking, o[:, 2], i[:, 2], o_h, n_h))


def test_specular_kernels_are_reciprocal() -> None:
    i, o = upper_directions(200, 3), upper_directions(200, 4)
    basis = extended()
    lobes = list(range(len(basis.lobes)))
    np.testing.assert_allclose(basis.evaluate(i, o, lobes), basis.evaluate(o, i, lobes), rtol=1e-9)


def test_equation_8_by_hand() -> None:
    i, o = unit(np.array([0.3, 0.2, 0.9])), unit(np.array([-0.5, 0.1, 0.6]))
    h = unit(i + o)
    sigma, tan2 = 0.5, (1 - h[2] ** 2) / h[2] ** 2
    d = np.exp(-tan2 / sigma**2) / (np.pi * sigma**2 * h[2] ** 4)
    g = min(1, 2 * h[2] * i[2] / (o @ h), 2 * h[2] * o[2] / (o @ h))
    value = d * g / (4 * i[2] * o[2])
    found = paper().evaluate(i, o)
    assert found[69] == pytest.approx(value)
    assert found[34] == pytest.approx(value * (1 - o @ h) ** 5)
    assert found[70] == pytest.approx(1 / np.pi)


def test_nothing_is_reflected_below_the_surface() -> None:
    up, down = np.array([0.0, 0.6, 0.8]), np.array([0.6, 0.0, -0.8])
    assert not paper().evaluate(up, down).any()
    assert not paper().evaluate(down, up).any()


def test_diffuse_kernels_are_reciprocal_and_reflect_no_more_than_they_get() -> None:
    basis = GenericBasis("b", diffuse=tuple(DIFFUSE_KERNELS))
    diffuse = list(range(len(basis.lobes), basis.kernels))
    i, o = upper_directions(50, 5), upper_directions(50, 6)
    np.testing.assert_allclose(basis.evaluate(i, o, diffuse), basis.evaluate(o, i, diffuse))
    z = (np.arange(400) + 0.5) / 400
    light = np.stack([np.sqrt(1 - z * z), 0 * z, z], -1)
    for view in o[:10]:
        albedo = 2 * np.pi * np.mean(basis.evaluate(light, view, diffuse) * z[:, None], axis=0)
        # The midpoint rule of 400 points leaves less than 1e-4; ``lambert`` reflects all.
        assert (albedo < 1 + 1e-4).all()


@pytest.mark.parametrize("masking", ["smith", "smith:0", "smith:1.5", "smith:x", "torrance"])
def test_unknown_maskings_are_refused_by_name(masking: str) -> None:
    with pytest.raises(InputError, match=masking):
        GenericBasis("b", maskings=(masking,))


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="oren-nayar"):
        GenericBasis("b", diffuse=("oren-nayar",))
    with pytest.raises(InputError, match="finite values above 0"):
        GenericBasis("b", sigmas=np.array([0.1, -0.1]))
    with pytest.raises(InputError, match="'both'"):
        basis_by_name("both")


@pytest.mark.parametrize("n_o", [1.0, 0.7, 0.25])
@pytest.mark.parametrize("basis", [paper(), extended()], ids=lambda basis: basis.name)
def test_albedo_is_the_integral_over_the_hemisphere(basis: GenericBasis, n_o: float) -> None:
    """Uniform over the projected hemisphere, for kernels wide enough for 400 x 1600 directions."""
    radius, phi = np.sqrt((np.arange(400) + 0.5) / 400), 2 * np.pi * (np.arange(1600) + 0.5) / 1600
    r, p = np.meshgrid(radius, phi, indexing="ij")
    i = np.stack([r * np.cos(p), r * np.sin(p), np.sqrt(1 - r**2)], axis=-1).reshape(-1, 3)
    wide = [j for j, lobe in enumerate(basis.lobes) if lobe.sigma > 0.15]
    wide += range(len(basis.lobes), basis.kernels)
    o = np.array([np.sqrt(1 - n_o**2), 0, n_o])
    integral = np.pi * basis.evaluate(i, o, wide).mean(axis=0)
    # 64 quantiles end where 1 in 128 of the lobe is left, which a Fresnel term of the fifth power sees.
    np.testing.assert_allclose(basis.albedo(n_o)[wide], integral, rtol=0.01, atol=2e-3)
    # The sharpest lobe is a mirror: G F at n.i = n.o = o.h and n.h = 1.
    cosine = np.array([n_o])
    for j in range(0, len(basis.lobes), len(basis.sigmas)):
        lobe = basis.lobes[j]
        mirror = masking_value(lobe.masking, cosine, cosine, cosine, np.ones(1)) * (1 - n_o) ** lobe.power
        assert basis.albedo(n_o)[j] == pytest.approx(mirror[0], abs=1e-3)

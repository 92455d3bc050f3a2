# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The rendering operator against plain quadrature, analytic cases, and its own other versions."""

from __future__ import annotations

import numpy as np
import pytest

from swatchwork._native import Pyramid
from swatchwork.arrays import unit
from swatchwork.octahedral import direction_from_square, square_from_direction
from swatchwork.reflectance import DIFFUSE_KERNELS, GenericBasis, extended, paper
from swatchwork.response import (
    DEFAULT_QUADRATURE,
    generic_responses,
    instruction_sets,
    representative_responses,
)

EVERY = GenericBasis(
    "every", maskings=("vgroove", "smith:0.2", "smith:1"), diffuse=tuple(DIFFUSE_KERNELS), fresnel=(5, 2, 0)
)


def square_directions(size: int) -> np.ndarray:
    """Directions of the pixel centres of an octahedral raster [size, size, 3]."""
    centre = (np.arange(size) + 0.5) / size
    return direction_from_square(np.stack(np.meshgrid(centre, centre), -1))


def smooth(d: np.ndarray) -> np.ndarray:
    """A smooth coloured environment, above 0."""
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.stack([1 + 0.8 * x + 0.3 * y * z, 1.3 + z, 1 + y * y], -1)


def smooth_pyramid(size: int = 256) -> Pyramid:
    return Pyramid(smooth(square_directions(size)).astype(np.float32))


def random_pairs(count: int, seed: int, least_cosine: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    n, o = unit(rng.normal(size=(30 * count, 3))), unit(rng.normal(size=(30 * count, 3)))
    keep = np.flatnonzero(np.sum(n * o, axis=1) > least_cosine)[:count]
    return n[keep], o[keep]


def local_frame(n: np.ndarray, o: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    cosine = n @ o
    x = unit(o - cosine * n)
    return np.stack([x, np.cross(n, x), n]), np.array([np.sqrt(1 - cosine**2), 0, cosine])


def hemisphere_quadrature(basis: GenericBasis, n: np.ndarray, o: np.ndarray, side: int) -> np.ndarray:
    """Eq. 1 by the midpoint rule over the hemisphere, under ``smooth`` [J, 3]."""
    axes, viewer = local_frame(n, o)
    z, phi = (np.arange(side) + 0.5) / side, (np.arange(2 * side) + 0.5) / side * np.pi
    z, phi = (v.ravel() for v in np.meshgrid(z, phi))
    i = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], -1)
    weighted = basis.evaluate(i, viewer) * (z * 2 * np.pi / z.size)[:, None]
    return weighted.T @ smooth(i @ axes)


def test_broad_kernels_equal_quadrature_of_the_slow_brdf() -> None:
    sigmas = np.array([0.1, 0.2, 0.5])
    basis = GenericBasis(
        "broad", sigmas=sigmas, maskings=EVERY.maskings, diffuse=EVERY.diffuse, fresnel=(5, 2, 0)
    )
    n, o = random_pairs(12, 1)
    found = generic_responses(basis, smooth_pyramid(), n, o)
    truth = np.stack([hemisphere_quadrature(basis, a, b, 300) for a, b in zip(n, o, strict=True)])
    error = np.sqrt(np.sum((found - truth) ** 2, axis=(0, 2)) / np.sum(truth**2, axis=(0, 2)))
    # 24 rings leave half a percent in the broadest lobe; the midpoint rule itself 0.05 %.
    assert error.max() < 0.006, error


def test_sharp_kernels_see_the_mirrored_environment() -> None:
    basis = GenericBasis("sharp", sigmas=np.array([0.001, 0.01]), diffuse=())
    n, o = random_pairs(200, 2)
    cosine = np.sum(n * o, axis=1, keepdims=True)
    mirrored = smooth(2 * cosine * n - o)
    found = generic_responses(basis, smooth_pyramid(), n, o)
    # The square has creases, across which texels of 0.014 interpolate no better than 0.3 %. Of a lobe
    # of 0.01 a few facets at a cosine of 0.1 are masked or below the horizon.
    np.testing.assert_allclose(found[:, 2], mirrored, rtol=5e-3)
    np.testing.assert_allclose(found[:, 3], mirrored, rtol=2e-2)
    fresnel = (1 - cosine) ** 5
    np.testing.assert_allclose(found[:, 0], fresnel * mirrored, rtol=1e-2, atol=1e-5)


def test_white_furnace() -> None:
    # Under light 1 a response is the directional albedo, whatever the normal's place in the world.
    basis = EVERY
    flat = Pyramid(np.ones((128, 128, 3), np.float32))
    n, o = random_pairs(200, 3, 0.02)
    found = generic_responses(basis, flat, n, o)
    assert (found >= 0).all()
    # Energy: with the V-groove term no kernel reflects more than it gets; 0.5 % for the quadrature. A
    # masking that does not know the roughness promises no such thing.
    grooved = [j for j, lobe in enumerate(basis.lobes) if lobe.masking == "vgroove"]
    assert found[:, grooved].max() < 1.005
    white = basis.diffuse.index("lambert") + len(basis.lobes)
    # A mask cell is 0.055 across: the horizon's steps leave 0.2 %.
    np.testing.assert_allclose(found[:, white], 1, atol=2e-3)
    np.testing.assert_allclose(found.mean(axis=2), found[..., 0], rtol=1e-5)


def test_albedo_depends_on_the_view_angle_alone() -> None:
    flat = Pyramid(np.ones((64, 64, 3), np.float32))
    rng = np.random.default_rng(4)
    n = unit(rng.normal(size=(50, 3)))
    tangent = unit(np.cross(n, rng.normal(size=(50, 3))))
    o = 0.6 * n + 0.8 * tangent
    found = generic_responses(paper(), flat, n, o)[:, :70, 0]
    # Only rounding of the frames, and of values near the horizon's cut, differs.
    np.testing.assert_allclose(found, np.broadcast_to(found[:1], found.shape), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("sigma", [0.05, 0.15, 0.5])
def test_single_lit_pixel(sigma: float) -> None:
    # One texel far above the mean: its response is the BRDF there, times cosine and power.
    size, radiance = 512, 1e4
    basis = GenericBasis("lit", sigmas=np.array([sigma]))
    rng = np.random.default_rng(5)
    n, o = random_pairs(60, 6, 0.3)
    for k in range(0, 60, 6):
        axes, viewer = local_frame(n[k], o[k])
        t = sigma * 0.7
        phi = rng.uniform(0, 2 * np.pi)
        h = unit(np.array([t * np.cos(phi), t * np.sin(phi), 1]))
        i = 2 * (h @ viewer) * h - viewer
        if i[2] < 0.2:
            continue
        base = np.zeros((size, size, 3), np.float32)
        column, row = (square_from_direction(i @ axes) * size).astype(int)
        base[row, column] = radiance
        lit = axes @ square_directions(size)[row, column]
        truth = basis.evaluate(lit, viewer) * lit[2] * radiance * 4 * np.pi / size**2
        found = generic_responses(basis, Pyramid(base), n[k : k + 1], o[k : k + 1])[0, :, 0]
        # Linear shares between light bins: 1 % where D bends most. Lambert sees the cell's centre,
        # up to 0.03 from the texel.
        np.testing.assert_allclose(found[:2], truth[:2], rtol=0.02)
        np.testing.assert_allclose(found[2], truth[2], rtol=0.15)


def half_space_mask(toward: np.ndarray) -> np.ndarray:
    """Sky mask [1, 64] that sees only directions with d . toward > 0."""
    bits = square_directions(64) @ toward > 0
    return (bits.astype(np.uint64) << np.arange(64, dtype=np.uint64)).sum(axis=1, dtype=np.uint64)[None]


def test_half_the_sky_gives_half_of_diffuse_light() -> None:
    flat = Pyramid(np.ones((64, 64, 3), np.float32))
    n = np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 0, -1.0], [0, 0, 1.0]])
    mask = np.concatenate([half_space_mask(np.array([1.0, 0, 0])), half_space_mask(np.array([0, 0, 1.0]))])
    row = np.array([0, 1, 1, -1], np.int32)
    found = generic_responses(GenericBasis("d", sigmas=np.array([0.3])), flat, n, n, mask, row)
    # By symmetry, exactly but for rounding; below, nothing is visible; -1 sees everything.
    np.testing.assert_allclose(found[:, 2, 0], [0.5, 1, 0, 1], atol=2e-3)
    np.testing.assert_allclose(found[0, :2], 0.5 * found[3, :2], rtol=1e-2)
    np.testing.assert_allclose(found[1], found[3], rtol=1e-3)
    assert not found[2].any()


def test_a_mask_hides_what_a_mirror_shows() -> None:
    pyramid = smooth_pyramid()
    basis = GenericBasis("mirror", sigmas=np.array([0.001]), diffuse=())
    n, o = random_pairs(300, 7)
    mirrored = 2 * np.sum(n * o, axis=1, keepdims=True) * n - o
    toward = unit(np.array([0.3, -0.5, 0.8]))
    found = generic_responses(basis, pyramid, n, o, half_space_mask(toward), np.zeros(len(n), np.int32))
    side = mirrored @ toward
    # Cells are up to 0.1 across; next to the border either answer is right.
    assert (found[side > 0.1, 1] > 0.1).all()
    assert not found[side < -0.1].any()


def test_masks_hide_point_lights() -> None:
    base = np.full((128, 128, 3), 0.01, np.float32)
    base[64, 64] = 1e5
    light = square_directions(128)[64, 64]
    pyramid = Pyramid(base)
    assert pyramid.lights[0] > 0
    n = unit(light + np.array([0.2, 0.1, 0]))[None]
    rows = np.zeros(1, np.int32)
    basis = GenericBasis("b", sigmas=np.array([0.2, 0.5]))
    open_sky = generic_responses(basis, pyramid, n, n)
    hidden = generic_responses(basis, pyramid, n, n, half_space_mask(-light), rows)
    shown = generic_responses(basis, pyramid, n, n, half_space_mask(light), rows)
    assert (hidden[0, 2:] < 1e-2 * open_sky[0, 2:]).all()
    np.testing.assert_allclose(shown[0, 2:], open_sky[0, 2:], rtol=1e-2)


def test_folded_representatives_equal_combined_kernels() -> None:
    pyramid = smooth_pyramid(64)
    n, o = random_pairs(37, 8)
    for basis in (paper(), extended()):
        weights = np.random.default_rng(9).random((4, basis.kernels, 3))
        kernels = generic_responses(basis, pyramid, n, o).astype(np.float64)
        found = representative_responses(basis, weights, pyramid, n, o)
        # Single-precision sums of some hundred terms.
        np.testing.assert_allclose(found, np.einsum("njc,pjc->pnc", weights, kernels), rtol=1e-5)


def test_instruction_sets_agree() -> None:
    rng = np.random.default_rng(10)
    base = rng.gamma(0.3, 1.0, size=(128, 128, 3)).astype(np.float32)
    base[30, 40] = 3e4
    pyramid = Pyramid(base)
    n, o = random_pairs(101, 11, 0.03)
    row = rng.integers(-1, 3, 101).astype(np.int32)
    sky = rng.integers(0, 2**63, (3, 64)).astype(np.uint64) * 2 + 1
    results = [
        generic_responses(EVERY, pyramid, n, o, sky, row, instruction_set=name) for name in instruction_sets()
    ]
    for other in results[1:]:
        # Half precision keeps 11 bits of a texel; a sample on a level's or a cell's border may fall on
        # either side of it.
        scale = np.sqrt(np.mean(results[0] ** 2, axis=(0, 2)))
        error = np.sqrt(np.mean((other - results[0]) ** 2, axis=(0, 2)))
        assert (error < 2e-3 * scale).all()


def test_same_inputs_give_the_same_bits_wherever_they_stand() -> None:
    pyramid = smooth_pyramid(64)
    n, o = random_pairs(50, 12)
    whole = generic_responses(extended(), pyramid, n, o)
    np.testing.assert_array_equal(whole, generic_responses(extended(), pyramid, n, o))
    np.testing.assert_array_equal(whole[17:30], generic_responses(extended(), pyramid, n[17:30], o[17:30]))


def test_surfaces_seen_from_behind_give_zero() -> None:
    n, o = random_pairs(20, 13)
    assert not generic_responses(extended(), smooth_pyramid(64), n, -o).any()


def test_no_pairs_and_no_representatives() -> None:
    empty = np.zeros((0, 3))
    assert generic_responses(paper(), smooth_pyramid(64), empty, empty).shape == (0, 71, 3)
    n, o = random_pairs(3, 14)
    none = representative_responses(paper(), np.zeros((0, 71, 3)), smooth_pyramid(64), n, o)
    assert none.shape == (3, 0, 3)


def test_ring_weights_are_probabilities() -> None:
    for sigma in paper().sigmas:
        weights = DEFAULT_QUADRATURE.weights(float(sigma))[: DEFAULT_QUADRATURE.azimuths.size]
        assert weights.sum() == pytest.approx(1)
        assert (weights >= 0).all()


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("normal", {"normal": np.full((4, 3), np.nan)}),
        ("to_viewer", {"to_viewer": np.ones((3, 3))}),
        ("sky_row", {"sky_row": np.full(4, 2, np.int32)}),
        ("sky_row", {"sky_row": np.full(3, -1, np.int32)}),
        ("sky", {"sky": np.zeros((1, 63), np.uint64)}),
        ("instruction_set", {"instruction_set": "mmx"}),
    ],
)
def test_errors_name_the_argument(name: str, change: dict[str, object]) -> None:
    pairs = {"normal": np.eye(4, 3), "to_viewer": np.eye(4, 3)}
    with pytest.raises(ValueError, match=name):
        generic_responses(paper(), smooth_pyramid(64), **(pairs | change))


def test_pyramids_refuse_what_is_not_radiance() -> None:
    with pytest.raises(ValueError, match="power of two"):
        Pyramid(np.ones((48, 48, 3), np.float32))
    with pytest.raises(ValueError, match=r"expected \[S, S, 3\]"):
        Pyramid(np.ones((64, 32, 3), np.float32))
    bad = np.ones((64, 64, 3), np.float32)
    bad[5, 7, 1] = -1
    with pytest.raises(ValueError, match="row 5, column 7"):
        Pyramid(bad)
    with pytest.raises(ValueError, match="representatives"):
        representative_responses(paper(), np.zeros((2, 70, 3)), smooth_pyramid(64), np.eye(3), np.eye(3))

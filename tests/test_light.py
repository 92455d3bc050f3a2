# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Environment maps: conventions, lookups, energy; the formulas of the design, written out once more."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from swatchwork.arrays import unit
from swatchwork.capture import CONVENTIONS, EnvironmentSource, write_exr, write_png
from swatchwork.errors import InputError
from swatchwork.light import (
    Environment,
    direction_from_uv,
    read_environment,
    solid_angles,
    uv_from_direction,
)
from swatchwork.octahedral import direction_from_square, pixel_directions, square_from_direction

SPHERE = unit(np.random.default_rng(5).normal(size=(2000, 3)))
AXES = np.vstack([np.eye(3), -np.eye(3)])
X, Y, Z = np.eye(3)
# World axes as each convention has them, by name: where "up" and the image's centre are.
UP = {"blender": Z, "mitsuba": Y}
# The lat-long probes of the shared data: `mitsuba` turned by half a turn about y, so that -z is central.
HALF_TURN = np.diag([-1.0, 1.0, -1.0])


def raster_shape(convention: str, width: int = 64) -> tuple[int, int, int]:
    return (width if convention == "debevec-angular" else width // 2, width, 3)


def smooth(convention: str, width: int = 64) -> Environment:
    """A cubic in the direction: what one raster samples from it, another must too."""
    empty = Environment(np.ones(raster_shape(convention, width), np.float32), convention)
    return Environment(np.nan_to_num(cubic(empty.directions())).astype(np.float32), convention)


def cubic(d: np.ndarray) -> np.ndarray:
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.stack([2 + x, 2 + y * z, 2 + z + x * y * z], axis=-1)


def twin(convention: str, u: float, v: float) -> np.ndarray:
    """The design's formulas for one point."""
    if convention == "blender":
        phi, theta = np.pi - 2 * np.pi * u, np.pi * v
        return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    if convention == "mitsuba":
        # u = atan2(x, -z) / 2 pi, v = acos(y) / pi
        phi, theta = 2 * np.pi * u, np.pi * v
        return np.array([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)])
    a, b = 2 * u - 1, 1 - 2 * v
    theta, phi = np.pi * np.hypot(a, b), np.arctan2(b, a)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)])


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_directions_follow_the_formulas(convention: str) -> None:
    uv = np.random.default_rng(0).uniform(0.2, 0.8, (100, 2))
    expected = np.array([twin(convention, *point) for point in uv])
    np.testing.assert_allclose(direction_from_uv(convention, uv), expected, atol=1e-14)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_uv_and_direction_undo_each_other(convention: str) -> None:
    uv = uv_from_direction(convention, SPHERE)
    assert ((uv >= 0) & (uv <= 1)).all()
    np.testing.assert_allclose(direction_from_uv(convention, uv), SPHERE, atol=1e-12)
    single = uv_from_direction(convention, SPHERE.astype(np.float32))
    assert single.dtype == np.float32
    # Float32 angles: a few roundings of 1.2e-7, hundreds of times finer than a pixel of a 4096 map.
    np.testing.assert_allclose(direction_from_uv(convention, single), SPHERE, atol=5e-6)
    assert np.isfinite(uv_from_direction(convention, AXES)).all()


LANDMARKS = [
    # convention, (u, v), direction
    ("blender", (0.5, 0.5), X),
    ("blender", (0.25, 0.5), Y),
    ("blender", (0.5, 0.0), Z),
    ("mitsuba", (0.5, 0.5), Z),
    ("mitsuba", (0.25, 0.5), X),
    ("mitsuba", (0.5, 0.0), Y),
    ("mitsuba", (0.0, 0.5), -Z),
    ("debevec-angular", (0.5, 0.5), -Z),
    ("debevec-angular", (0.75, 0.5), X),
    ("debevec-angular", (0.5, 0.25), Y),
    ("debevec-angular", (1.0, 0.5), Z),
]


@pytest.mark.parametrize(("convention", "uv", "d"), LANDMARKS)
def test_landmarks(convention: str, uv: tuple[float, float], d: np.ndarray) -> None:
    np.testing.assert_allclose(direction_from_uv(convention, np.array(uv)), d, atol=1e-15)
    np.testing.assert_allclose(uv_from_direction(convention, d), uv, atol=1e-15)


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("pixel", [(10, 22), (20, 33), (12, 45)])
def test_one_bright_texel(convention: str, pixel: tuple[int, int]) -> None:
    height, width, _ = raster_shape(convention)
    row, column = pixel if convention != "debevec-angular" else (pixel[0] + 10, pixel[1])
    radiance = np.zeros((height, width, 3), np.float32)
    radiance[row, column] = 8
    d = twin(convention, (column + 0.5) / width, (row + 0.5) / height)
    environment = Environment(radiance, convention)
    np.testing.assert_allclose(environment.lookup(d), 8, rtol=1e-9)
    np.testing.assert_allclose(environment.directions()[row, column], d, atol=1e-14)

    # No other convention sees it there.
    lit = environment.lookup(SPHERE)[:, 0] > 0
    assert (SPHERE[lit] @ d > np.cos(0.2)).all(), "within two pixels' diagonal"
    for other in CONVENTIONS:
        if other != convention and raster_shape(other) == radiance.shape:
            assert not Environment(radiance, other).lookup(d).any()

    # The octahedral raster has the light in the same place and of the same energy.
    square = environment.octahedral(128)
    towards = (square[..., :1] * pixel_directions(128)).sum(axis=(0, 1))
    np.testing.assert_allclose(unit(towards), d, atol=2e-3)  # bilinear tents lean towards the poles
    bright = radiance[..., 0] * solid_angles(convention, height, width)
    # One bilinear tent is not exactly a pixel's solid angle where rows differ in size: second order in
    # the pixel, (pi / 32)^2 / 12 times the curvature of the sine at most.
    np.testing.assert_allclose(square[..., 0].mean() * 4 * np.pi, bright.sum(), rtol=5e-3)


@pytest.mark.parametrize("a", CONVENTIONS)
@pytest.mark.parametrize("b", CONVENTIONS)
def test_conventions_agree_on_the_same_light(a: str, b: str) -> None:
    one, other = smooth(a, 128), smooth(b, 128)
    # Bilinear interpolation is off by (pixel^2 / 8) times the second derivative, (2 pi / 128)^2 / 8 * 9,
    # and a little more at an angular map's rim, where a pixel is a long thin slice.
    np.testing.assert_allclose(one.lookup(SPHERE), other.lookup(SPHERE), atol=5e-3)
    np.testing.assert_allclose(one.octahedral(32), other.octahedral(32), atol=5e-3)
    np.testing.assert_allclose(one.mean_radiance, other.mean_radiance, atol=1e-3)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_lookups_are_smooth_across_seam_poles_and_rim(convention: str) -> None:
    environment = smooth(convention, 128)
    near = unit(np.vstack([AXES + 0.01 * SPHERE[:6], AXES, AXES + 1e-9 * SPHERE[:6]]))
    np.testing.assert_allclose(environment.lookup(near), cubic(near), atol=3e-3)


def test_what_lies_outside_an_angular_maps_disc_has_no_effect() -> None:
    clean = smooth("debevec-angular")
    for junk in (1e6, np.nan, -5.0):
        dirty = clean.radiance.copy()
        dirty[clean.solid_angles == 0] = junk
        environment = Environment(dirty, "debevec-angular")
        np.testing.assert_array_equal(environment.lookup(SPHERE), clean.lookup(SPHERE))
        np.testing.assert_array_equal(environment.octahedral(32), clean.octahedral(32))
        np.testing.assert_array_equal(environment.mean_radiance, clean.mean_radiance)
    assert np.isnan(direction_from_uv("debevec-angular", np.array([0.02, 0.02]))).all()


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_solid_angles_make_a_sphere(convention: str) -> None:
    weights = solid_angles(convention, *raster_shape(convention)[:2])
    np.testing.assert_allclose(weights.sum(), 4 * np.pi, rtol=1e-12)
    # Twin: the directions' Jacobian by differences.
    environment = smooth(convention, 512)
    d = environment.directions()
    cell = np.linalg.norm(np.cross(d[2:, 1:-1] - d[:-2, 1:-1], d[1:-1, 2:] - d[1:-1, :-2]), axis=-1) / 4
    inner = np.isfinite(cell) & (cell > 1e-6)
    np.testing.assert_allclose(environment.solid_angles[1:-1, 1:-1][inner], cell[inner], rtol=1e-2)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_constant_light_stays_constant(convention: str) -> None:
    environment = Environment(np.full(raster_shape(convention), 3.0), convention).rotated(HALF_TURN)
    np.testing.assert_allclose(environment.lookup(SPHERE), 3, rtol=1e-12)
    np.testing.assert_allclose(environment.octahedral(16), 3, rtol=1e-6)
    np.testing.assert_allclose(environment.mean_radiance, 3, rtol=1e-12)


def test_rotation_turns_the_light_in_the_world() -> None:
    environment = smooth("mitsuba")
    rotation, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    turned = environment.rotated(rotation)
    np.testing.assert_allclose(turned.lookup(SPHERE @ rotation.T), environment.lookup(SPHERE), atol=1e-9)
    d = pixel_directions(32)
    # A pixel's mean is its centre's value to second order in its size.
    np.testing.assert_allclose(turned.octahedral(32), environment.lookup(d @ rotation), atol=2e-2)
    again = turned.rotated(rotation.T)
    np.testing.assert_allclose(again.world_from_environment, np.eye(3), atol=1e-12)


def test_octahedral_map_is_equal_area_and_invertible() -> None:
    ab = square_from_direction(SPHERE)
    np.testing.assert_allclose(direction_from_square(ab), SPHERE, atol=1e-12)
    np.testing.assert_allclose(square_from_direction(Z), [0.5, 0.5])
    np.testing.assert_allclose(square_from_direction(X), [1.0, 0.5])
    np.testing.assert_allclose(square_from_direction(Y), [0.5, 1.0])
    np.testing.assert_allclose(square_from_direction(unit(np.array([1, 1, 0]))), [0.75, 0.75])
    assert np.isfinite(direction_from_square(np.array([[0.5, 0.5], [0, 0], [1, 0], [0.5, 0]]))).all()
    single = SPHERE.astype(np.float32)
    assert direction_from_square(square_from_direction(single)).dtype == np.float32
    # Seven digits, through half a dozen operations.
    np.testing.assert_allclose(direction_from_square(square_from_direction(single)), SPHERE, atol=2e-6)
    d = pixel_directions(64)
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1, atol=1e-14)
    # Equal area: means over the square are means over the sphere. 64^2 midpoints leave 1e-3.
    np.testing.assert_allclose(d.mean(axis=(0, 1)), 0, atol=1e-3)
    np.testing.assert_allclose((d**2).mean(axis=(0, 1)), 1 / 3, atol=1e-3)


def test_octahedral_means_of_a_large_raster_keep_its_energy() -> None:
    rng = np.random.default_rng(4)
    radiance = np.where(rng.random((256, 512, 1)) < 0.01, rng.random((256, 512, 3)) * 100, 0.1)
    environment = Environment(radiance, "blender")
    for size in (8, 32, 256):
        mean = environment.octahedral(size).mean(axis=(0, 1))
        # Thirteen hundred one-pixel lamps, each met by chance by a few dozen of the lookups.
        np.testing.assert_allclose(mean, environment.mean_radiance, rtol=5e-3)


def test_default_base_size() -> None:
    for width, expected in ((64, 128), (100, 256), (1024, 2048), (2050, 2048)):
        environment = Environment(np.ones((width // 2, width, 3), np.float32), "blender")
        assert environment.base_size == expected


def test_pyramid_is_built_once() -> None:
    environment = smooth("blender")
    assert environment.pyramid().size == 128
    assert environment.pyramid() is environment.pyramid(128)
    assert environment.pyramid(32) is not environment.pyramid()


BAD = [
    (np.zeros((4, 8, 3)), "blender", "all black; expected some light"),
    (
        np.ones((4, 9, 3)),
        "blender",
        "the environment is 9 x 4; expected twice as wide as high, by its convention",
    ),
    (np.ones((4, 8, 3)), "debevec-angular", "the environment is 8 x 4; expected a square"),
    (np.ones((4, 8)), "mitsuba", "shape [4, 8]; expected [H, W, 3]"),
    (np.ones((4, 8, 3)), "maya", "convention 'maya'; expected one of blender"),
    (np.full((4, 8, 3), np.nan), "blender", "32 pixels are NaN or infinite"),
    (np.full((4, 8, 3), -1.0), "blender", "32 pixels are negative, down to -1"),
]


@pytest.mark.parametrize(("radiance", "convention", "message"), BAD)
def test_refuses(radiance: np.ndarray, convention: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        Environment(radiance, convention)
    assert message in str(caught.value)


def test_reading_names_the_file(tmp_path: Path) -> None:
    write_exr(tmp_path / "black.exr", np.zeros((4, 8, 3)))
    with pytest.raises(InputError, match=r"black\.exr: the environment is all black"):
        read_environment(EnvironmentSource(tmp_path / "black.exr", "blender"))
    with pytest.raises(InputError, match=r"none\.exr: no such file"):
        read_environment(EnvironmentSource(tmp_path / "none.exr", "blender"))
    write_png(tmp_path / "low.png", np.zeros((4, 8, 3), np.uint8))
    with pytest.raises(InputError, match=r"type '\.png'; expected an HDR image"):
        read_environment(EnvironmentSource(tmp_path / "low.png", "blender"))
    (tmp_path / "cut.exr").write_bytes((tmp_path / "black.exr").read_bytes()[:-40])
    with pytest.raises(InputError, match=r"cut\.exr: cannot be read"):
        read_environment(EnvironmentSource(tmp_path / "cut.exr", "blender"))


# Integrals over the sphere that the data's own notes list.
INTEGRALS = {
    "stpeters": (12.79, 9.24, 8.18),
    "grace": (8.94, 4.92, 6.11),
    "rnl": (13.34, 15.04, 15.91),
    "uffizi": (11.17, 10.83, 12.33),
}


def probe(shared: Path, name: str) -> Environment:
    return read_environment(
        EnvironmentSource(shared / f"data/envmaps/latlong/{name}_1024x512.hdr", "mitsuba", HALF_TURN)
    )


@pytest.mark.parametrize("name", INTEGRALS)
def test_real_probes_keep_their_energy(shared: Path, name: str) -> None:
    environment = probe(shared, name)
    integral = environment.mean_radiance * 4 * np.pi
    np.testing.assert_allclose(integral, INTEGRALS[name], atol=0.006)  # listed to two decimals
    for size in (64, 1024):
        square = environment.octahedral(size)
        np.testing.assert_allclose(square.mean(axis=(0, 1)) * 4 * np.pi, integral, rtol=2e-3)  # seen: 1.1e-3


@pytest.mark.parametrize("name", ["grace", "rnl"])
def test_angular_probe_agrees_with_its_latlong_resampling(shared: Path, name: str) -> None:
    latlong = probe(shared, name)
    angular = read_environment(
        EnvironmentSource(shared / f"data/envmaps/{name}_probe.hdr", "debevec-angular")
    )
    a, b = latlong.octahedral(64), angular.octahedral(64)
    # The lat-long files were written with RGBE mantissas rounded down: half a step of 1/128 to 1/256.
    np.testing.assert_allclose(angular.mean_radiance, latlong.mean_radiance, rtol=7e-3)
    # Both are resamplings of one picture: a lamp on a pixel's border is shared out a little differently.
    assert np.linalg.norm(a - b) < 0.03 * np.linalg.norm(a)
    # Mirrored or turned by a quarter, they would not agree at all.
    for wrong in (np.diag([-1.0, 1, 1]), np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])):
        c = angular.rotated(wrong).octahedral(64)
        assert np.linalg.norm(a - c) > 0.5 * np.linalg.norm(a)

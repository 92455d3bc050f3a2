# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Light that the object sends to itself: against form factors, radiosity, brute force and Mitsuba 3."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from swatchwork.arrays import F64
from swatchwork.interreflection import (
    IndirectLight,
    Reflecting,
    Surroundings,
    bounces_of,
    surroundings,
)
from swatchwork.light import Environment
from swatchwork.observe import Lights
from swatchwork.reflectance import GenericBasis, paper
from swatchwork.response import representative_responses
from swatchwork.surface import Mesh, RayScene, SkyMasks, build_atlas, padded, sky_masks

ALBEDO = np.array([0.8, 0.5, 0.2])
RESOLUTION = 64
LAMBERT = paper().kernels - 1


def corner(depth: float = 1.0) -> Mesh:
    """Two perpendicular squares that share an edge: the floor z = 0 and the wall y = 0, both 1 x ``depth``.

    The floor's UVs are the left half of the square, the wall's the right one, each with a margin.
    """
    floor = np.array([[0, 0, 0], [1, 0, 0], [1, depth, 0], [0, depth, 0]], dtype=np.float64)
    wall = np.array([[0, 0, 0], [0, 0, depth], [1, 0, depth], [1, 0, 0]], dtype=np.float64)
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    left = 0.03 + square * [0.44, 0.94]
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], dtype=np.int32)
    normals = np.repeat([[0.0, 0, 1], [0, 1, 0]], 4, axis=0)
    # The wall's corners go round the other way.
    uv = np.concatenate([left, left[[0, 3, 2, 1]] + [0.5, 0]])
    return Mesh(np.concatenate([floor, wall]), faces, normals, uv)


class Corner:
    """The corner of one material under a light, ready for bounces."""

    def __init__(
        self, light: Environment, basis: GenericBasis, representative: F64, places: int = 4000
    ) -> None:
        self.mesh = corner()
        self.rays = RayScene([self.mesh])
        self.atlas = build_atlas(self.mesh, RESOLUTION)
        self.sky: SkyMasks = sky_masks(self.rays, self.atlas)
        self.pixels = padded(self.atlas)
        self.lights = Lights((light,), np.zeros(1, np.int32), np.eye(3)[None])
        self.basis, self.representatives = basis, representative[None]
        self.index = np.zeros((RESOLUTION, RESOLUTION, 1), np.uint8)
        self.weight = np.ones((RESOLUTION, RESOLUTION, 1), np.float32)
        self.around: Surroundings = surroundings(self.rays, self.atlas, self.sky, self.pixels, places=places)

    @property
    def surface(self) -> Reflecting:
        return Reflecting(
            self.atlas, self.basis, self.representatives, self.index, self.weight, self.sky, self.lights
        )

    def shown(self, light: IndirectLight, texel: np.ndarray, to_viewer: np.ndarray) -> F64:
        """What texels [T] reflect of it towards viewers, [T, 3]."""
        found = light.responses(
            np.zeros(len(texel), np.int32),
            texel,
            self.atlas.normal(texel),
            np.broadcast_to(to_viewer, (len(texel), 3)),
            1,
            partial(representative_responses, self.basis, self.representatives),
        )
        return found[:, 0].astype(np.float64)


def even_light() -> Environment:
    return Environment(np.ones((16, 32, 3), np.float32), "mitsuba")


def diffuse(albedo: np.ndarray = ALBEDO) -> F64:
    found = np.zeros((paper().kernels, 3))
    found[LAMBERT] = albedo
    return found


def form_factor(along: F64, away: F64) -> F64:
    """Of points of the floor, ``along`` the edge and ``away`` from it, to the unit wall, in closed form.

    A point below the end of a wall of width b and height a sees of it (Howell's catalogue, B-4, with
    X = a / b, Y = c / b): (atan(1 / Y) - Y / sqrt(X^2 + Y^2) atan(1 / sqrt(X^2 + Y^2))) / (2 pi).
    """
    total = np.zeros_like(along)
    for b in (along, 1 - along):
        X, Y = 1 / b, away / b
        slant = np.sqrt(X**2 + Y**2)
        total += (np.arctan(1 / Y) - Y / slant * np.arctan(1 / slant)) / (2 * np.pi)
    return total


@pytest.fixture(scope="module")
def plain() -> Corner:
    return Corner(even_light(), paper(), diffuse())


def on_floor(scene: Corner, margin: float = 0.08) -> tuple[np.ndarray, F64]:
    """Texels of the floor at least ``margin`` from all edges, and where they lie."""
    texel = np.flatnonzero(scene.atlas.normal(slice(None))[:, 2] > 0.5)
    x = scene.atlas.position(texel)
    kept = (x[:, :2] > margin).all(axis=1) & (x[:, :2] < 1 - margin).all(axis=1)
    return texel[kept], x[kept]


def test_perpendicular_squares_have_their_form_factor(plain: Corner) -> None:
    texel, x = on_floor(plain)
    even = IndirectLight(
        plain.around, np.ones((1, len(plain.around.cell), 3), np.float32), np.zeros(1, np.int32)
    )
    found = plain.shown(even, texel, np.array([0.0, 0, 1]))
    wanted = form_factor(x[:, 0], x[:, 1])[:, None] * ALBEDO
    # Masks have cells of 3 degrees, one for texels nearby: 2 % of the largest.
    assert np.abs(found - wanted).max() < 0.02 * wanted.max()
    assert found.mean() == pytest.approx(wanted.mean(), rel=0.01)


def radiosity(patches: int, albedo: np.ndarray, bounces: int) -> tuple[F64, F64]:
    """Brute force: centres [Q, 2] of floor patches (along, away), and their irradiance / pi from the wall.

    Both squares are cut into patches x patches, each pair's form factor is cos cos / (pi r^2) dA, under an
    even sky of radiance 1; by symmetry the wall shows what the floor does.
    """
    c = (np.arange(patches) + 0.5) / patches
    x, y = (a.ravel() for a in np.meshgrid(c, c, indexing="ij"))
    dx = x[:, None] - x[None]
    # From (x, y, 0) with normal z to (x', 0, z') with normal y.
    r2 = dx**2 + y[:, None] ** 2 + y[None] ** 2
    F = y[:, None] * y[None] / (np.pi * r2**2) / patches**2
    sky = 1 - form_factor(x, y)
    shown = albedo * sky[:, None]
    received = F @ shown
    for _ in range(1, bounces):
        received = F @ (albedo * (sky[:, None] + received))
    return np.stack([x, y], axis=1), received


@pytest.mark.parametrize("bounces", [1, 2, 3])
def test_agrees_with_radiosity(plain: Corner, bounces: int) -> None:
    light = bounces_of(plain.surface, plain.around, bounces)
    texel, x = on_floor(plain, 0.15)
    found = plain.shown(light, texel, np.array([0.0, 0.6, 0.8])) / ALBEDO
    centres, received = radiosity(40, ALBEDO, bounces)
    nearest = ((centres[None] - x[:, None, :2]) ** 2).sum(axis=2).argmin(axis=1)
    wanted = received[nearest]
    # One ray a cell, cells of 14 degrees shared by texels nearby, and patches of a fortieth.
    assert np.sqrt(((found - wanted) ** 2).sum() / (wanted**2).sum()) < 0.04
    np.testing.assert_allclose(found.mean(axis=0), wanted.mean(axis=0), rtol=0.015)

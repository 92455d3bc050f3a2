# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Light that the object sends to itself: against form factors, radiosity, brute force and Mitsuba 3."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.arrays import F64, unit
from swatchwork.capture import (
    Camera,
    Capture,
    EnvironmentSource,
    Frame,
    read_capture,
    read_image,
    write_capture,
    write_exr,
)
from swatchwork.interreflection import (
    IndirectLight,
    Reflecting,
    Surroundings,
    bounced,
    bounces_of,
    indirect_share,
    surroundings,
)
from swatchwork.keeping import IN_MEMORY, Array, Kept
from swatchwork.light import Environment
from swatchwork.observe import Lights
from swatchwork.reconstruct import Reconstruction, ReconstructOptions, reconstruct
from swatchwork.reflectance import GenericBasis, paper
from swatchwork.relight import RelitScene, render
from swatchwork.response import representative_responses
from swatchwork.simulate.viewpoints import look_at
from swatchwork.solve import SolveOptions
from swatchwork.surface import (
    Mesh,
    RayScene,
    SkyMasks,
    build_atlas,
    padded,
    sky_masks,
    sphere_mesh,
    write_mesh_obj,
)
from swatchwork.workflow import reconstruct_folder, relight_folder

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


def glossy() -> tuple[GenericBasis, F64]:
    """A rough lobe with V-groove masking over a diffuse base, in three colours."""
    basis = GenericBasis("glossy", sigmas=np.array([0.3]))
    return basis, np.array([[0.8, 0.7, 0.6], [0.2, 0.2, 0.2], [0.3, 0.2, 0.1]])


def smooth_light() -> Environment:
    """Coloured light with a broad bright lobe."""
    directions = Environment(np.ones((64, 128, 3), np.float32), "mitsuba").directions()
    lobe = np.exp(4 * (directions @ np.array([0.48, 0.6, 0.64]) - 1))[..., None]
    return Environment((0.2 + np.array([3.0, 2.0, 1.0]) * lobe).astype(np.float32), "mitsuba")


def brute_force(scene: Corner, x: F64, to_viewer: F64, count: int = 4096) -> F64:
    """What points [T, 3] of the floor reflect of the wall, [T, 3]: an even grid over it, no rays, no cells.

    The wall's own radiance is the operator's, which other tests hold against quadrature.
    """
    side = int(np.sqrt(count))
    c = (np.arange(side) + 0.5) / side
    y = np.stack([*(a.ravel() for a in np.meshgrid(c, c)), np.zeros(side * side)], axis=1)[:, [0, 2, 1]]
    wall = np.flatnonzero(scene.atlas.normal(slice(None))[:, 1] > 0.5)
    place = scene.atlas.position(wall)
    texel = wall[((place[None] - y[:, None]) ** 2).sum(axis=2).argmin(axis=1)]
    found = np.empty((len(x), 3))
    environment = scene.lights.environments[0]
    for t, point in enumerate(x):
        away = y - point
        r2 = (away**2).sum(axis=1)
        i = away / np.sqrt(r2)[:, None]
        normal = np.broadcast_to([0.0, 1, 0], i.shape)
        sky = scene.sky.words, scene.sky.of_texel[texel]
        shown = representative_responses(
            scene.basis, scene.representatives, environment.pyramid(), normal, -i, *sky
        )[:, 0]
        value = np.einsum("ej,jc->ec", scene.basis.evaluate(i, to_viewer), scene.representatives[0])
        # cos at the floor, cos at the wall, distance, area.
        measure = i[:, 2] * -i[:, 1] / r2 / len(y)
        found[t] = (value * shown * measure[:, None]).sum(axis=0)
    return found


@pytest.mark.parametrize("to_viewer", [(0.0, 0.0, 1.0), (0.1, 0.7, 0.5)])
def test_agrees_with_brute_force_on_a_glossy_corner(to_viewer: tuple[float, float, float]) -> None:
    scene = Corner(smooth_light(), *glossy())
    viewer = unit(np.array(to_viewer))
    texel, x = on_floor(scene, 0.15)
    some = np.linspace(0, len(texel) - 1, 8).astype(int)
    light = bounced(scene.surface, scene.around)
    found = scene.shown(light, texel[some], viewer)
    wanted = brute_force(scene, x[some], viewer)
    # The sky is blurred to 16 x 16 pixels, the wall to cells of 14 degrees: a lobe of sigma 0.3 feels both.
    assert np.sqrt(((found - wanted) ** 2).sum() / (wanted**2).sum()) < 0.06
    np.testing.assert_allclose(found.sum(), wanted.sum(), rtol=0.04)


def test_a_glare_that_no_camera_saw_is_not_lent(plain: Corner) -> None:
    """A kernel of Fresnel's rise alone, ten times as strong as possible, beside a diffuse base."""
    impossible = diffuse()
    impossible[0] = 10.0
    plain_light = bounced(plain.surface, plain.around)
    glaring = replace(plain.surface, representatives=impossible[None])
    albedo = np.einsum("aj,jc->ac", np.stack([paper().albedo(c) for c in (1.0, 0.08)]), impossible)
    assert albedo[0].max() < 0.82 and albedo[1].min() > 3
    factors = glaring.trusted[0]
    # At the normal nothing is held back; at a cosine of 0.08 what is left is 1 at most.
    np.testing.assert_allclose(factors[-1], 1)
    assert (factors[1] * albedo[1] <= 1 + 1e-9).all()
    assert (plain.surface.trusted == 1).all()
    lent = bounced(glaring, plain.around).radiance.mean() / plain_light.radiance.mean()
    assert 1 < lent < 1.6


def test_turned_light_is_the_light_turned() -> None:
    """A turntable's frames share an environment; each gets the light of its own turn."""
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    scene = Corner(smooth_light(), *glossy(), places=300)
    both = Lights(scene.lights.environments, np.zeros(2, np.int32), np.stack([np.eye(3), turn]))
    scene.lights = both
    found = bounced(scene.surface, scene.around)
    assert found.of_frame.tolist() == [0, 1] and not np.allclose(found.radiance[0], found.radiance[1])
    scene.lights = Lights((smooth_light().rotated(turn),), np.zeros(1, np.int32), np.eye(3)[None])
    alone = bounced(scene.surface, scene.around)
    # Sky masks of a turned light are taken from the nearest cells, and the sky is blurred on another grid.
    off = found.under(1).radiance - alone.radiance
    assert np.sqrt((off**2).sum() / (alone.radiance**2).sum()) < 0.05


def test_threads_change_no_bit(plain: Corner, monkeypatch: pytest.MonkeyPatch) -> None:
    texel, _ = on_floor(plain)
    viewer = np.array([0.0, 0, 1])

    def whole() -> tuple[IndirectLight, F64]:
        around = surroundings(plain.rays, plain.atlas, plain.sky, plain.pixels, places=300)
        light = bounces_of(plain.surface, around, 2)
        return light, plain.shown(light, texel, viewer)

    many = whole()
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    one = whole()
    assert np.array_equal(many[0].radiance, one[0].radiance) and np.array_equal(many[1], one[1])


def test_a_convex_object_sends_itself_nothing() -> None:
    mesh = sphere_mesh(24)
    rays, atlas = RayScene([mesh]), build_atlas(mesh, 48)
    sky, pixels = sky_masks(rays, atlas), padded(atlas)
    around = surroundings(rays, atlas, sky, pixels)
    assert len(around) == 0 and (around.place_of == -1).all()
    lights = Lights((even_light(),), np.zeros(1, np.int32), np.eye(3)[None])
    index, weight = np.zeros((48, 48, 1), np.uint8), np.ones((48, 48, 1), np.float32)
    surface = Reflecting(atlas, paper(), diffuse()[None], index, weight, sky, lights)
    light = bounces_of(surface, around, 2)
    normal = atlas.normal(slice(None))
    where = np.zeros(len(atlas), np.int32), np.arange(len(atlas)), normal, normal
    respond = partial(representative_responses, paper(), diffuse()[None])
    assert not light.responses(*where, 1, respond).any()


def test_what_an_occluder_reflects_counts_as_nothing() -> None:
    whole = corner()
    faces = whole.faces[:2]
    floor = Mesh(whole.vertices[:4], faces, whole.normals[:4], whole.uv[:4] if whole.uv is not None else None)
    wall = Mesh(whole.vertices[4:], whole.faces[2:] - 4, whole.normals[4:])
    rays, atlas = RayScene([floor, wall]), build_atlas(floor, RESOLUTION)
    sky = sky_masks(rays, atlas)
    assert (sky.of_texel >= 0).any()
    assert len(surroundings(rays, atlas, sky, padded(atlas))) == 0


def test_agrees_with_mitsuba_within_its_noise() -> None:
    """One bounce alone, by a path tracer: the floor from above, paths of up to three edges less up to two.

    A diffuse base under a rough lobe without Fresnel; light of test_oracle_mitsuba.py. Mitsuba's lobe has
    Smith's shadowing for Beckmann, ours the V-groove's: both are 1 but at grazing angles.
    """
    mi: Any = pytest.importorskip("mitsuba", reason="the other renderer is not installed (extra: oracle)")
    oracle = pytest.importorskip("test_oracle_mitsuba")
    side, samples, sigma, gloss = 8, 4096, 0.3, 0.3
    mi.set_variant("scalar_rgb")
    T = mi.ScalarTransform4f()
    lobe = {"type": "roughconductor", "material": "none", "distribution": "beckmann", "alpha": sigma}
    base = {"type": "diffuse", "reflectance": {"type": "rgb", "value": ALBEDO.tolist()}}
    material = {"type": "blendbsdf", "weight": gloss, "base": base, "lobe": lobe}
    floor = T.translate([0.5, 0.5, 0]) @ T.scale(0.5)
    wall = T.translate([0.5, 0, 0.5]) @ T.rotate([1, 0, 0], -90) @ T.scale(0.5)

    def rendered(depth: int, seed: int) -> F64:
        camera = T.look_at([0.5, 0.5, 3], [0.5, 0.5, 0], [0, 1, 0]) @ T.scale([0.5, 0.5, 1])
        film = {"type": "hdrfilm", "width": side, "height": side, "rfilter": {"type": "box"}}
        scene = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "path", "max_depth": depth, "rr_depth": 99, "hide_emitters": True},
                "sensor": {
                    "type": "orthographic",
                    "to_world": camera,
                    "film": film | {"pixel_format": "rgb"},
                    "sampler": {"type": "independent", "sample_count": samples},
                },
                "light": {"type": "envmap", "bitmap": mi.Bitmap(oracle.mitsuba_raster())},
                "floor": {"type": "rectangle", "to_world": floor, "bsdf": material},
                "wall": {"type": "rectangle", "to_world": wall, "bsdf": material},
            }
        )
        return np.array(mi.render(scene, seed=seed), dtype=np.float64)

    # Half of the floor, near the wall: further rows have less indirect light than noise.
    near = slice(side // 2, side)
    first, second = ((rendered(3, seed) - rendered(2, seed + 9))[near] for seed in (1, 2))
    theirs, noise = 0.5 * (first + second).mean(axis=(0, 1)), 0.5 * np.std(first - second)
    directions = Environment(np.ones((64, 128, 3), np.float32), "mitsuba").directions()
    light = Environment(oracle.light(directions).astype(np.float32), "mitsuba")
    basis = GenericBasis("oracle", sigmas=np.array([sigma]))
    weights = np.stack([np.zeros(3), np.full(3, gloss), (1 - gloss) * ALBEDO])
    scene = Corner(light, basis, weights)
    texel, x = on_floor(scene, 0.0)
    half = x[:, 1] < 0.5
    found = scene.shown(bounced(scene.surface, scene.around), texel[half], np.array([0.0, 0, 1]))
    # Three deviations of the mean over the pixels, and 4 % for cells and blurred sky (see above).
    allowed = 3 * noise / np.sqrt(side * side / 2) + 0.04 * theirs.mean()
    assert allowed < 0.1 * theirs.mean()
    assert np.abs(found.mean(axis=0) - theirs).max() < allowed


FLOOR, WALL = np.array([0.7, 0.3, 0.2]), np.array([0.8, 0.8, 0.7])


@pytest.fixture(scope="module")
def photographed(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Three photographs of a corner of two diffuse materials; light bounces four times in them."""
    folder = tmp_path_factory.mktemp("corner")
    scene = Corner(smooth_light(), paper(), diffuse(FLOOR), places=400)
    on_wall = scene.atlas.normal(slice(None))[:, 1] > 0.5
    index = on_wall[scene.pixels].astype(np.uint8)[..., None]
    materials = np.stack([diffuse(FLOOR), diffuse(WALL)])
    known = scene.mesh, scene.rays, paper(), materials, scene.pixels, index, scene.weight, scene.sky
    relit, light = RelitScene(*known), scene.lights.environments[0]
    indirect = relit.indirect(light, 4)
    (folder / "images").mkdir()
    write_mesh_obj(folder / "mesh.obj", scene.mesh)
    write_exr(folder / "env.exr", light.radiance)
    source = EnvironmentSource(folder / "env.exr", light.convention, light.world_from_environment)
    frames = []
    for k, towards in enumerate([(0.2, 1, 0.7), (-0.5, 0.8, 1), (0.9, 0.9, 0.9)]):
        place = 0.5 + 3 * unit(np.array(towards))
        camera = Camera(48, 48, 98, 98, 24, 24, look_at(place, np.full(3, 0.4)))
        name = f"images/{k}.exr"
        write_exr(folder / name, render(relit, camera, light, 1, indirect))
        frames.append(Frame(name, folder / name, None, 1.0, camera, source))
    capture = Capture(folder, folder / "transforms.json", folder / "mesh.obj", (), source, tuple(frames))
    write_capture(capture, folder)
    return read_capture(folder)


def albedo_error(found: Reconstruction) -> float:
    """Relative root-mean-square error of the albedo at normal incidence, within 0.4 of the shared edge."""
    atlas = found.observations.atlas
    of = np.einsum("j,njc->nc", found.basis.albedo(1.0), found.solution.representatives)
    texel = np.flatnonzero(found.observations.coverage)
    x, normal = atlas.points(texel)
    near = (x[:, 1] + x[:, 2] < 0.4) & (x[:, 1] + x[:, 2] > 0.05)
    albedo = found.surface.blend(texel[near]) @ of
    truth = np.where(normal[near, 1:2] > 0.5, WALL, FLOOR)
    return float(np.sqrt(((albedo - truth) ** 2).sum() / (truth**2).sum()))


class Remembering:
    """A keeper that counts what is made, and makes nothing twice."""

    def __init__(self) -> None:
        self.parts: dict[str, Kept] = {}
        self.made: list[str] = []

    def kept(self, name: str, make: Callable[[], Mapping[str, Array]]) -> Kept:
        if name not in self.parts:
            self.made.append(name)
            self.parts[name] = IN_MEMORY.kept(name, make)
        return self.parts[name]


def test_the_loop_finds_the_albedo_beside_an_edge(photographed: Capture) -> None:
    solve = SolveOptions(n=1, N=2)
    plain_options = ReconstructOptions(resolution=40, basis="paper", texels=300, solve=solve)
    options = replace(plain_options, interreflections=2)
    keeper = Remembering()
    ignored = reconstruct(photographed, plain_options, keeper=keeper)
    found = reconstruct(photographed, options, keeper=keeper)
    without, error = albedo_error(ignored), albedo_error(found)
    # The wall lends the floor up to a third of its light. Two rounds leave some 4 %: what parts of the corner
    # show each other at slants that no camera sees is held to the possible, but not known.
    assert without > 0.1
    assert error < 0.5 * without
    assert {"surroundings", "bounce-1-light", "bounce-1-solve", "bounce-2-light"} <= set(keeper.made)
    share = indirect_share(found.rendering, found.surface)
    assert 0.02 < share.median < share.ninth_tenth < share.last_hundredth < 0.6
    # An interrupted run goes on from the parts that are there, to the same bits.
    lost = {name for name in keeper.parts if name.startswith("bounce-2")}
    keeper.parts = {name: part for name, part in keeper.parts.items() if name not in lost}
    keeper.made = []
    again = reconstruct(photographed, options, keeper=keeper)
    assert set(keeper.made) == lost
    assert np.array_equal(again.solution.representatives, found.solution.representatives)
    assert np.array_equal(again.blend.weight, found.blend.weight)


def test_a_material_recovered_with_them_is_relit_with_them(photographed: Capture, tmp_path: Path) -> None:
    solve = SolveOptions(n=1, N=1)
    options = ReconstructOptions(24, "paper", 100, solve, interreflections=1)
    summary = reconstruct_folder(photographed.file, tmp_path / "material", options, views=1, viewer=False)
    assert summary.interreflections == 1 and summary.indirect is not None
    assert "Light by way of the object itself" in summary.in_words()
    solver = json.loads((tmp_path / "material" / "svbrdf.json").read_text())["solver"]
    assert solver["interreflections"]["rounds"] == 1
    assert solver["interreflections"]["indirect"]["median"] == summary.indirect.median
    cameras = json.loads(photographed.file.read_text())
    one = photographed.root / "one.json"
    one.write_text(json.dumps(cameras | {"frames": cameras["frames"][:1]}))
    shown = {}
    for name, bounces in (("default", None), ("none", 0), ("two", 2)):
        out = tmp_path / name
        relight_folder(tmp_path / "material", one, out, samples=1, interreflections=bounces)
        shown[name] = read_image(out / "0.exr").linear
    assert np.array_equal(shown["default"], shown["two"])
    assert shown["two"].mean() > 1.02 * shown["none"].mean()

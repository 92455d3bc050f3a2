# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Relighting against closed forms and against simulate's renderer, which knows no atlas."""

from __future__ import annotations

import sys
import weakref
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image as Pillow

from swatchwork.capture import Camera, Capture, EnvironmentSource, Frame, read_image, write_exr
from swatchwork.errors import InputError, OutputError
from swatchwork.light import Environment
from swatchwork.material import BasisRecord, Material
from swatchwork.reflectance import GenericBasis, paper
from swatchwork.relight import (
    Lighting,
    RelitScene,
    cosine_map,
    display_image,
    output_names,
    relight,
    render,
    see,
    turntable,
)
from swatchwork.relight.render import facing
from swatchwork.simulate import (
    Subject,
    blend_pattern,
    camera_towards,
    four_materials,
    in_basis,
    photograph,
    procedural_environment,
    random_directions,
    shape,
)
from swatchwork.surface import Mesh, build_atlas

EVEN = Environment(np.full((8, 16, 3), [0.5, 1.0, 2.0], np.float32), "blender")


@pytest.fixture(scope="module", autouse=True)
def few_sky_samples() -> Iterator[None]:
    """Masks of 8000 points are a matter of seconds; the shapes here need few."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("swatchwork.relight.scene.SKY_SAMPLES", 1000)
        yield


def material_of(mesh: Mesh, representatives: np.ndarray, blend: object, resolution: int = 64) -> Material:
    basis: GenericBasis = paper()
    atlas = build_atlas(mesh, resolution)
    index, weight = blend(atlas.position(slice(None)))  # type: ignore[operator]
    full = (resolution, resolution)
    found_index = np.zeros((*full, index.shape[1]), np.uint32)
    found_weight = np.zeros((*full, index.shape[1]), np.float32)
    coverage = np.full(full, -1, np.int32)
    found_index[atlas.row, atlas.col], found_weight[atlas.row, atlas.col] = index, weight
    coverage[atlas.row, atlas.col] = 1
    assert mesh.uv is not None
    return Material(
        basis=BasisRecord(basis.name, tuple(basis.sigmas.tolist()), basis.maskings, basis.diffuse),
        representatives=representatives,
        index=found_index,
        weight=found_weight,
        coverage=coverage,
        residual=np.zeros(full, np.float32),
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=mesh.normals,
        uv=mesh.uv,
    )


def single(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros((len(position), 1), np.uint32), np.ones((len(position), 1))


def matte(albedo: float = 0.8) -> np.ndarray:
    representatives = np.zeros((1, paper().kernels, 3))
    representatives[0, -1] = albedo
    return representatives


@pytest.fixture(scope="module")
def ball(few_sky_samples: None) -> RelitScene:
    return RelitScene.of(material_of(shape("sphere", 32), matte(), single))


def towards(direction: tuple[float, float, float], size: int = 40) -> Camera:
    return camera_towards(np.array(direction), size)


def test_a_matte_ball_in_even_light_is_its_albedo(ball: RelitScene) -> None:
    image = render(ball, towards((1, 2, 1)), EVEN)
    inside = image[..., 3] > 0
    straight = image[inside][:, :3] / image[inside][:, 3:]
    # The Lambertian kernel's own quadrature leaves up to 1 %.
    assert np.allclose(straight, 0.8 * np.array([0.5, 1.0, 2.0]), rtol=0.01)
    assert (image[~inside] == 0).all()


def test_coverage_is_the_area_of_the_disc(ball: RelitScene) -> None:
    camera = towards((0, 0, 1))
    radius_px = 0.92 * 40 / 2
    # A 32 x 64 grid lies inside the sphere: its outline's radius is up to 0.2 % short, its area 0.3 %; the
    # 8 x 8 rays of an edge pixel leave less.
    assert see(ball.rays, camera).alpha.sum() == pytest.approx(np.pi * radius_px**2, rel=5e-3)


@pytest.mark.parametrize("name", ["sphere", "blob"])
def test_agrees_with_a_renderer_without_an_atlas(name: str) -> None:
    """Same truth twice: as texels of a material, and as a function of position."""
    mesh, truth = shape(name, 40), in_basis(four_materials(0), paper())

    def blend(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return blend_pattern(position, seed=0)

    camera = camera_towards(random_directions(1, seed=3)[0], 40)
    light = procedural_environment("room", 1, height=64)
    scene = RelitScene.of(material_of(mesh, truth, blend, 128))
    b = photograph(Subject.of(mesh, paper(), truth, blend, sky_samples=1000), camera, light, cells=9)
    mask = b[..., 3] > 0.5

    def error(samples: int) -> float:
        a = render(scene, camera, light, samples)
        # 8 x 8 or 16 x 16 rays against many in pixels that an edge crosses.
        assert np.abs(a[..., 3] - b[..., 3]).max() < 0.1
        return float(np.sqrt(((a - b)[mask][:, :3] ** 2).sum() / (b[mask][:, :3] ** 2).sum()))

    # At 40 pixels normals turn by tens of degrees a pixel at the rim, where lamps of 3 degrees are mirrored:
    # either renderer's last percents. Bilinear texels and, on the blob, two sets of shared sky masks (a
    # shadow's edge falls a cell apart) are the rest. Measured 2 to 3 %; wrong texels would give 30 %.
    assert error(4) < (0.03 if name == "sphere" else 0.05)
    assert error(2) < (0.04 if name == "sphere" else 0.06)


def test_rims_of_highlights_are_shaded_more_finely(ball: RelitScene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Against many samples everywhere; what has no contrast stays as it is to the bit."""

    def blend(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return blend_pattern(position, seed=0)

    scene = RelitScene.of(material_of(shape("blob", 40), in_basis(four_materials(0), paper()), blend, 128))
    camera = camera_towards(random_directions(1, seed=3)[0], 100)
    light = procedural_environment("room", 1, height=64)
    fine, ours = render(scene, camera, light, 8), render(scene, camera, light)
    even = render(ball, camera, EVEN)
    monkeypatch.setattr(sys.modules["swatchwork.relight.render"], "CONTRAST", np.inf)
    coarse = render(scene, camera, light)
    np.testing.assert_array_equal(render(ball, camera, EVEN), even)
    changed = (ours != coarse).any(axis=-1)
    assert 0.01 < changed.sum() / (ours[..., 3] > 0).sum() < 0.5
    on = fine[..., 3] > 0.5
    error = [float(np.linalg.norm((image - fine)[on][:, :3])) for image in (ours, coarse)]
    # Sixteen shadings for one where it matters leave a third; of glints smaller than a pixel, that no
    # neighbour shows, more is left (from other sides four fifths).
    assert error[0] < 0.5 * error[1]


def test_a_slit_that_finer_rays_see_does_not_darken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two walls, one of a quarter of the albedo, and a slit between them that a pixel's four rays miss."""
    size, slit = 40, 0.01

    def wall(left: float, right: float) -> np.ndarray:
        return np.array([[left, -1.0, 0], [right, -1, 0], [right, 1, 0], [left, 1, 0]])

    corners = np.concatenate([wall(-1, -slit / 2), wall(slit / 2, 1)])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32)
    mesh = Mesh(corners, faces, np.tile([0.0, 0, 1], (8, 1)), (corners[:, :2] + 1) / 2)
    representatives = np.concatenate([matte(0.2), matte(0.8)])

    def halves(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (position[:, :1] > 0).astype(np.uint32), np.ones((len(position), 1))

    scene = RelitScene.of(material_of(mesh, representatives, halves))
    pose = np.eye(4)
    pose[2, 3] = 3.0
    # The slit lies in the middle of a column, between the rays at a quarter and three quarters of it.
    camera = Camera(size, size, 60.0, 60.0, size / 2 + 0.5, size / 2 + 0.5, world_from_camera=pose)
    image = render(scene, camera, EVEN)
    monkeypatch.setattr(sys.modules["swatchwork.relight.render"], "CONTRAST", np.inf)
    coarse = render(scene, camera, EVEN)
    row = size // 2
    assert (image[row] != coarse[row]).any() and (image[row, :, 3] == 1).sum() > 30
    on = image[row, :, 3] == 1
    least = coarse[row, on, 1].min()
    # Light that reaches a wall differs by a few per cent along it.
    assert (image[row, on, 1] > 0.9 * least).all()


def test_nothing_in_the_picture_and_a_black_material(ball: RelitScene) -> None:
    away = towards((1, 2, 1))
    pose = away.world_from_camera.copy()
    pose[:3, :3] = pose[:3, :3] @ np.diag([-1.0, 1, -1])
    assert not render(ball, replace(away, world_from_camera=pose), EVEN).any()
    black = RelitScene.of(material_of(shape("sphere", 32), 0 * matte(), single))
    image = render(black, away, EVEN)
    assert not image[..., :3].any() and image[..., 3].any()


def test_light_and_camera_turned_together_change_nothing(ball: RelitScene) -> None:
    light = procedural_environment("studio", 3, height=64)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    camera = towards((1, 0, 0.4))
    pose = camera.world_from_camera.copy()
    pose[:3] = turn @ pose[:3]
    one = render(ball, camera, light)
    two = render(ball, replace(camera, world_from_camera=pose), light.rotated(turn))
    # A quarter turn maps mesh and octahedral pixels onto themselves, up to resampling of the raster.
    assert np.abs(one - two).max() < 0.01 * one.max()


def test_an_occluder_hides_but_does_not_show(ball: RelitScene) -> None:
    wall = Mesh(
        np.array([[2.0, -9, -9], [2, 9, -9], [2, 0, 9]]),
        np.array([[0, 1, 2]], np.int32),
        np.tile([1.0, 0, 0], (3, 1)),
    )
    scene = RelitScene.of(material_of(shape("sphere", 16), matte(), single), [wall])
    assert render(scene, towards((1, 0, 0)), EVEN).max() == 0
    lit = render(scene, towards((-1, 0, 0)), EVEN)
    assert lit[20, 20, 3] == 1
    # The wall takes light from the side that faces it, none from the one turned away.
    side = render(scene, towards((0, -1, 0)), EVEN)
    assert side[20, 34, 1] < 0.5 * side[20, 6, 1]


def test_cosine_map(ball: RelitScene) -> None:
    cosine = cosine_map(ball.rays, towards((0, 1, 0)))
    assert cosine[20, 20] == pytest.approx(1, abs=2e-3)  # half a pixel off the middle
    assert np.isnan(cosine[0, 0])
    assert np.nanmin(cosine) < 0.4


def test_normals_that_turn_away_are_bent_back() -> None:
    o = np.tile([0.0, 0, 1], (2, 1))
    n = np.array([[0.6, 0, -0.8], [0.6, 0, 0.8]])
    bent = facing(n, o)
    assert bent[0] == pytest.approx([np.sqrt(1 - 0.02**2), 0, 0.02])
    assert np.array_equal(bent[1], n[1])


def capture_of(folder: Path, names: list[str], environment: EnvironmentSource | None) -> Capture:
    frames = [
        Frame(name, folder / name, None, 1.0, towards(tuple(d), 24), None)
        for name, d in zip(names, random_directions(len(names)), strict=True)
    ]
    return Capture(folder, folder / "transforms.json", None, (), environment, tuple(frames))


def test_frames_are_written_under_their_own_names(ball: RelitScene, tmp_path: Path) -> None:
    write_exr(tmp_path / "env.exr", EVEN.radiance)
    cameras = capture_of(
        tmp_path, ["images/a.png", "images/b.exr"], EnvironmentSource(tmp_path / "env.exr", "blender")
    )
    done = relight(ball, cameras, tmp_path / "out")
    assert [frame.exr for frame in done] == [tmp_path / "out/a.exr", tmp_path / "out/b.exr"]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["a.exr", "a.png", "b.exr", "b.png"]
    stored = read_image(done[1].exr)
    expected = render(ball, cameras.frames[1].camera, EVEN)
    assert np.array_equal(stored.linear, expected[..., :3])
    assert stored.alpha is not None
    assert np.array_equal(stored.alpha, expected[..., 3])


def test_a_light_given_replaces_the_frames_own(ball: RelitScene, tmp_path: Path) -> None:
    cameras = capture_of(tmp_path, ["a"], None)
    with pytest.raises(InputError, match="frame a names no environment"):
        relight(ball, cameras, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    (frame,) = relight(ball, cameras, tmp_path / "out", lighting=Lighting(EVEN), previews=False)
    assert frame.png is None
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["a.exr"]


def test_a_full_disk_leaves_the_older_file(
    ball: RelitScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cameras = capture_of(tmp_path, ["a"], None)
    relight(ball, cameras, tmp_path / "out", lighting=Lighting(EVEN), previews=False)
    before = (tmp_path / "out/a.exr").read_bytes()

    def full(path: Path, image: object) -> None:
        path.write_bytes(b"half")
        raise OutputError("No space left on device")

    monkeypatch.setattr("swatchwork.relight.frames.write_exr", full)
    with pytest.raises(OutputError, match=r"a\.exr: cannot be written \(No space"):
        relight(ball, cameras, tmp_path / "out", lighting=Lighting(EVEN), previews=False)
    assert (tmp_path / "out/a.exr").read_bytes() == before
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["a.exr"]


def test_output_names() -> None:
    assert output_names(["images/0001.exr", "./images/0002.png"]) == ["0001", "0002"]
    assert output_names(["train/r_0.5", "train/r_1"]) == ["r_0.5", "r_1"]
    assert output_names(["../left/1.png", "../right/1.png"]) == ["left/1", "right/1"]
    with pytest.raises(InputError, match="several frames are called 'a/1'"):
        output_names(["a/1.png", "a/1.exr"])


def test_previews_are_gamma_22_at_the_lights_mean() -> None:
    image = np.zeros((1, 2, 4), np.float32)
    mean = EVEN.mean_radiance.mean()
    image[0, 0] = [0.25 * mean, 0.5 * mean, 9.0 * mean, 0.5]
    shown = display_image(image, EVEN)
    assert shown[0, 0].tolist() == [round(255 * 0.5 ** (1 / 2.2)), 255, 255, 128]
    assert shown[0, 1].tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_turntables(ball: RelitScene, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"turn{suffix}"
    turntable(ball, towards((1, 0, 0.3), 32), procedural_environment("studio", 0, 32), path, frames=3)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    if suffix == ".gif":
        with Pillow.open(path) as picture:
            assert picture.size == (32, 32)
    with pytest.raises(InputError, match=r"expected \.gif or \.mp4"):
        turntable(ball, towards((1, 0, 0)), EVEN, tmp_path / "turn.avi")


def test_a_blend_of_another_mesh_is_refused() -> None:
    material = material_of(shape("sphere", 8), matte(), single, 16)
    with pytest.raises(InputError, match="does not cover the mesh's texels"):
        RelitScene.of(replace(material, coverage=np.full((16, 16), -1, np.int32)))
    with pytest.raises(InputError, match="the atlas is 15 x 16"):
        RelitScene.of(replace(material, coverage=material.coverage[:, :15], index=material.index[:, :15]))


def test_a_light_of_the_object_itself_goes_after_its_last_frame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Sent:
        pass

    made: list[weakref.ref[Sent]] = []
    alive: list[int] = []

    def indirect(*_: object) -> Sent:
        sent = Sent()
        made.append(weakref.ref(sent))
        return sent

    def rendered(*_: object) -> np.ndarray:
        alive.append(sum(reference() is not None for reference in made))
        return np.zeros((2, 2, 4), np.float32)

    monkeypatch.setattr("swatchwork.relight.frames.render", rendered)
    camera = camera_towards(np.array([0.0, 0.0, 3.0]), 2)
    lights = [EVEN, Environment(2 * EVEN.radiance, "blender"), Environment(3 * EVEN.radiance, "blender")]
    order = [0, 1, 1, 0, 2]
    source = [EnvironmentSource(tmp_path / f"{i}.exr", "blender", np.eye(3)) for i in range(3)]
    frames = tuple(
        Frame(f"{i}.exr", tmp_path / f"{i}.exr", None, 1.0, camera, source[light])
        for i, light in enumerate(order)
    )
    capture = Capture(tmp_path, tmp_path / "transforms.json", None, (), None, frames)
    monkeypatch.setattr(Lighting, "of", lambda self, _, frame: lights[source.index(frame.environment)])
    relight(SimpleNamespace(indirect=indirect), capture, tmp_path / "out", previews=False)  # type: ignore[arg-type]
    assert alive == [1, 2, 2, 1, 1] and len(made) == 3

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The viewer's page as text: what is on it, that it asks nothing of any network, and how large it is."""

from __future__ import annotations

import base64
import importlib.util
import json
import re
import sys
import zlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import viewing
from swatchwork.capture import Camera, EnvironmentSource, Frame, write_exr
from swatchwork.cli import main
from swatchwork.errors import InputError, OutputError
from swatchwork.light import Environment
from swatchwork.material import write_material
from swatchwork.reflectance import DIFFUSE_SHAPES, extended
from swatchwork.relight import RelitScene
from swatchwork.simulate import procedural_environment
from swatchwork.viewer import (
    Light,
    TexelMap,
    ViewerScene,
    bundled_script,
    render_viewer,
    shot_of,
    write_viewer,
)
from swatchwork.viewer.packing import Blocks, deflated, diffuse_by_shape, pack, planes, up_axis

ROOM = procedural_environment("room", 1, height=16)
NASTY = "</script><script>alert('&\"')//"


@pytest.fixture(scope="module")
def knot() -> RelitScene:
    return viewing.scene("knot", extended())


@pytest.fixture(scope="module")
def viewer(knot: RelitScene) -> ViewerScene:
    values = np.full(knot.texel_of_pixel.shape, 0.1, np.float32)
    values[::2] = np.nan
    return ViewerScene(
        title=NASTY,
        scene=knot,
        lights=(Light.of(NASTY, ROOM),),
        maps=(TexelMap(NASTY, values, 0.2, "%"),),
        notes=(NASTY,),
    )


@pytest.fixture(scope="module")
def page(viewer: ViewerScene) -> str:
    return render_viewer(viewer)


def block_bytes(blocks: Blocks, name: str) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b64decode(blocks.text[name]), -15), np.uint8)


def test_the_page_is_self_contained(page: str) -> None:
    outside = re.sub(r"<script>.*?</script>", "", page, flags=re.S)
    assert not re.search(r"(?:src|href)=[\"'](?!data:)", outside)
    assert "@import" not in outside and "url(" not in outside
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    rules = dict(rule.strip().split(" ", 1) for rule in policy[1].split(";"))
    assert rules["default-src"] == "'none'" and rules["connect-src"] == "'none'"
    assert re.fullmatch(r"'sha256-[\w+/]+=*'", rules["script-src"])
    assert not any("http" in rule for rule in rules.values())


def test_names_are_text_wherever_they_stand(page: str) -> None:
    # Two scripts end where they should: the head's JSON has no < at all, the title is escaped.
    assert "alert('&\"')//" not in page.split('id="head"', maxsplit=1)[0]
    head = re.search(r'<script type="application/json" id="head">(.*?)</script>', page, re.S)
    assert head is not None and "<" not in head[1]
    found = json.loads(head[1])
    assert found["title"] == found["lights"][0]["name"] == found["maps"][0]["name"] == NASTY
    blocks = found["blocks"]
    assert page.count("<script") == page.count("</script>") == len(blocks) + 2


def test_blocks_read_back(page: str, knot: RelitScene) -> None:
    head = json.loads(re.findall(r'id="head">(.*?)</script>', page, re.S)[0])

    def array(name: str) -> np.ndarray:
        about = head["blocks"][name]
        text = re.search(rf'id="block:{re.escape(name)}">([^<]*)<', page)
        assert text is not None
        kind = np.dtype(about["type"])
        octets = np.frombuffer(zlib.decompress(base64.b64decode(text[1]), -15), np.uint8)
        values = octets.reshape(kind.itemsize, -1).T.copy().view(kind).reshape(about["shape"])
        return np.cumsum(values, axis=0, dtype=kind) if about["coding"] == "delta" else values

    low, size = np.array(head["mesh"]["low"]), np.array(head["mesh"]["size"])
    position = low + array("position") / 65535 * size
    assert np.abs(position - knot.mesh.vertices).max() <= 0.51 / 65535 * size.max()
    assert (array("faces") == knot.mesh.faces).all()
    on = np.unpackbits(array("on"), bitorder="little").astype(bool)
    texels = head["atlas"]["texels"]
    assert on.sum() == texels == len(array("index.0"))
    pixel = np.flatnonzero(on)
    first = array("weight.0") / 65535
    assert np.abs(first - knot.weight.reshape(-1, 2)[pixel, 0]).max() < 1e-5
    assert (array("index.1") == knot.index.reshape(-1, 2)[pixel, 1]).all()
    texel = knot.texel_of_pixel.ravel()[pixel]
    assert (array("sky_row") == knot.sky.of_texel[texel] + 1).all()
    assert (array("sky").view("<u8") == knot.sky.words).all()
    light = array("light.0").view(np.float16).astype(np.float64) * head["lights"][0]["unit"]
    # Half precision keeps eleven bits.
    assert np.allclose(light, ROOM.radiance, rtol=5e-4, atol=1e-6 * ROOM.radiance.max())


def test_more_than_256_representatives(viewer: ViewerScene) -> None:
    small = viewer.scene
    many = np.repeat(small.representatives, 75, axis=0)
    index = small.index.astype(np.uint32) * 75 + 74
    found, blocks = pack(replace(viewer, scene=replace(small, representatives=many, index=index)))
    assert found["material"]["N"] == len(many) == 300 and blocks.about["index.0"]["type"] == "uint16"
    octets = block_bytes(blocks, "index.0")
    on = np.unpackbits(block_bytes(blocks, "on"), bitorder="little").astype(bool)
    assert (octets.reshape(2, -1).T.copy().view(np.uint16)[:, 0] == index.reshape(-1, 2)[on, 0]).all()
    assert index.max() > 255


def test_more_representatives_than_a_page_can_number(
    viewer: ViewerScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("swatchwork.viewer.packing.MOST_REPRESENTATIVES", 3)
    with pytest.raises(InputError, match="4 representatives are too many for a page; expected at most 3"):
        pack(viewer)


def test_a_map_keeps_what_is_not_known_apart(page: str, knot: RelitScene) -> None:
    text = re.search(r'id="block:map.0">([^<]*)<', page)
    assert text is not None
    codes = np.frombuffer(zlib.decompress(base64.b64decode(text[1]), -15), np.uint8)
    assert set(codes.tolist()) == {0, 128}


def test_diffuse_kernels_fold_by_shape() -> None:
    basis = extended()
    weights = np.random.default_rng(0).random((2, len(basis.diffuse), 3))
    folded = diffuse_by_shape(basis, weights)
    o = np.array([np.sqrt(1 - 0.6**2), 0.0, 0.6])
    i = np.array([0.0, np.sqrt(1 - 0.3**2), 0.3])
    kernels = basis.evaluate(i, o)[len(basis.lobes) :]
    of_light = np.array([f(np.array(0.3)) for f in DIFFUSE_SHAPES.values()])
    of_viewer = np.array([f(np.array(0.6)) for f in DIFFUSE_SHAPES.values()])
    found = np.einsum("nabc,a,b->nc", folded, of_light, of_viewer) / np.pi
    assert np.allclose(found, np.einsum("k,nkc->nc", kernels, weights))


def test_coding_is_undone_by_its_inverse() -> None:
    blocks = Blocks()
    blocks.add("x", np.array([[1, 65535], [2, 0], [65535, 7]], np.uint16), "delta")
    octets = np.frombuffer(zlib.decompress(base64.b64decode(blocks.text["x"]), -15), np.uint8)
    values = octets.reshape(2, -1).T.copy().view(np.uint16).reshape(3, 2)
    assert (np.cumsum(values, axis=0, dtype=np.uint16) == [[1, 65535], [2, 0], [65535, 7]]).all()
    assert zlib.decompress(deflated(planes(np.array([258], np.uint16))), -15) == b"\x02\x01"


def test_up_is_what_cameras_agree_on() -> None:
    pose = np.eye(4)
    assert up_axis([Camera(4, 4, 4, 4, 2, 2, pose)]) == [0, 1, 0]
    assert up_axis([]) == [0, 0, 1]


def test_a_wide_light_is_halved() -> None:
    wide = Environment(np.ones((1024, 2048, 3), np.float32), "mitsuba")
    assert Light.of("wide", wide).environment.radiance.shape == (512, 1024, 3)


@pytest.mark.parametrize(
    ("convention", "height", "width"), [("blender", 515, 1030), ("debevec-angular", 1033, 1033)]
)
def test_a_wide_light_of_odd_sides_is_shrunk(convention: str, height: int, width: int) -> None:
    rng = np.random.default_rng(0)
    # Smooth from pixel to pixel, so that the means of both rasters are those of one light.
    radiance = cv2.GaussianBlur(rng.random((height, width, 3)).astype(np.float32), (0, 0), 8)
    wide = Environment(radiance, convention)
    found = Light.of("odd", wide).environment
    assert found.radiance.shape == (1024 * height // width, 1024, 3)
    assert np.allclose(found.mean_radiance, wide.mean_radiance, rtol=1e-4)
    inside = found.solid_angles > 0
    assert found.radiance[inside].min() >= 0.99 * radiance.min()


def test_a_masked_photograph_keeps_its_surroundings_out(tmp_path: Path) -> None:
    # Twice as wide as on the page, and the mask ends in the middle of a pixel of the page.
    camera = Camera(1280, 4, 900.0, 900.0, 640.0, 2.0, np.eye(4))
    image = np.full((4, 1280, 3), 10.0, np.float32)
    image[:, :641] = 0.5
    mask = np.zeros((4, 1280, 3), np.float32)
    mask[:, :641] = 1
    write_exr(tmp_path / "a.exr", image)
    write_exr(tmp_path / "mask.exr", mask)
    source = EnvironmentSource(tmp_path / "env.exr", "mitsuba", np.eye(3))
    frame = Frame("a.exr", tmp_path / "a.exr", tmp_path / "mask.exr", 1.0, camera, source)
    pixels = shot_of(frame, 1.0, 0, np.eye(3)).pixels
    scaled, wider = shot_of(frame, 1.0, 0, np.eye(3), scale=2.0), shot_of(frame, 2.0, 0, np.eye(3))
    np.testing.assert_array_equal(scaled.pixels, wider.pixels)
    assert scaled.white == 1.0 and (scaled.pixels != pixels).any()
    assert pixels.shape == (2, 640, 4)
    assert (pixels[:, :320, 3] == 255).all() and (pixels[:, 320, 3] == 128).all()
    assert (pixels[:, 321:] == 0).all()
    own = (pixels[:, :321, :3] / 255.0) ** 2.2 / (pixels[:, :321, 3:] / 255.0)
    # Eight bits of a gamma of 2.2.
    assert np.allclose(own, 0.5, rtol=0.02)


def test_a_photograph_loses_its_lens_distortion(tmp_path: Path) -> None:
    camera = Camera(64, 48, 60.0, 60.0, 32.0, 24.0, np.eye(4), k1=-0.2)
    straight = replace(camera, k1=0.0)
    # A point of light off the axis: where the lens put it, and where a pinhole would have.
    direction = np.array([[0.3, 0.2, -1.0]])
    image = np.zeros((48, 64, 4), np.float32)
    seen, expected = (c.project(direction)[0][0] for c in (camera, straight))
    image[..., 3] = 1
    y, x = np.mgrid[0:48, 0:64] + 0.5
    image[..., :3] = np.exp(-((x - seen[0]) ** 2 + (y - seen[1]) ** 2) / 8)[..., None]
    write_exr(tmp_path / "a.exr", image)
    source = EnvironmentSource(tmp_path / "env.exr", "mitsuba", np.eye(3))
    shot = shot_of(Frame("a.exr", tmp_path / "a.exr", None, 1.0, camera, source), 1.0, 0, np.eye(3))
    brightest = np.unravel_index(shot.pixels[..., 0].argmax(), (48, 64))
    assert abs(brightest[1] + 0.5 - expected[0]) < 1 and abs(brightest[0] + 0.5 - expected[1]) < 1
    assert shot.camera.k1 == 0 and shot.pixels.shape == (48, 64, 4)


def test_size_of_a_large_atlas(viewer: ViewerScene, tmp_path: Path) -> None:
    """Noise, the worst there is to deflate, for a whole atlas of 1024 x 1024 and three slots."""
    small, size, n = viewer.scene, 1024, 3
    rng = np.random.default_rng(0)
    full = replace(
        small,
        texel_of_pixel=rng.integers(0, len(small.sky.of_texel), (size, size)).astype(np.int32),
        index=rng.integers(0, 4, (size, size, n)).astype(np.uint8),
        weight=rng.random((size, size, n)).astype(np.float32),
    )
    file = write_viewer(tmp_path / "page.html", replace(viewer, scene=full, maps=()))
    # Real ones are half of that: docs of the room say.
    assert file.stat().st_size < 20e6


def test_a_missing_script_is_said(viewer: ViewerScene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("swatchwork.viewer.page.BUNDLE", "bundle/none.js")
    with pytest.raises(InputError, match=r"script was not built.*scripts/packaging/build_viewer\.py"):
        render_viewer(viewer)


def test_notices_of_others_are_kept() -> None:
    script = bundled_script()
    for holder in ("three.js authors", "Arjun Barrett", "Syoyo Fujita", "Industrial Light & Magic"):
        assert holder in script
    assert script.count("Redistributions in binary form must reproduce") == 2
    assert script.count("EVEN IF ADVISED OF THE POSSIBILITY OF SUCH DAMAGE") == 2


def test_a_build_without_network_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = Path(__file__).parents[1] / "scripts" / "packaging" / "build_viewer.py"
    spec = importlib.util.spec_from_file_location("build_viewer", file)
    assert spec is not None and spec.loader is not None
    build_viewer = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build_viewer)
    fails = [sys.executable, "-c", "raise SystemExit(1)"]
    monkeypatch.setattr(build_viewer, "BUNDLE", tmp_path / "viewer.js")
    monkeypatch.setattr(build_viewer, "system_node", lambda: [fails, fails])
    with pytest.raises(
        SystemExit, match=r"npm could not fetch three\.js.*Without a network, copy .*viewer\.js"
    ):
        build_viewer.build()
    monkeypatch.setattr(build_viewer, "system_node", lambda: [fails, [sys.executable, "-c", ""]])
    with pytest.raises(SystemExit, match="could not be bundled"):
        build_viewer.build()


def test_nothing_half_written(viewer: ViewerScene, tmp_path: Path) -> None:
    (tmp_path / "page.html").mkdir()
    with pytest.raises(OutputError, match="cannot be written"):
        write_viewer(tmp_path / "page.html", viewer)
    assert [p.name for p in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_nothing_half_written_when_stopped(
    viewer: ViewerScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
) -> None:
    file = tmp_path / "page.html"
    file.write_text("before")

    def stopped(*_: object) -> None:
        raise error

    monkeypatch.setattr("swatchwork.whole.files.os.replace", stopped)
    with pytest.raises(error):
        write_viewer(file, viewer)
    assert list(tmp_path.iterdir()) == [file] and file.read_text() == "before"


def test_a_title_that_is_no_unicode(viewer: ViewerScene, tmp_path: Path) -> None:
    file = write_viewer(tmp_path / "page.html", replace(viewer, title="a\udcffb"))
    assert "<title>a?b</title>" in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["svbrdf.json", "report.html", "a folder"])
def test_only_a_viewer_is_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    file = tmp_path / name
    text = '<meta name="generator" content="swatchwork 1">'
    if name == "a folder":
        file.mkdir()
    else:
        file.write_text(text)
    # Before any work: there is no material to be missed.
    assert main(["view", str(tmp_path / "none"), "-o", str(file), "--no-open"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "exists, and is not a viewer's page" in said
    assert file.is_dir() or file.read_text() == text


def test_needs_light(knot: RelitScene) -> None:
    with pytest.raises(InputError, match="at least one environment"):
        ViewerScene("dark", knot, ())


def test_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("swatchwork.relight.scene.SKY_SAMPLES", 500)
    write_material(tmp_path / "material", viewing.material("sphere", extended()))
    write_exr(tmp_path / "sky.exr", ROOM.radiance)
    command = ["view", str(tmp_path / "material"), "--no-open", "--json"]
    assert main(command) == 0
    made = json.loads(capsys.readouterr().out)
    assert Path(made["page"]) == tmp_path / "material" / "viewer.html" and made["photographs"] == 0
    before = Path(made["page"]).stat().st_mtime_ns
    # The page is there: it is opened as it is, and nothing said of what is on it.
    assert main(command) == 0 and Path(made["page"]).stat().st_mtime_ns == before
    found = json.loads(capsys.readouterr().out)
    assert found["page"] == made["page"] and found["lights"] is found["photographs"] is None
    light = ["--light", str(tmp_path / "sky.exr"), "-o", str(tmp_path / "look.html")]
    assert main([*command, *light]) == 2
    assert "--convention" in capsys.readouterr().err
    assert main([*command, *light, "--convention", "blender"]) == 0
    assert "sky.exr" in json.loads(capsys.readouterr().out)["lights"]
    # A viewer's page is replaced.
    assert main([*command, *light, "--convention", "blender"]) == 0

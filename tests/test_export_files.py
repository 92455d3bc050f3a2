# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Exported files: structure, colour spaces, refusals; checked by the formats' own tools where they are."""

from __future__ import annotations

import importlib
import json
import os
import struct
import subprocess
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow

from swatchwork.capture import read_exr_channels, read_image
from swatchwork.cli import main
from swatchwork.errors import CaptureWarning, InputError, OutputError
from swatchwork.export import Padding, StandardFit, Surroundings, is_export_folder
from swatchwork.export.fitting import fit_standard
from swatchwork.export.gltf import glb_bytes
from swatchwork.material import Material, material_maps, write_material
from swatchwork.reflectance import paper
from swatchwork.simulate import camera_towards, four_materials, in_basis, procedural_environment
from swatchwork.workflow import export_material, exporting
from test_export_mitsuba import ball

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def material() -> Material:
    return ball(paper(), in_basis(four_materials(0)[:2], paper()), 24)


@pytest.fixture(scope="module")
def kept(material: Material, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exports") / "material"
    write_material(folder, material)
    return folder


@pytest.fixture(scope="module")
def fit(material: Material) -> StandardFit:
    return fit_standard(material)


@pytest.fixture
def fitted(fit: StandardFit, monkeypatch: pytest.MonkeyPatch) -> None:
    """The kept material's fit, which takes seconds, made once for all exports."""
    monkeypatch.setattr(exporting, "fit_standard", lambda material, progress: fit)


@pytest.fixture
def not_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is refused is refused before the work."""

    def work(*_: Any) -> None:
        raise AssertionError("fitted or read before it was refused")

    monkeypatch.setattr(exporting, "fit_standard", work)
    monkeypatch.setattr(exporting, "read_material", work)


@pytest.fixture(scope="module")
def glb(material: Material, fit: StandardFit) -> bytes:
    return glb_bytes(material, fit, Padding.of(material))


def parts(glb: bytes) -> tuple[dict[str, Any], bytes]:
    magic, edition, length = struct.unpack_from("<4sII", glb)
    assert (magic, edition, length) == (b"glTF", 2, len(glb))
    size, kind = struct.unpack_from("<I4s", glb, 12)
    assert kind == b"JSON"
    binary_size, binary_kind = struct.unpack_from("<I4s", glb, 20 + size)
    assert binary_kind == b"BIN\0"
    return json.loads(glb[20 : 20 + size]), glb[28 + size : 28 + size + binary_size]


def test_glb_holds_mesh_and_textures(glb: bytes, material: Material) -> None:
    head, binary = parts(glb)

    def view(number: int) -> bytes:
        of = head["bufferViews"][number]
        return binary[of["byteOffset"] : of["byteOffset"] + of["byteLength"]]

    attributes = head["meshes"][0]["primitives"][0]["attributes"]
    uv = np.frombuffer(view(head["accessors"][attributes["TEXCOORD_0"]]["bufferView"]), "<f4").reshape(-1, 2)
    assert np.allclose(uv, material.uv * [1, -1] + [0, 1], atol=1e-6)
    images = [np.asarray(Pillow.open(BytesIO(view(image["bufferView"])))) for image in head["images"]]
    assert [image.shape for image in images] == [(24, 24, 3), (24, 24, 3), (24, 24, 4)]
    # Roughness is perceptual: four_materials' alphas are 0.08 to 0.3.
    rough = images[1][..., 1] / 255
    # And no gutter is left black.
    assert 0.2 < rough.min() <= rough.max() < 0.8
    extensions = head["materials"][0]["extensions"]
    assert set(extensions) == set(head["extensionsUsed"])
    assert 0 < head["materials"][0]["extras"]["rendered_loss_nrms"] < 0.3


def test_glb_passes_the_khronos_validator(
    glb: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    modules = os.environ.get("SWATCHWORK_NODE_MODULES", str(ROOT / "target" / "node_modules"))
    if not (Path(modules) / "gltf-validator").is_dir():
        pytest.skip("the Khronos validator is not installed: make gltf-validator")
    monkeypatch.syspath_prepend(ROOT / "scripts" / "packaging")
    build_viewer = importlib.import_module("build_viewer")
    found = build_viewer.system_node() or build_viewer.packaged_node()
    if found is None:
        pytest.skip(f"there is no node: pip install '{build_viewer.NODE_PACKAGE}'")
    (tmp_path / "a.glb").write_bytes(glb)
    ask = (
        "require('gltf-validator').validateBytes(new Uint8Array(require('fs').readFileSync('a.glb')))"
        ".then(r => console.log(JSON.stringify(r.issues)))"
    )
    done = subprocess.run(
        [*found[0], "-e", ask],
        cwd=tmp_path,
        env=os.environ | {"NODE_PATH": modules},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    issues = json.loads(done.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


@pytest.mark.usefixtures("fitted")
def test_materialx_document_is_valid(kept: Path, tmp_path: Path) -> None:
    mx = pytest.importorskip("MaterialX", reason="MaterialX is not installed (extra: dev)")
    export_material(kept, tmp_path / "out", "materialx")
    document = mx.createDocument()
    libraries = mx.createDocument()
    mx.loadLibraries(["libraries"], mx.getDefaultDataSearchPath(), libraries)
    mx.readFromXmlFile(document, str(tmp_path / "out" / "material.mtlx"))
    document.importLibrary(libraries)
    valid, message = document.validate()
    assert valid, message
    shader = document.getNode("swatchwork_surface")
    assert shader.getNodeDef() is not None
    for image in document.getNodeGraph("swatchwork_maps").getNodes("image"):
        assert (tmp_path / "out" / image.getInputValue("file")).is_file()


def test_maps_say_what_they_are(kept: Path, material: Material, tmp_path: Path) -> None:
    export_material(kept, tmp_path / "out", "maps")
    said = json.loads((tmp_path / "out" / "maps.json").read_text())["maps"]
    found = {name: read_exr_channels(tmp_path / "out" / f"{name}.exr") for name in said}
    on = material.on_atlas
    wanted = material_maps(material)
    assert np.array_equal(found["diffuse"]["G"][on], wanted.diffuse[on, 1])
    assert np.allclose(found["roughness_perceptual"]["Y"] ** 2, found["roughness_sigma"]["Y"], rtol=1e-5)
    assert np.allclose(sum(found["blend_weights"].values()), 1, atol=1e-5)
    # The PNG, decoded as maps.json says, is the EXR to half a step of 8 bits.
    png = read_image(tmp_path / "out" / "diffuse.png").linear * said["diffuse"]["png_scale"]
    assert np.abs(png[..., 0] - found["diffuse"]["R"]).max() < 0.006 * said["diffuse"]["png_scale"]


@pytest.mark.usefixtures("fitted")
@pytest.mark.parametrize("target", ["gltf", "mitsuba", "blender"])
def test_command_writes_and_replaces_its_own(kept: Path, tmp_path: Path, target: str) -> None:
    for _ in range(2):
        assert main(["export", str(kept), "--format", target, "-o", str(tmp_path / "out"), "-q"]) == 0
    assert is_export_folder(tmp_path / "out")


@pytest.mark.usefixtures("fitted")
def test_states_what_its_loss_is_of(kept: Path, fit: StandardFit, tmp_path: Path) -> None:
    summary = export_material(kept, tmp_path / "out", "blender")
    head = json.loads((tmp_path / "out" / "export.json").read_text())
    assert head["rendered_loss_nrms"] == summary.rendered_loss == fit.loss_nrms
    assert head["rendered_loss_excludes"] == summary.rendered_loss_excludes
    assert "Blender's Fresnel, which follows n.o" in summary.in_words()
    assert export_material(kept, tmp_path / "a.glb", "gltf").rendered_loss_excludes is None


@pytest.mark.usefixtures("fitted")
def test_up_steers_gltf_and_the_made_up_scene(kept: Path, material: Material, tmp_path: Path) -> None:
    for given, up in ((None, "z"), ("y", "y"), ("z", "z")):
        export_material(kept, tmp_path / "a.glb", "gltf", up=given)  # type: ignore[arg-type]
        head, _ = parts((tmp_path / "a.glb").read_bytes())
        assert ("rotation" in head["nodes"][0]) == (up == "z")
        export_material(kept, tmp_path / "out", "blender", up=given)  # type: ignore[arg-type]
        (frame,) = json.loads((tmp_path / "out" / "scene.json").read_text())["frames"]
        pose = np.array(frame["world_from_camera"])
        # The picture's upward axis has a large share of the world's, its rightward axis none.
        axis = "xyz".index(up)
        assert pose[axis, 1] > 0.8
        assert pose[axis, 0] == pytest.approx(0, abs=1e-12)
    y, z = (Surroundings.made_up(material, up) for up in ("y", "z"))  # type: ignore[arg-type]
    # x, y, z of the one are x, z, -y of the other.
    towards = np.random.default_rng(0).normal(size=(20, 3))
    turned = towards[:, [0, 2, 1]] * [1, 1, -1]
    assert np.allclose(y.lights[0].lookup(turned), z.lights[0].lookup(towards))
    centre = (material.vertices.min(axis=0) + material.vertices.max(axis=0)) / 2
    assert np.allclose(y.cameras[0].project(centre)[0], 256)


@pytest.mark.usefixtures("fitted")
@pytest.mark.parametrize(
    ("target", "said"),
    [("mitsuba", "1 of 1 cameras have lens distortion and 1 of 1 .*square"), ("blender", "distortion: ")],
)
def test_warns_of_lenses_that_are_lost(
    kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: str, said: str
) -> None:
    """Blender has pixels that are not square."""
    seen = camera_towards(np.array([0.6, -0.7, 0.3]), 40)
    bent = replace(seen, fy=1.1 * seen.fy, k1=0.1)
    frames = Surroundings.of(["view"], [bent], [procedural_environment("overcast", 0)])
    monkeypatch.setattr(exporting, "_surroundings", lambda *_: frames)
    with pytest.warns(CaptureWarning, match=said):
        export_material(kept, tmp_path / "out", target)


@pytest.mark.usefixtures("not_fitted")
def test_refuses_what_is_not_its_own(kept: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter").write_text("1")
    with pytest.raises(InputError, match="is not an export"):
        export_material(kept, tmp_path / "thesis", "maps")
    (tmp_path / "other.glb").write_bytes(b"glTF of another")
    with pytest.raises(InputError, match="not written by swatchwork"):
        export_material(kept, tmp_path / "other.glb", "gltf")
    assert (tmp_path / "other.glb").read_bytes() == b"glTF of another"


@pytest.mark.usefixtures("fitted")
def test_a_file_for_a_folder_is_said_not_traced(kept: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("1")
    with pytest.raises(OutputError, match=r"a\.glb: cannot be written"):
        export_material(kept, tmp_path / "file" / "a.glb", "gltf")


@pytest.mark.usefixtures("not_fitted")
def test_a_file_that_cannot_be_read_is_said(
    kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_bytes(_: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "a.glb").write_bytes(b"1")
    monkeypatch.setattr(Path, "read_bytes", read_bytes)
    with pytest.raises(OutputError, match=r"a\.glb: cannot be replaced.*Permission denied"):
        export_material(kept, tmp_path / "a.glb", "gltf")


@pytest.mark.usefixtures("not_fitted")
@pytest.mark.parametrize(
    ("target", "options", "said"),
    [
        ("maps", {"convention": "blender"}, "maps holds neither.*--convention would do nothing"),
        ("gltf", {"cameras": "transforms.json"}, "gltf holds neither.*--cameras would"),
        ("materialx", {"environment": "a.hdr", "rotation": ("z", 90.0)}, "--environment and --environment-r"),
        ("maps", {"up": "z"}, "maps keeps the world's own axes, and --up would do nothing"),
        ("materialx", {"up": "y"}, "materialx keeps the world's own axes"),
        ("blender", {"up": "y", "cameras": "transforms.json"}, "--up is for the made-up view"),
        ("gltf", {"up": "x"}, "up is 'x'; expected y or z"),
    ],
)
def test_refuses_options_that_would_do_nothing(
    kept: Path, tmp_path: Path, target: str, options: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        export_material(kept, tmp_path / "out", target, **options)
    assert not (tmp_path / "out").exists()


def test_bad_requests_are_said(kept: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        export_material(tmp_path / "none", tmp_path / "out", "maps")
    with pytest.raises(InputError, match="no format 'usd'"):
        export_material(kept, tmp_path / "out", "usd")
    assert not (tmp_path / "out").exists()

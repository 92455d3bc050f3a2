# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Exported files: structure, colour spaces, refusals; checked by the formats' own tools where they are."""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow

from swatchwork.capture import read_exr_channels, read_image
from swatchwork.cli import main
from swatchwork.errors import InputError
from swatchwork.export import Padding, is_export_folder
from swatchwork.export.fitting import fit_standard
from swatchwork.export.gltf import glb_bytes
from swatchwork.material import Material, material_maps, write_material
from swatchwork.reflectance import paper
from swatchwork.simulate import four_materials, in_basis
from swatchwork.workflow import export_material
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
def glb(material: Material) -> bytes:
    return glb_bytes(material, fit_standard(material), Padding.of(material))


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


def test_glb_passes_the_khronos_validator(glb: bytes, tmp_path: Path) -> None:
    modules = os.environ.get("SWATCHWORK_NODE_MODULES", str(ROOT / "target" / "node_modules"))
    if shutil.which("node") is None or not (Path(modules) / "gltf-validator").is_dir():
        pytest.skip("the Khronos validator is not installed: make gltf-validator")
    (tmp_path / "a.glb").write_bytes(glb)
    ask = (
        "require('gltf-validator').validateBytes(new Uint8Array(require('fs').readFileSync('a.glb')))"
        ".then(r => console.log(JSON.stringify(r.issues)))"
    )
    done = subprocess.run(
        ["node", "-e", ask],
        cwd=tmp_path,
        env=os.environ | {"NODE_PATH": modules},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    issues = json.loads(done.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


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


@pytest.mark.parametrize("target", ["gltf", "mitsuba", "blender"])
def test_command_writes_and_replaces_its_own(kept: Path, tmp_path: Path, target: str) -> None:
    for _ in range(2):
        assert main(["export", str(kept), "--format", target, "-o", str(tmp_path / "out"), "-q"]) == 0
    assert is_export_folder(tmp_path / "out")


def test_refuses_what_is_not_its_own(kept: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter").write_text("1")
    with pytest.raises(InputError, match="is not an export"):
        export_material(kept, tmp_path / "thesis", "maps")
    (tmp_path / "other.glb").write_bytes(b"glTF of another")
    with pytest.raises(InputError, match="not written by swatchwork"):
        export_material(kept, tmp_path / "other.glb", "gltf")
    assert (tmp_path / "other.glb").read_bytes() == b"glTF of another"


def test_bad_requests_are_said(kept: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        export_material(tmp_path / "none", tmp_path / "out", "maps")
    with pytest.raises(InputError, match="no format 'usd'"):
        export_material(kept, tmp_path / "out", "usd")
    with pytest.raises(InputError, match="holds neither"):
        export_material(kept, tmp_path / "out", "maps", rotation=("z", 90.0))
    assert not (tmp_path / "out").exists()

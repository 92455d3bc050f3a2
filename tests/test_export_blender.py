# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The exported Blender script, run on a stand-in for Blender: what its nodes and cameras say."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blender_stand_in import blender, seen, shaded
from swatchwork.arrays import F64
from swatchwork.capture import Camera, read_image
from swatchwork.export import Padding, StandardFit, Surroundings, write_blender
from swatchwork.export.blender import terms
from swatchwork.export.standard import Standard, evaluate
from swatchwork.light import Environment
from swatchwork.simulate import look_at
from test_export_fitting import ggx_material, surfaces

COUNT = 200
CAMERAS = [
    Camera(640, 400, 700.0, 650.0, 300.0, 230.0, look_at([2.0, 1.0, 0.5])),
    Camera(300, 500, 410.0, 430.0, 160.0, 225.0, look_at([-1.0, 2.0, 1.5])),
]
LIGHT = Environment(
    np.random.default_rng(0).gamma(1, size=(16, 32, 3)).astype(np.float32), "mitsuba"
).rotated(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))


def script(folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[dict[str, Any], Any]:
    """The names of the folder's open_in_blender.py, and the bpy that it knows."""
    bpy, mathutils = blender()
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    monkeypatch.setitem(sys.modules, "mathutils", mathutils)
    file = folder / "open_in_blender.py"
    names: dict[str, Any] = {"__name__": "open_in_blender", "__file__": str(file)}
    exec(compile(file.read_text(encoding="utf-8"), str(file), "exec"), names)
    return names, bpy


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    p = surfaces(2)
    material = ggx_material(p)
    texels = int(material.on_atlas.sum())
    fit = StandardFit(p, np.arange(texels) % 2, 0.0, 0.0, 0.0)
    frames = Surroundings.of(["a", "b"], CAMERAS, [LIGHT] * 2)
    write_blender(tmp_path, material, fit, Padding.of(material), frames)
    return tmp_path


@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.2])
def test_nodes_are_the_fitted_model(folder: Path, monkeypatch: pytest.MonkeyPatch, tilt: float) -> None:
    """In the mirror direction, where o.h = n.o; metallic is fractional."""
    names, _ = script(folder, monkeypatch)
    p = surfaces(COUNT, 3)
    assert ((p.metallic > 0) & (p.metallic < 1)).all()
    o = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    i = o * [-1, -1, 1]
    found = shaded(names["material"]().node_tree.nodes, terms(p), np.full(COUNT, o[2]))
    one = np.ones(COUNT)
    lobe = evaluate(Standard(np.ones((COUNT, 3)), one, p.roughness, one, np.ones((COUNT, 3))), i, o)
    whole = found["ShaderNodeBsdfDiffuse"] / np.pi + found["ShaderNodeBsdfAnisotropic"] * lobe
    assert np.allclose(whole, evaluate(p, i, o), rtol=1e-10)


def test_maps_are_those_the_script_names(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names, _ = script(folder, monkeypatch)
    nodes = names["material"]().node_tree.nodes
    images = {n.label: n.image for n in nodes if n.kind == "ShaderNodeTexImage"}
    assert set(images) == {*terms(surfaces(2)), "roughness"}
    for name, image in images.items():
        assert Path(image.file).is_file()
        colour = name not in ("roughness", "dielectric")
        assert image.colorspace_settings.name == ("Linear Rec.709" if colour else "Non-Color")
        if name != "roughness":
            stored = read_image(folder / f"{name}.exr").linear.reshape(-1, 3)
            # Half floats keep 11 bits.
            for row in terms(surfaces(2))[name]:
                assert np.abs(stored - row).max(axis=1).min() < 1e-3


def test_cameras_see_what_ours_see(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names, bpy = script(folder, monkeypatch)
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 3))
    frames = json.loads((folder / "scene.json").read_text())["frames"]
    for frame, camera in zip(frames, CAMERAS, strict=True):
        made = names["camera"](frame)
        names["show"](bpy.context.scene, frame, {frame["name"]: made}, {frame["light"]: None})
        found = seen(made, bpy.context.scene.render, points)
        assert np.allclose(found, camera.project(points)[0], atol=1e-9)


def test_light_lies_in_the_world_as_ours(folder: Path) -> None:
    """A direction d is looked up at R^T d in Blender's layout, R that of scene.json."""
    (said,) = json.loads((folder / "scene.json").read_text())["lights"]
    raster = read_image(folder / said["file"]).linear
    towards: F64 = np.random.default_rng(2).normal(size=(50, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    turned = Environment(raster, "blender", np.array(said["world_from_environment"]))
    assert np.allclose(turned.lookup(towards), LIGHT.lookup(towards), rtol=1e-5)

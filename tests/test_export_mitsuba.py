# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The exported Mitsuba folder, run as its user would: in a process that knows nothing of this package."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from swatchwork.capture import read_image
from swatchwork.export import Padding, Surroundings
from swatchwork.export.mitsuba import write_mitsuba
from swatchwork.export.surroundings import latitude_longitude, with_rows_at_poles
from swatchwork.light import Environment, direction_from_uv, uv_from_direction
from swatchwork.material import BasisRecord, Material
from swatchwork.reflectance import GenericBasis, extended, paper
from swatchwork.relight import RelitScene, render
from swatchwork.simulate import (
    blend_pattern,
    camera_towards,
    four_materials,
    in_basis,
    procedural_environment,
    shape,
)
from swatchwork.surface import build_atlas

pytest.importorskip("mitsuba", reason="the other renderer is not installed (extra: oracle)")

SIZE, SAMPLES = 40, 256


def ball(basis: GenericBasis, representatives: np.ndarray, resolution: int = 48) -> Material:
    mesh = shape("sphere", 32)
    atlas = build_atlas(mesh, resolution)
    found, of = blend_pattern(atlas.position(slice(None)), materials=len(representatives), blended=2, seed=0)
    square = (resolution, resolution)
    index, weight = np.zeros((*square, 2), np.uint32), np.zeros((*square, 2), np.float32)
    coverage = np.full(square, -1, np.int32)
    index[atlas.row, atlas.col], weight[atlas.row, atlas.col] = found, of
    coverage[atlas.row, atlas.col] = 1
    assert mesh.uv is not None
    return Material(
        BasisRecord(basis.name, tuple(basis.sigmas.tolist()), basis.maskings, basis.diffuse, basis.fresnel),
        representatives,
        index,
        weight,
        coverage,
        np.zeros(square, np.float32),
        mesh.vertices,
        mesh.faces,
        mesh.normals,
        mesh.uv,
    )


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Python in the folder, without this package on its path."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    return subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


PROBE = """
import json, sys
import mitsuba as mi
mi.set_variant("scalar_rgb")
import swatchwork_bsdf
bsdf = next(s.bsdf() for s in mi.load_file("scene.xml").shapes())
asked = json.load(open("asked.json"))
found = {"values": [], "pdfs": [], "samples": []}
for i, o in zip(asked["i"], asked["o"]):
    si = mi.SurfaceInteraction3f()
    si.uv, si.wi = mi.Point2f(0.5, 0.5), mi.Vector3f(o)
    found["values"].append([float(x) for x in bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(i))])
    found["pdfs"].append(float(bsdf.pdf(mi.BSDFContext(), si, mi.Vector3f(i))))
for s in asked["samples"]:
    si = mi.SurfaceInteraction3f()
    si.uv, si.wi = mi.Point2f(0.5, 0.5), mi.Vector3f(asked["o"][0])
    bs, w = bsdf.sample(mi.BSDFContext(), si, s[0], mi.Point2f(s[1], s[2]))
    found["samples"].append([float(x) for x in w])
json.dump(found, open("found.json", "w"))
"""


@pytest.mark.parametrize("basis", [paper(), extended()], ids=lambda basis: basis.name)
def test_plugin_is_the_model_to_rounding(tmp_path: Path, basis: GenericBasis) -> None:
    rng = np.random.default_rng(3)
    representatives = rng.gamma(0.3, 0.1, (4, basis.kernels, 3)) * (
        rng.uniform(size=(4, basis.kernels, 1)) < 0.3
    )
    material = ball(basis, representatives)
    write_mitsuba(tmp_path, material, Padding.of(material), Surroundings.made_up(material))
    i, o = rng.normal(size=(2, 60, 3))
    i[:, 2], o[:, 2] = np.abs(i[:, 2]) + 0.05, np.abs(o[:, 2]) + 0.05
    # Near the mirror direction as well, where sharp lobes are.
    i[:30] = o[:30] * [-1, -1, 1] + 0.02 * i[:30]
    i, o = (d / np.linalg.norm(d, axis=1, keepdims=True) for d in (i, o))
    samples = rng.uniform(size=(400, 3))
    asked = {"i": i.tolist(), "o": o.tolist(), "samples": samples.tolist()}
    (tmp_path / "asked.json").write_text(json.dumps(asked))
    done = run(tmp_path, "-c", PROBE)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "found.json").read_text())

    weights = RelitScene.of(material).blend_at(np.array([[0.5, 0.5]]))[0]
    folded = np.einsum("n,njc->jc", weights, representatives)
    wanted = basis.evaluate(i, o) @ folded * i[:, 2:]
    # Single precision: a sharp lobe's exponent amplifies the rounding of n.h.
    assert np.allclose(found["values"], wanted, rtol=5e-3, atol=1e-5 * wanted.max())
    assert min(found["pdfs"]) > 0
    # Importance sampling: the mean of value / pdf is the albedo.
    albedo = basis.albedo(float(o[0, 2])) @ folded
    spread = np.std(found["samples"], axis=0) / np.sqrt(len(samples))
    assert (np.abs(np.mean(found["samples"], axis=0) - albedo) < 4 * spread + 0.02 * albedo).all()


def test_renders_what_relight_renders(tmp_path: Path) -> None:
    basis = paper()
    material = ball(basis, in_basis(four_materials(0), basis))
    camera = camera_towards(np.array([0.6, -0.7, 0.3]), SIZE)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    light = procedural_environment("overcast", 0).rotated(turn)
    write_mitsuba(tmp_path, material, Padding.of(material), Surroundings.of(["view.exr"], [camera], [light]))
    done = run(tmp_path, "render.py", "--spp", str(SAMPLES))
    if done.returncode != 0 and "LLVM" in done.stderr:
        pytest.skip("Mitsuba finds no LLVM library here, and its scalar variant takes minutes")
    assert done.returncode == 0, done.stderr
    theirs = read_image(tmp_path / "renders" / "view.exr")
    ours = render(RelitScene.of(material), camera, light)
    on = ours[..., 3] > 0.999
    assert theirs.alpha is not None
    assert np.abs(theirs.alpha - ours[..., 3]).mean() < 5e-3
    error = (theirs.linear - ours[..., :3])[on]
    # 256 jittered samples leave one to two percent of noise, the operator up to one of its own.
    assert np.sqrt((error**2).sum() / (ours[..., :3][on] ** 2).sum()) < 0.035
    # Noise averages out, a tilted light or a wrong factor would not.
    assert np.allclose(theirs.linear[on].mean(axis=0), ours[..., :3][on].mean(axis=0), rtol=0.01)


@pytest.mark.parametrize("convention", ["blender", "mitsuba", "debevec-angular"])
def test_one_bright_texel_is_where_mitsuba_looks_for_it(convention: str) -> None:
    side = 64
    towards = np.array([0.36, 0.48, -0.8])
    radiance = np.zeros((side, side if convention == "debevec-angular" else 2 * side, 3), np.float32)
    u, v = uv_from_direction(convention, towards)
    radiance[int(v * radiance.shape[0]), int(u * radiance.shape[1])] = 1
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    light = Environment(radiance, convention).rotated(turn)
    raster, world_from_mitsuba = latitude_longitude(light)
    image = with_rows_at_poles(raster)[..., 0]
    row, col = np.unravel_index(int(image.argmax()), image.shape)
    # Mitsuba's rows reach from pole to pole; its columns have centres at +0.5.
    place = np.array([(col + 0.5) / image.shape[1], row / (image.shape[0] - 1)])
    found = world_from_mitsuba @ direction_from_uv("mitsuba", place)
    assert found @ (turn @ towards) > np.cos(2 * np.pi / side)

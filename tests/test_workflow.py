# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From folder to folder: costs, warnings, lights, and that nothing is half-written."""

from __future__ import annotations

import json
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swatchwork.capture import read_capture
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.material import normal_albedo, read_material
from swatchwork.simulate import simulate_capture
from swatchwork.workflow import (
    CostRecorder,
    ReconstructOptions,
    SolveOptions,
    describe,
    evaluate_folders,
    reconstruct_folder,
    relight_folder,
)
from swatchwork.workflow.recovery import collected_warnings, warn_of_bright_materials, whole_folder_is_free
from swatchwork.workflow.relighting import given_environment, rotation_matrix


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "capture"
    simulate_capture(folder, rows=24, k=4, test_views=2, size=48, seed=1, materials=2, blended=1, sharp=True)
    return folder


@pytest.fixture(scope="module")
def material(capture: Path) -> Path:
    folder = capture.parent / "material"
    options = ReconstructOptions(32, "paper", texels=200, solve=SolveOptions(n=1, N=2))
    summary = reconstruct_folder(capture, folder, options)
    assert (summary.n, summary.N, summary.views, summary.resolution) == (1, 2, 4, 32)
    stages = [stage.name for stage in summary.stages]
    assert stages[:6] == ["read", "surface", "observe", "frames", "respond", "solve"]
    assert set(stages[6:-3]) <= {"survey", "solve on"}  # as often as the subset grows
    assert stages[-3:] == ["blend", "trust", "write"]
    json.dumps(summary.as_dict(), allow_nan=False)
    return folder


def test_material_folder_is_whole(material: Path) -> None:
    found = read_material(material)
    assert (found.n, found.N, found.basis.name) == (1, 2, "paper")
    assert {"transforms.json", "mesh.obj", "env.exr", "images/0001.exr"} <= set(found.inputs)
    assert "Content-Security-Policy" in (material / "report.html").read_text(encoding="utf-8")
    assert 'href="viewer.html"' in (material / "report.html").read_text(encoding="utf-8")
    viewer = (material / "viewer.html").read_text(encoding="utf-8")
    assert "Content-Security-Policy" in viewer and '"images/0001.exr"' in viewer
    assert [p.name for p in material.parent.iterdir() if p.name.startswith(".")] == []


def test_relight_and_evaluate(capture: Path, material: Path, tmp_path: Path) -> None:
    done = relight_folder(material, capture / "test", tmp_path, turntable_frames=2)
    assert [Path(f).name for f in done.files] == ["0001.exr", "0002.exr"]
    assert (tmp_path / "turntable.gif").exists() and (tmp_path / "0001.png").exists()
    measured = evaluate_folders(tmp_path, capture / "test", rim=True)
    # 48-pixel pictures of two hard-edged materials: edges alone cost ten per cent or two; 0.5 is nonsense.
    assert measured.nrms < 0.5
    assert measured.nrms_inner is not None


def test_a_missing_occluder_is_named(capture: Path, material: Path, tmp_path: Path) -> None:
    cameras = json.loads((capture / "test/transforms.json").read_text())
    cameras["occluders"] = ["table.obj"]
    (tmp_path / "transforms.json").write_text(json.dumps(cameras))
    with pytest.raises(InputError, match=r"transforms\.json: the occluder \S*table\.obj does not exist"):
        relight_folder(
            material, tmp_path, tmp_path / "renders", environment=capture / "env.exr", convention="blender"
        )
    assert not (tmp_path / "renders").exists()


def test_turntables_of_either_type(capture: Path, material: Path, tmp_path: Path) -> None:
    done = relight_folder(material, capture / "test", tmp_path, turntable_frames=2, turntable_format="mp4")
    assert done.turntable == str(tmp_path / "turntable.mp4") and Path(done.turntable).stat().st_size > 0


def test_materials_brighter_than_their_light_are_warned_of(capture: Path, material: Path) -> None:
    found, given = read_material(material), read_capture(capture)
    warn_of_bright_materials(found, given)  # a CaptureWarning would be an error here
    albedo = np.einsum("j,njc->nc", normal_albedo(found.basis), found.representatives).max(axis=1)
    scale = 2 / albedo
    brighter = replace(found, representatives=found.representatives * [[[scale[0]]], [[0.5 * scale[1]]]])
    with pytest.warns(CaptureWarning, match=r"representative 1 \(albedo 2\.00, .* Check that photographs"):
        warn_of_bright_materials(brighter, given)
    # One that carries no weight says nothing of the capture.
    unused = replace(brighter, index=np.ones_like(found.index))
    warn_of_bright_materials(unused, given)


def test_views_uses_the_first_frames(capture: Path, tmp_path: Path) -> None:
    options = ReconstructOptions(16, "paper", texels=50, solve=SolveOptions(n=1, N=1))
    assert reconstruct_folder(capture, tmp_path / "m", options, views=2).views == 2
    with pytest.raises(InputError, match="5 frames asked for"):
        reconstruct_folder(capture, tmp_path / "x", options, views=5)
    assert not (tmp_path / "x").exists()


def test_describe(capture: Path, material: Path) -> None:
    assert describe(capture)["photographs"] == 4
    assert describe(material)["N"] == 2


def test_output_that_is_something_else_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="not a material folder"):
        reconstruct_folder(tmp_path / "no-such-capture", tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]
    with whole_folder_is_free(tmp_path / "new"):
        assert not (tmp_path / "new").exists()


def test_costs_are_those_of_outermost_stages() -> None:
    costs = CostRecorder()
    with costs.stage("outer"), costs.stage("inner"):
        block = np.ones(4_000_000)
        time.sleep(0.02)
    assert block.size and [c.name for c in costs.costs] == ["outer"]
    assert costs.costs[0].seconds >= 0.02
    # 32 MB of ones were resident.
    assert costs.costs[0].peak_mb > 32


def test_warnings_are_collected_once_and_passed_on() -> None:
    heard: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("always", CaptureWarning)
        warnings.showwarning = lambda message, *rest: heard.append(str(message))
        with collected_warnings() as said:
            for _ in range(2):
                warnings.warn("odd", CaptureWarning, stacklevel=1)
    assert said == ["odd"] and heard == ["odd", "odd"]


def test_rotation_is_right_handed() -> None:
    # A quarter turn about z takes x to y; exact to rounding of the cosine.
    assert rotation_matrix(("z", 90.0)) @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=1e-15)
    assert rotation_matrix(("x", 90.0)) @ [0, 1, 0] == pytest.approx([0, 0, 1], abs=1e-15)
    assert rotation_matrix(("y", 90.0)) @ [0, 0, 1] == pytest.approx([1, 0, 0], abs=1e-15)
    assert np.array_equal(rotation_matrix(None), np.eye(3))


def test_environment_and_convention_come_together() -> None:
    assert given_environment(None, None) is None
    with pytest.raises(InputError, match="--convention"):
        given_environment("sky.exr", None)
    with pytest.raises(InputError, match="--environment FILE"):
        given_environment(None, "blender")

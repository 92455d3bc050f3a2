# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A light probe put into a capture."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from swatchwork.capture import (
    Camera,
    Capture,
    EnvironmentSource,
    Frame,
    read_capture,
    write_capture,
    write_exr,
)
from swatchwork.cli import main
from swatchwork.errors import InputError, OutputError
from swatchwork.simulate import shape
from swatchwork.surface import write_mesh_obj
from swatchwork.workflow.lighting import light_capture


@pytest.fixture
def unlit(tmp_path):
    """A capture of one frame, 8 pixels wide, that says nothing of its light."""
    folder = tmp_path / "capture"
    (folder / "images").mkdir(parents=True)
    write_mesh_obj(folder / "mesh.obj", shape("sphere", 6))
    write_exr(folder / "images" / "a.exr", np.ones((8, 8, 3), np.float32))
    pose = np.eye(4)
    pose[2, 3] = 5.0
    camera = Camera(8, 8, 10.0, 10.0, 4.0, 4.0, pose)
    frame = Frame("images/a.exr", folder / "images" / "a.exr", None, 1.0, camera, None)
    file = folder / "transforms.json"
    write_capture(Capture(folder, file, folder / "mesh.obj", (), None, (frame,)), folder)
    return folder


@pytest.fixture
def probe(tmp_path):
    write_exr(tmp_path / "probe.exr", np.full((8, 16, 3), 2.0, np.float32))
    return EnvironmentSource(tmp_path / "probe.exr", "blender")


def test_a_capture_without_light_gets_one(unlit, probe):
    with pytest.raises(InputError):
        read_capture(unlit)
    light_capture(unlit, probe)
    lit = read_capture(unlit)
    assert lit.environment is not None and lit.environment.file == unlit / "env.exr"
    assert lit.environment.convention == "blender" and lit.frames[0].environment is lit.environment


def test_a_better_probe_replaces_the_first(unlit, probe, tmp_path):
    light_capture(unlit, probe)
    write_exr(tmp_path / "better.exr", np.full((8, 16, 3), 3.0, np.float32))
    light_capture(unlit, replace(probe, file=tmp_path / "better.exr", convention="mitsuba"))
    lit = read_capture(unlit)
    assert lit.environment is not None and lit.environment.convention == "mitsuba"
    assert (unlit / "env.exr").read_bytes() == (tmp_path / "better.exr").read_bytes()


def test_another_light_is_not_overwritten(unlit, probe):
    file = light_capture(unlit, probe)
    (unlit / "env.exr").rename(unlit / "mine.exr")
    document = json.loads(file.read_text())
    document["environment"]["file"] = "mine.exr"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"has a light already, mine\.exr"):
        light_capture(unlit, probe)


def test_a_damaged_probe_leaves_the_capture_as_it_was(unlit, probe, tmp_path):
    before = (unlit / "transforms.json").read_bytes()
    (tmp_path / "probe.exr").write_bytes(b"no EXR")
    with pytest.raises(InputError):
        light_capture(unlit, probe)
    assert (unlit / "transforms.json").read_bytes() == before
    assert sorted(f.name for f in unlit.iterdir()) == ["images", "mesh.obj", "transforms.json"]


def test_a_file_that_is_not_the_light_is_not_overwritten(unlit, probe):
    (unlit / "env.exr").write_bytes(b"somebody's own")
    with pytest.raises(InputError, match=r"env\.exr: is there already, and is not the capture's light"):
        light_capture(unlit, probe)
    assert (unlit / "env.exr").read_bytes() == b"somebody's own"


@pytest.mark.parametrize("lit", [False, True])
def test_a_capture_that_cannot_be_written_is_as_it_was(unlit, probe, tmp_path, monkeypatch, lit):
    if lit:
        light_capture(unlit, probe)
    before = {f.name: f.read_bytes() for f in unlit.iterdir() if f.is_file()}

    def full(*_):
        raise OutputError("transforms.json: cannot be written (No space left on device)")

    monkeypatch.setattr("swatchwork.workflow.lighting.write_capture", full)
    write_exr(tmp_path / "better.exr", np.full((8, 16, 3), 3.0, np.float32))
    with pytest.raises(OutputError, match="No space left"):
        light_capture(unlit, replace(probe, file=tmp_path / "better.exr"))
    assert {f.name: f.read_bytes() for f in unlit.iterdir() if f.is_file()} == before


def test_the_capture_is_read_before_the_work(unlit, probe, tmp_path, capsys):
    # The photograph shows no ball: an error about the capture came first.
    write_exr(tmp_path / "ball.exr", np.ones((8, 8, 3), np.float32))
    command = ["prepare", "probe", str(tmp_path / "ball.exr"), "-o", str(tmp_path / "out")]
    command += ["--pose", f"{unlit / 'transforms.json'}#a", "--capture"]
    assert main([*command, str(tmp_path / "none")]) == 2
    assert "none" in capsys.readouterr().err
    (unlit / "env.exr").write_bytes(b"somebody's own")
    assert main([*command, str(unlit)]) == 2
    assert "is not the capture's light" in capsys.readouterr().err
    (unlit / "env.exr").unlink()
    file = light_capture(unlit, probe)
    file.write_text(file.read_text().replace("env.exr", "mine.exr"))
    assert main([*command, str(unlit)]) == 2
    assert "has a light already, mine.exr" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_world_is_needed(unlit, tmp_path, capsys):
    write_exr(tmp_path / "ball.exr", np.ones((8, 8, 3), np.float32))
    command = ["prepare", "probe", str(tmp_path / "ball.exr"), "-o", str(tmp_path / "probe")]
    assert main([*command, "--capture", str(unlit)]) == 2
    assert "--capture is given without --pose" in capsys.readouterr().err

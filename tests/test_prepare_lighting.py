# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A light probe put into a capture."""

from __future__ import annotations

import json
from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest

from scripts_of import scripts_of
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

with scripts_of("faults"):
    from stepping import fresh_copy, stepped


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
    better = (tmp_path / "better.exr").read_bytes()
    assert lit.environment.file.name == f"env-{sha256(better).hexdigest()[:8]}.exr"
    assert lit.environment.file.read_bytes() == better
    assert (unlit / "env.exr").read_bytes() == probe.file.read_bytes()
    # And back again, under the first one's name; each as often as one likes.
    for _ in range(2):
        light_capture(unlit, probe)
        assert read_capture(unlit).environment.file == unlit / "env.exr"
    assert len(list(unlit.glob("env*"))) == 2


@pytest.mark.parametrize("lit", [False, True])
def test_killed_at_any_step_light_and_convention_belong_together(unlit, probe, tmp_path, lit):
    work = tmp_path / "work"
    if lit:
        light_capture(unlit, probe)
    write_exr(tmp_path / "better.exr", np.full((8, 16, 3), 3.0, np.float32))
    better = replace(probe, file=tmp_path / "better.exr", convention="mitsuba")
    pairs = {probe.file.read_bytes(): "blender", better.file.read_bytes(): "mitsuba"}
    seen = set()

    def action():
        light_capture(work, better)
        return 0

    for ended in stepped(action, lambda: fresh_copy(unlit, work), work, "kill"):
        light = json.loads(ended.files["transforms.json"]).get("environment")
        assert light is None or pairs[ended.files[light["file"]]] == light["convention"], ended.step
        seen.add(light and light["convention"])
    assert len(seen) == 2 or ended.step > 2
    # The same command goes on from where it was killed before the photographs' file.
    fresh_copy(unlit, work)
    name = f"env-{sha256(better.file.read_bytes()).hexdigest()[:8]}.exr" if lit else "env.exr"
    (work / name).write_bytes(better.file.read_bytes())
    light_capture(work, better)
    assert read_capture(work).environment.file.name == name


def test_a_name_by_content_with_other_content_is_not_overwritten(unlit, probe):
    (unlit / "env.exr").write_bytes(b"somebody's own")
    name = f"env-{sha256(probe.file.read_bytes()).hexdigest()[:8]}.exr"
    (unlit / name).write_bytes(b"changed")
    with pytest.raises(InputError, match="is there already with other content than its name says"):
        light_capture(unlit, probe)
    assert (unlit / name).read_bytes() == b"changed"


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
    light_capture(unlit, probe)
    assert read_capture(unlit).environment.file.read_bytes() == probe.file.read_bytes()
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

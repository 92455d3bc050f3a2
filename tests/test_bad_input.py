# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One valid tiny capture and one wrong thing each, through the command line: exit code and message."""

from __future__ import annotations

import errno
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.capture import read_image, write_exr
from swatchwork.cli import main
from swatchwork.simulate import simulate_capture

QUICK = ["--basis", "paper", "--n", "1", "--N", "2", "--resolution", "24", "--texels", "60", "--quiet"]


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of three 24-pixel photographs of a small sphere, and its material."""
    folder = tmp_path_factory.mktemp("valid")
    simulate_capture(folder / "capture", rows=12, k=3, test_views=1, size=24, materials=2, blended=1)
    assert reconstruct(folder / "capture", folder / "material") == 0
    return folder


@pytest.fixture
def work(valid: Path, tmp_path: Path) -> Path:
    """A copy of it to spoil."""
    shutil.copytree(valid, tmp_path, dirs_exist_ok=True)
    return tmp_path


def reconstruct(capture: Path, output: Path, *options: str) -> int:
    return main(["reconstruct", str(capture), "-o", str(output), *QUICK, *options])


def edit_json(capture: Path, change: Callable[[dict[str, Any]], object]) -> None:
    file = capture / "transforms.json"
    head = json.loads(file.read_text(encoding="utf-8"))
    change(head)
    file.write_text(json.dumps(head), encoding="utf-8")


def edit_pose(capture: Path, change: Callable[[np.ndarray], object]) -> None:
    def turned(head: dict[str, Any]) -> None:
        pose = np.array(head["frames"][1]["transform_matrix"])
        change(pose)
        head["frames"][1]["transform_matrix"] = pose.tolist()

    edit_json(capture, turned)


def edit_pixel(file: Path, value: float) -> None:
    image = read_image(file)
    alpha = image.alpha if image.alpha is not None else np.ones(image.linear.shape[:2], np.float32)
    pixels = np.concatenate([image.linear, alpha[..., None]], axis=-1)
    pixels[12, 12, 1] = value
    write_exr(file, pixels)


def edit_text(file: Path, change: Callable[[str], str]) -> None:
    file.write_text(change(file.read_text(encoding="utf-8")), encoding="utf-8")


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def frame_key(key: str, value: object) -> Callable[[Path], None]:
    return lambda c: edit_json(c, lambda head: head["frames"][1].update({key: value}))


def without_faces(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if not line.startswith("f ")) + "\n"


def flattened(text: str) -> str:
    """Every face's corners are one vertex."""
    lines = text.splitlines()
    return "\n".join(
        "f " + " ".join([line.split()[1]] * 3) if line.startswith("f ") else line for line in lines
    )


def away(pose: np.ndarray) -> None:
    """Look the other way: half a turn about the camera's own up axis."""
    pose[:3, 0] *= -1
    pose[:3, 2] *= -1


SECOND = "images/0002.exr"

REFUSED: dict[str, tuple[Callable[[Path], object], tuple[str, ...]]] = {
    "no capture": (shutil.rmtree, ("transforms.json", "no such file")),
    "missing photograph": (lambda c: (c / SECOND).unlink(), ("transforms.json", SECOND)),
    "truncated photograph": (lambda c: cut(c / SECOND), (SECOND, "truncated")),
    "empty photograph": (lambda c: (c / SECOND).write_bytes(b""), (SECOND,)),
    "missing mesh": (lambda c: (c / "mesh.obj").unlink(), ("mesh.obj",)),
    "truncated mesh": (
        lambda c: edit_text(c / "mesh.obj", lambda text: text[: text.rindex("/")].rpartition(" ")[0]),
        ("mesh.obj", "truncated"),
    ),
    "missing environment": (lambda c: (c / "env.exr").unlink(), ("env.exr",)),
    "truncated environment": (lambda c: cut(c / "env.exr"), ("env.exr", "truncated")),
    "truncated JSON": (lambda c: cut(c / "transforms.json"), ("transforms.json", "not JSON", "truncated")),
    "JSON of another version": (
        lambda c: edit_json(c, lambda head: head.update(format_version=99)),
        ("transforms.json", "format_version", "99"),
    ),
    "NaN radiance": (lambda c: edit_pixel(c / SECOND, np.nan), (SECOND, "NaN", "row 12, column 12")),
    "infinite radiance": (lambda c: edit_pixel(c / SECOND, np.inf), (SECOND, "infinite", "row 12")),
    "negative radiance": (lambda c: edit_pixel(c / SECOND, -3.0), (SECOND, "negative", "-3")),
    "negative light": (lambda c: edit_pixel(c / "env.exr", -3.0), ("env.exr", "negative")),
    "NaN light": (lambda c: edit_pixel(c / "env.exr", np.nan), ("env.exr", "NaN")),
    "black light": (
        lambda c: write_exr(c / "env.exr", np.zeros((8, 16, 3), np.float32)),
        ("env.exr", "all black"),
    ),
    "size against intrinsics": (frame_key("w", 25), (SECOND, "24 x 24", "25 x 24")),
    "pose not rigid": (
        lambda c: edit_pose(c, lambda pose: pose.__setitem__((slice(3), 0), 2 * pose[:3, 0])),
        (SECOND, "not rigid"),
    ),
    "pose mirrored": (
        lambda c: edit_pose(c, lambda pose: pose.__setitem__((slice(3), 0), -pose[:3, 0])),
        (SECOND, "mirrored"),
    ),
    "pose not finite": (
        lambda c: edit_pose(c, lambda pose: pose.__setitem__((0, 3), np.nan)),
        (SECOND, "finite"),
    ),
    "mesh without faces": (
        lambda c: edit_text(c / "mesh.obj", without_faces),
        ("mesh.obj", "no faces", "triangle mesh"),
    ),
    "degenerate triangles only": (
        lambda c: edit_text(c / "mesh.obj", flattened),
        ("mesh.obj", "triangles are degenerate"),
    ),
    "frame that sees nothing": (lambda c: edit_pose(c, away), (SECOND, "no texel is visible")),
    "frame masked out": (
        lambda c: write_exr(c / SECOND, np.zeros((24, 24, 4), np.float32)),
        (SECOND, "none of", "valid pixels"),
    ),
    "no frames": (
        lambda c: edit_json(c, lambda head: head.update(frames=[])),
        ("transforms.json", "frames", "k >= 1"),
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case: str, work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoil, parts = REFUSED[case]
    spoil(work / "capture")
    before = {path.name for path in work.iterdir()}
    assert reconstruct(work / "capture", work / "out") == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert [part for part in parts if part not in captured.err] == [], captured.err
    assert captured.err.count("error: ") == 1 and "Traceback" not in captured.err
    assert {path.name for path in work.iterdir()} == before


def test_zero_views(work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert reconstruct(work / "capture", work / "out", "--views", "0") == 2
    said = capsys.readouterr().err
    assert "--views" in said and "greater than or equal to 1" in said
    assert not (work / "out").exists()


def overlapping(text: str) -> str:
    """Every UV is mirrored into the left half of the square: two triangles lie on each point there."""
    lines = []
    for line in text.splitlines():
        if line.startswith("vt "):
            u, v = map(float, line.split()[1:3])
            line = f"vt {min(u, 1 - u)} {v}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def one_degenerate(text: str) -> str:
    corner = next(line for line in text.splitlines() if line.startswith("f ")).split()[1]
    return text.rstrip("\n") + f"\nf {corner} {corner} {corner}\n"


ACCEPTED: dict[str, tuple[Callable[[Path], object], tuple[str, ...]]] = {
    "overlapping UVs": (lambda c: edit_text(c / "mesh.obj", overlapping), ("UVs overlap", "unwrapped anew")),
    "a degenerate triangle": (lambda c: edit_text(c / "mesh.obj", one_degenerate), ("degenerate",)),
}


@pytest.mark.parametrize("case", ACCEPTED)
def test_legal_but_suspicious(case: str, work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoil, parts = ACCEPTED[case]
    spoil(work / "capture")
    assert reconstruct(work / "capture", work / "out") == 0
    said = capsys.readouterr().err
    assert said.startswith("warning: ")
    assert [part for part in parts if part not in said] == [], said


def test_unseen_texels_are_filled_and_marked(work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert reconstruct(work / "capture", work / "out", "--views", "1", "--json") == 0
    assert json.loads(capsys.readouterr().out)["unseen"] > 0
    from swatchwork.material import read_material

    found = read_material(work / "out")
    unseen = found.coverage == 0
    assert unseen.any()
    # A blend like any other: it is the nearest seen texel's.
    np.testing.assert_allclose(found.weight[unseen].sum(axis=-1), 1, atol=1e-6)


def test_material_of_another_version(work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = work / "material" / "svbrdf.json"
    edit_text(head, lambda text: text.replace('"schema_version": 1', '"schema_version": 7'))
    cameras = str(work / "capture" / "transforms.json")
    assert main(["relight", str(work / "material"), "--cameras", cameras, "-o", str(work / "r")]) == 2
    said = capsys.readouterr().err
    assert "svbrdf.json" in said and "schema version 7" in said
    assert not (work / "r").exists()


def full(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_full_disk(work: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The earlier material stays as it is, and the finished parts of the new one."""
    before = (work / "material" / "svbrdf.json").read_bytes()
    monkeypatch.setattr("swatchwork.material.folder.exr_in_bands", full)
    assert reconstruct(work / "capture", work / "material") == 2
    said = capsys.readouterr().err
    assert "material" in said and "No space left" in said and "Traceback" not in said
    assert (work / "material" / "svbrdf.json").read_bytes() == before
    assert {path.name for path in work.iterdir()} == {"capture", "material", "material.partial"}


def test_full_disk_while_simulating(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("swatchwork.simulate.captures.write_mesh_obj", full)
    assert main(["demo", str(tmp_path / "demo"), "--quiet"]) == 2
    assert "No space left" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_interrupted(work: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    before = (work / "material" / "svbrdf.json").read_bytes()

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("swatchwork.workflow.recovery.write_report", interrupted)
    assert reconstruct(work / "capture", work / "material") == 130
    assert "nothing was half-written" in capsys.readouterr().err
    assert (work / "material" / "svbrdf.json").read_bytes() == before
    assert {path.name for path in work.iterdir()} == {"capture", "material", "material.partial"}
    monkeypatch.undo()
    assert reconstruct(work / "capture", work / "material") == 0
    assert {path.name for path in work.iterdir()} == {"capture", "material"}

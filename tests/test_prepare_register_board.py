# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Boards and spheres to a capture, by the command."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from board_photographs import COUNT, LENS, MESH_FROM_BOARD, clicks, photograph, thing, truth
from swatchwork.capture import read_capture
from swatchwork.cli import main
from swatchwork.prepare.registering import apart, write_pairs
from swatchwork.surface import read_mesh, write_mesh_obj
from test_prepare_register_spheres import LENS as BALL_LENS
from test_prepare_register_spheres import RADIUS, view_of


def write_lens(file: Path, lens) -> None:  # type: ignore[no-untyped-def]
    keys = {"w": "width", "h": "height", "fl_x": "fx", "fl_y": "fy"}
    names = ("w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2")
    file.write_text(json.dumps({name: getattr(lens, keys.get(name, name)) for name in names}))


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("board")
    (folder / "photos").mkdir()
    (folder / "masks").mkdir()
    for i in range(COUNT):
        view = photograph(i)
        cv2.imwrite(str(folder / "photos" / f"b{i}.png"), view.gray)
        cv2.imwrite(str(folder / "masks" / f"b{i}.png"), view.region.astype(np.uint8) * 255)
    write_mesh_obj(folder / "mesh.obj", thing().meshes[0])
    write_lens(folder / "lens.json", LENS)
    write_pairs(folder / "pairs.json", {"b0": clicks()}, "mesh.obj")
    return folder


def command(card: Path, output: Path, *more: str, mesh: bool = True) -> list[str]:
    words = ["prepare", "register", str(card / "photos"), "-o", str(output), "--quiet"]
    words += ["--intrinsics", str(card / "lens.json"), "--masks", str(card / "masks")]
    return [*words, *(["--mesh", str(card / "mesh.obj")] if mesh else []), *more]


def test_a_board_places_a_plain_object(card: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    more = ("--board", "7x4", "--square", "0.18", "--pairs", str(card / "pairs.json"))
    assert main([*command(card, tmp_path / "capture", *more), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert {p["placed_by"] for p in said["photographs"]} == {"board"} and not said["missing"]
    assert max(p["board_px"] for p in said["photographs"]) < 1
    cameras = {
        Path(f.name).stem: f.camera for f in read_capture(tmp_path / "capture", require_images=False).frames
    }
    off = [apart(truth()[name], camera, np.zeros(3)) for name, camera in cameras.items()]
    # The goal of a plain object on a board.
    assert max(angle for angle, _ in off) < 0.1 and max(away for _, away in off) < 0.002


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--board", "7x4"), "--square LENGTH"),
        (("--square", "0.18"), "--board or --charuco"),
        (("--board", "12x9", "--square", "1"), "in none of the 4 photographs"),
        (("--board", "7x4", "--charuco", "7x5", "--square", "1"), "both --board and --charuco"),
        (("--board", "7x4", "--square", "1", "--legacy"), "--legacy is an option of ChArUco boards"),
        (("--marker", "0.7"), "--marker is an option of ChArUco boards"),
        (("--sphere", "2"), "both --mesh and --sphere"),
    ],
)
def test_wrong_boards_are_told(card: Path, tmp_path: Path, capsys, more, words) -> None:  # type: ignore[no-untyped-def]
    assert main(command(card, tmp_path / "capture", *more)) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "capture").exists()


def test_the_board_is_the_world_without_pairs(card: Path, tmp_path: Path) -> None:
    mesh = thing().meshes[0]
    back = np.linalg.inv(MESH_FROM_BOARD)
    turned = type(mesh)(
        mesh.vertices @ back[:3, :3].T + back[:3, 3], mesh.faces, mesh.normals @ back[:3, :3].T, mesh.uv
    )
    write_mesh_obj(tmp_path / "turned.obj", turned)
    words = command(card, tmp_path / "capture", "--board", "7x4", "--square", "0.18", mesh=False)
    assert main([*words, "--mesh", str(tmp_path / "turned.obj")]) == 0
    for frame in read_capture(tmp_path / "capture", require_images=False).frames:
        there = MESH_FROM_BOARD @ frame.camera.world_from_camera
        assert np.abs(there - truth()[Path(frame.name).stem].world_from_camera).max() < 0.02


def test_a_sphere_needs_no_mesh(tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    for name in ("photos", "masks"):
        (tmp_path / name).mkdir()
    view = view_of((30.0, -10.0, -200.0))
    cv2.imwrite(str(tmp_path / "photos" / "ball.png"), view.region.astype(np.uint8) * 160 + 20)
    cv2.imwrite(str(tmp_path / "masks" / "ball.png"), view.region.astype(np.uint8) * 255)
    write_lens(tmp_path / "lens.json", BALL_LENS)
    words = command(tmp_path, tmp_path / "capture", "--sphere", str(RADIUS), mesh=False)
    assert main([*words, "--json"]) == 0
    (only,) = json.loads(capsys.readouterr().out)["photographs"]
    assert only["placed_by"] == "outline" and only["iou"] > 0.99
    capture = read_capture(tmp_path / "capture", require_images=False)
    assert np.linalg.norm(
        read_mesh(tmp_path / "capture" / "mesh.obj").vertices, axis=1
    ).max() == pytest.approx(RADIUS, rel=1e-4)
    np.testing.assert_allclose(capture.frames[0].camera.position, [-30, 10, 200], atol=0.5)
    at = words.index("--masks")
    bare = [str(tmp_path / "other") if w == str(tmp_path / "capture") else w for w in words]
    assert main(bare[:at] + bare[at + 2 :]) == 2
    assert "no photograph of the sphere has a mask" in capsys.readouterr().err

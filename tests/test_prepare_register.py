# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From photographs, a mesh and clicked pairs to a capture, by the command."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from swatchwork.capture import read_capture
from swatchwork.cli import main
from swatchwork.prepare.registering import Pairs, write_pairs
from swatchwork.surface import points_in_sight, surface_points, write_mesh_obj
from swatchwork.workflow import RegisterSummary, register_photographs
from synthetic_photographs import LENS, blob, photograph, truth, worst

COUNT = 4


def clicks(
    index: int = 0, count: int = 12, noise_px: float = 1.0, wrong: float = 0.0, seed: int = 5
) -> Pairs:
    """Pairs of a photograph as a person might click them."""
    rng = np.random.default_rng(seed)
    name, camera = f"p{index}", truth()[f"p{index}"]
    points = surface_points(blob().meshes[0], 400, seed)
    seen = np.flatnonzero(points_in_sight(blob(), points, camera))
    x = points.position[rng.choice(seen, count, replace=False)]
    uv = camera.project(x)[0] + rng.normal(0, noise_px, (count, 2))
    off = rng.choice(count, round(wrong * count), replace=False)
    uv[off] = rng.uniform([150, 100], [450, 350], (len(off), 2))
    return Pairs(f"{name}.png", uv, x)


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with photographs, masks, mesh, lens and pairs."""
    folder = tmp_path_factory.mktemp("card")
    (folder / "photos").mkdir()
    (folder / "masks").mkdir()
    for i in range(COUNT):
        view = photograph(i)
        cv2.imwrite(str(folder / "photos" / f"p{i}.png"), view.gray)
        assert view.region is not None
        cv2.imwrite(str(folder / "masks" / f"p{i}.png"), view.region.astype(np.uint8) * 255)
    write_mesh_obj(folder / "mesh.obj", blob().meshes[0])
    lens = {"w": LENS.width, "h": LENS.height, "fl_x": LENS.fx, "fl_y": LENS.fy, "cx": LENS.cx, "cy": LENS.cy}
    lens |= {"k1": LENS.k1, "k2": LENS.k2, "p1": LENS.p1, "p2": LENS.p2}
    (folder / "lens.json").write_text(json.dumps(lens))
    write_pairs(folder / "pairs.json", {"p0": clicks()}, "mesh.obj")
    return folder


def command(card: Path, output: Path, **changed: str) -> list[str]:
    options = {
        "mesh": "mesh.obj",
        "intrinsics": "lens.json",
        "pairs": "pairs.json",
        "masks": "masks",
    } | changed
    words = ["prepare", "register", str(card / options.pop("photos", "photos")), "-o", str(output), "--quiet"]
    for name, value in options.items():
        words += [f"--{name}", str(card / value)]
    return words


def test_photographs_become_a_capture(card: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command(card, tmp_path / "capture"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [p["name"] for p in said["photographs"]] == [f"p{i}" for i in range(COUNT)] and not said["missing"]
    assert (
        said["photographs"][0]["placed_by"] == "pairs" and said["photographs"][1]["placed_by"] == "features"
    )
    capture = read_capture(tmp_path / "capture", require_images=False)
    found = {Path(f.name).stem: f.camera for f in capture.frames}
    angle, away = worst(found)
    # The goal of registration; here photographs are 600 pixels wide, masks a pixel too small.
    assert angle < 0.1 and away < 0.002
    assert min(p["iou"] for p in said["photographs"]) > 0.97
    for name in ("register.json", "register.html", "mesh.obj", "images/p0.png", "masks/p0.png"):
        assert (tmp_path / "capture" / name).is_file()
    # The file may be read on another machine.
    figures = (tmp_path / "capture" / "register.json").read_text()
    assert str(tmp_path) not in figures and said["capture"] == str(tmp_path / "capture")
    assert set(said) - set(json.loads(figures)) == {"capture", "page", "warnings"}


def test_masks_alone_place_photographs(card: Path, tmp_path: Path) -> None:
    summary = run(card, tmp_path, count=2, others="none")
    assert [p.placed_by for p in summary.photographs] == 2 * ["silhouette"] and not summary.missing
    capture = read_capture(tmp_path / "capture", require_images=False)
    angle, away = worst({Path(f.name).stem: f.camera for f in capture.frames})
    assert angle < 0.3 and away < 0.006


def test_wrong_clicks_are_named_and_left_out(card: Path, tmp_path: Path) -> None:
    write_pairs(tmp_path / "pairs.json", {"p0": clicks(wrong=0.3)}, "mesh.obj")
    with pytest.warns(UserWarning, match=r"p0: pairs? [\d, ]+ disagree"):
        summary = run(card, tmp_path, count=1, pairs=tmp_path / "pairs.json")
    assert [len(p.pairs_left_out) for p in summary.photographs] == [4]
    capture = read_capture(tmp_path / "capture", require_images=False)
    angle, away = worst({Path(f.name).stem: f.camera for f in capture.frames})
    # A mask a pixel too small and clicks of a pixel, without features: a few times the goal.
    assert angle < 0.3 and away < 0.006


def test_pairs_of_another_photograph_fit_nowhere(card: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    mine = clicks(2)
    write_pairs(
        tmp_path / "pairs.json", {"p0": Pairs("p0.png", mine.uv_px[::-1], mine.x_in_world)}, "mesh.obj"
    )
    assert main(command(card, tmp_path / "capture", pairs=str(tmp_path / "pairs.json"))) == 2
    assert "pairs agree on a pose" in capsys.readouterr().err
    assert not (tmp_path / "capture").exists()


def test_a_mirrored_mesh_is_told(card: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    right = clicks(0)
    mirrored = Pairs("p0.png", right.uv_px, right.x_in_world * [1, -1, 1])
    write_pairs(tmp_path / "pairs.json", {"p0": mirrored}, "mesh.obj")
    assert main(command(card, tmp_path / "capture", pairs=str(tmp_path / "pairs.json"))) == 2
    assert "mirror" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"mesh": "none.obj"}, "none.obj"),
        ({"pairs": "lens.json"}, "photographs"),
        ({"masks": "photos/none"}, "no such folder"),
        ({"photos": "none"}, "no such file or folder"),
        ({"intrinsics": "pairs.json"}, "cannot be read as intrinsics"),
    ],
)
def test_bad_input_is_named(card: Path, tmp_path: Path, capsys, changed, words) -> None:  # type: ignore[no-untyped-def]
    assert main(command(card, tmp_path / "capture", **changed)) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "capture").exists()


def test_no_clue_says_what_to_do(card: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    words = command(card, tmp_path / "capture")
    at = words.index("--pairs")
    # Masks would be a clue.
    assert main(words[:at]) == 2
    assert "swatchwork prepare pairs" in capsys.readouterr().err


def run(card: Path, tmp_path: Path, count: int = COUNT, **options) -> RegisterSummary:  # type: ignore[no-untyped-def]
    given = {"mesh": card / "mesh.obj", "intrinsics": card / "lens.json", "masks": card / "masks"} | options
    photographs = [card / "photos" / f"p{i}.png" for i in range(count)]
    return register_photographs(photographs, tmp_path / "capture", **given)

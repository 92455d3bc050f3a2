# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Calibration: boards rendered through a known camera, real photographs, and wrong input told."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from swatchwork.capture import Camera, write_exr, write_png
from swatchwork.cli import main
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.prepare import Board, Charuco, Checkerboard, Sighting, calibrate, find_board
from swatchwork.prepare.boards import read_gray
from swatchwork.prepare.calibrate import CELLS, covered, fit

TRUTH = Camera(640, 480, 610.0, 604.0, 331.3, 236.8, np.eye(4), k1=-0.12, k2=0.05, p1=0.001, p2=-0.0015)
CHECKER, CHARUCO = Checkerboard(9, 6), Charuco(7, 5, 0.7, "5X5_100")
SAMPLES = 2
"""Rays a pixel along each side."""
TEXTURE_PX = 40
"""Of a square in the board's picture."""


def board_texture(board: Board) -> tuple[np.ndarray, np.ndarray]:
    """The board with a white margin of a square, and where its corner (0, 0) is in it, in squares."""
    if isinstance(board, Charuco):
        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{board.dictionary}"))
        pattern = cv2.aruco.CharucoBoard((board.columns, board.rows), 1.0, board.marker, markers)
        size = (board.columns * TEXTURE_PX, board.rows * TEXTURE_PX)
        # OpenCV's board has its origin at the outer corner of the first square.
        return np.pad(pattern.generateImage(size), TEXTURE_PX, constant_values=255), np.array([1.0, 1.0])
    y, x = np.mgrid[: board.rows + 1, : board.columns + 1]
    squares = np.where((x + y) % 2 == 0, 20, 230).astype(np.uint8)
    whole = np.kron(squares, np.ones((TEXTURE_PX, TEXTURE_PX), dtype=np.uint8))
    return np.pad(whole, TEXTURE_PX, constant_values=230), np.array([2.0, 2.0])


@cache
def true_rays(sample: int) -> np.ndarray:
    """Directions (x right, y down, z ahead) through a sample of each of the true camera's pixels."""
    offset = (np.array([sample % SAMPLES, sample // SAMPLES]) + 0.5) / SAMPLES - 0.5
    c = TRUTH
    K = np.array([[c.fx, 0, c.cx], [0, c.fy, c.cy], [0, 0, 1]])
    uv = (c.pixel_centres() + offset).reshape(-1, 1, 2)
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-9)
    # OpenCV's inverse of the lens: quicker than ours, and a twin of it.
    xy = cv2.undistortPoints(uv, K, np.array([c.k1, c.k2, c.p1, c.p2]), criteria=until)
    return np.column_stack([xy.reshape(-1, 2), np.ones(len(xy))]).astype(np.float32)


def render(board: Board, turn: np.ndarray, place: np.ndarray) -> np.ndarray:
    """8-bit gray [H, W] of the board with OpenCV's pose, samples averaged a pixel."""
    texture, origin = board_texture(board)
    rotation, _ = cv2.Rodrigues(turn)
    total = np.zeros((TRUTH.height, TRUTH.width), dtype=np.float32)
    for sample in range(SAMPLES**2):
        d = true_rays(sample)
        away = (rotation[:, 2] @ place) / (d @ rotation[:, 2].astype(np.float32))
        # In squares of the board: (d * away - place) along its two sides.
        at = d @ rotation[:, :2].astype(np.float32) * away[:, None] + (origin - place @ rotation[:, :2])
        # Linear between texels about as large as a pixel: an edge in steps would not be where it should.
        u, v = (at * TEXTURE_PX - 0.5).astype(np.float32).T.reshape(2, *total.shape)
        total += cv2.remap(texture.astype(np.float32), u, v, cv2.INTER_LINEAR, borderValue=120)
    # A lens is never sharper than this.
    blurred = cv2.GaussianBlur(total / SAMPLES**2, (0, 0), 0.7)
    return (blurred + 0.5).astype(np.uint8)


def poses(
    board: Board, count: int = 10, tilt: float = 0.5, near: float = 1.6
) -> list[tuple[np.ndarray, ...]]:
    """Boards tilted in turn about axes in their plane, near the middle and each border of the picture."""
    rng = np.random.default_rng(4)
    middle = (
        np.array([board.columns, board.rows, 0]) - (1.0 if isinstance(board, Checkerboard) else 0.0)
    ) / 2
    middle[2] = 0
    found = []
    for i in range(count):
        angle = 2 * np.pi * i / count
        turn = tilt * np.array([np.cos(angle), np.sin(angle), 0]) + [0, 0, 0.2 * rng.normal()]
        rotation, _ = cv2.Rodrigues(turn)
        away = near * board.columns * (1.0 + 0.25 * (i % 3))
        centre = np.array([0.17 * np.cos(2.4 * i), 0.14 * np.sin(2.4 * i), 1.0]) * away
        found.append((turn, centre - rotation @ middle))
    return found


def photographs(folder: Path, board: Board, count: int = 10) -> list[Path]:
    folder.mkdir()
    files = []
    for i, (turn, place) in enumerate(poses(board, count)):
        files.append(folder / f"board{i:02}.png")
        write_png(files[-1], np.repeat(render(board, turn, place)[..., None], 3, axis=-1))
    return files


@pytest.fixture(scope="module")
def checker(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return photographs(tmp_path_factory.mktemp("boards") / "checker", CHECKER)


@pytest.fixture(scope="module")
def charuco(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return photographs(tmp_path_factory.mktemp("boards") / "charuco", CHARUCO)


def assert_near_truth(camera: Camera, pixels: float) -> None:
    """Where the found camera sees the directions of the true one's pixels, best turned onto each other."""
    uv = TRUTH.pixel_centres().reshape(480, 640, 2)[12::24, 16::32].reshape(-1, 2)
    found, true = camera.rays(uv), TRUTH.rays(uv)
    # A turn of the camera is a change of pose, which calibration leaves free.
    u, _, vt = np.linalg.svd(true.T @ found)
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    angle = np.linalg.norm(found @ turn.T - true, axis=1)
    assert np.sqrt((angle**2).mean()) * TRUTH.fx < pixels


def test_corners_of_a_rendered_checkerboard_are_found_where_they_are(checker: list[Path]) -> None:
    for file, (turn, place) in zip(checker, poses(CHECKER), strict=True):
        seen = find_board(file, read_gray(file), CHECKER)
        assert seen is not None
        rotation, _ = cv2.Rodrigues(turn)
        expected, _ = TRUTH.project((seen.x_on_board @ rotation.T + place) * [1, -1, -1])
        if np.linalg.norm(expected[0] - seen.uv_px[0]) > np.linalg.norm(expected[-1] - seen.uv_px[0]):
            expected = expected[::-1]
        error = seen.uv_px - expected
        # Four samples a pixel and 8 bits leave corners a few hundredths, a tenth of half a pixel.
        assert np.sqrt((error**2).mean()) < 0.05 and np.abs(error.mean(axis=0)).max() < 0.03


@pytest.mark.parametrize("kind", ["checker", "charuco"])
def test_known_intrinsics_are_recovered(kind: str, request: pytest.FixtureRequest) -> None:
    board = CHECKER if kind == "checker" else CHARUCO
    found = calibrate(request.getfixturevalue(kind), board)
    camera = found.camera
    assert len(found.sightings) == 10 and not found.not_found and not found.outliers
    # OpenCV refines ChArUco corners in windows that spare the markers: smaller ones.
    assert found.rms_px < (0.05 if kind == "checker" else 0.08)
    # Ten boards of 54 corners known to 0.05 px, or some 24 of a ChArUco board to 0.1 px.
    for name, deviation in zip(("fx", "fy", "cx", "cy"), found.deviation_px, strict=True):
        assert deviation < 0.8
        assert getattr(camera, name) == pytest.approx(getattr(TRUTH, name), abs=4 * deviation + 0.1)
    # Borders that no corner came near count too.
    assert_near_truth(camera, 0.3)


def test_exact_corners_give_the_exact_camera_with_centres_at_a_half() -> None:
    """No picture in between: what is left is single precision and the convention of pixel centres."""
    sightings = []
    for turn, place in poses(CHECKER):
        grid = np.mgrid[:9, :6].T.reshape(-1, 2)
        x = np.column_stack([grid, np.zeros(len(grid))]).astype(float)
        rotation, _ = cv2.Rodrigues(turn)
        uv, _ = TRUTH.project((x @ rotation.T + place) * [1, -1, -1])
        sightings.append(Sighting(Path("x.png"), uv, x))
    camera = fit(sightings, (640, 480)).camera
    for name in ("fx", "fy", "cx", "cy"):
        # Corners are handed to OpenCV as floats: 3e-5 px each.
        assert getattr(camera, name) == pytest.approx(getattr(TRUTH, name), abs=5e-3)
    for name in ("k1", "k2", "p1", "p2"):
        assert getattr(camera, name) == pytest.approx(getattr(TRUTH, name), abs=1e-4)


def test_real_photographs_agree_with_their_readme(shared: Path, tmp_path: Path) -> None:
    files = sorted((shared / "data/captures/chessboard").glob("left*.jpg"))
    found = calibrate(files, CHECKER)
    camera = found.camera
    assert len(found.sightings) == 13
    assert found.rms_px == pytest.approx(0.13, abs=0.02)
    # Two standard deviations, as the fit states them (1.3 px): corners are refined in other windows.
    assert max(found.deviation_px) < 1.5
    assert camera.fx == pytest.approx(514.8, abs=2.6)
    assert camera.fy == pytest.approx(515.0, abs=2.6)
    # The README's centre is OpenCV's, half a pixel below ours.
    assert camera.cx == pytest.approx(315.3 + 0.5, abs=2.6)
    assert camera.cy == pytest.approx(249.6 + 0.5, abs=2.6)


def test_command_writes_intrinsics_figures_and_a_picture(
    checker: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "made" / "intrinsics.json"
    assert (
        main(["prepare", "calibrate", str(checker[0].parent), "--board", "9x6", "-o", str(out), "--json"])
        == 0
    )
    said = json.loads(capsys.readouterr().out)
    written = json.loads(out.read_text(encoding="utf-8"))
    assert {f.name for f in out.parent.iterdir()} == {"intrinsics.json", "intrinsics.corners.png"}
    for key in ("w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2"):
        assert written[key] == said[key]
    assert (written["w"], written["h"]) == (640, 480)
    figures = written["figures"]
    assert figures["images"] == 10 and figures["corners"] == 540 and len(figures["image_rms_px"]) == 10
    assert np.sqrt(np.mean(np.square([*figures["image_rms_px"].values()]))) == pytest.approx(
        figures["rms_px"]
    )
    picture = cv2.imread(str(out.with_name("intrinsics.corners.png")))
    assert picture.shape == (930, 1200, 3)


def test_an_outlier_is_named(checker: list[Path], tmp_path: Path) -> None:
    files = [tmp_path / file.name for file in checker]
    for file, source in zip(files, checker, strict=True):
        file.write_bytes(source.read_bytes())
    picture = cv2.imread(str(files[3]), 0)
    # A board bent by 2 px across the picture.
    y, x = np.mgrid[:480, :640].astype(np.float32)
    bent = cv2.remap(picture, x, y + 2 * np.sin(x / 60, dtype=np.float32), cv2.INTER_LINEAR)
    write_png(files[3], np.repeat(bent[..., None], 3, axis=-1))
    with pytest.warns(CaptureWarning, match="board03.png"):
        found = calibrate(files, CHECKER)
    assert [file.name for file in found.outliers] == ["board03.png"]


def test_radiance_serves_as_well_as_codes(checker: list[Path], tmp_path: Path) -> None:
    gray = cv2.imread(str(checker[0]), 0) / 255.0
    write_exr(tmp_path / "board.exr", np.repeat(gray[..., None] ** 2.2, 3, axis=-1) * 40)
    a = find_board(checker[0], read_gray(checker[0]), CHECKER)
    b = find_board(checker[0], read_gray(tmp_path / "board.exr"), CHECKER)
    assert a is not None and b is not None
    # Antialiased edges move a little where the curve bends.
    np.testing.assert_allclose(a.uv_px, b.uv_px, atol=0.15)


def test_coverage_counts_cells() -> None:
    cells = covered(np.array([[0.0, 0.0], [639.9, 479.9], [1.0, 1.0], [700.0, 3.0]]), (640, 480))
    assert cells.shape == CELLS[::-1] and cells.sum() == 2 and cells[0, 0] and cells[-1, -1]


def test_boards_that_all_face_the_camera_are_refused() -> None:
    sightings = []
    grid = np.mgrid[:9, :6].T.reshape(-1, 2)
    x = np.column_stack([grid, np.zeros(len(grid))]).astype(float)
    rng = np.random.default_rng(0)
    for away in (10.0, 12.0, 14.0):
        uv, _ = TRUTH.project((x - [4, 2.5, 0] + [0, 0, away]) * [1, -1, -1])
        sightings.append(Sighting(Path("x.png"), uv + 0.1 * rng.normal(size=uv.shape), x))
    with pytest.raises(InputError, match="turned by no more than"):
        fit(sightings, (640, 480))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["PHOTOS"], "no board is given"),
        (["PHOTOS", "--board", "9x6", "--charuco", "7x5"], "both --board and --charuco"),
        (["PHOTOS", "--board", "nine"], "--board is 'nine'"),
        (["PHOTOS", "--board", "9x1"], "the board is 9x1"),
        (["PHOTOS", "--board", "8x5"], "a 8x5 checkerboard (inner corners) is in 0 of 3 photographs"),
        (["PHOTOS", "--charuco", "7x5", "--marker", "1.2"], "the marker is 1.2 of a square"),
        (["PHOTOS", "--charuco", "7x5", "--dictionary", "9X9"], "no markers '9X9'"),
        (["PHOTOS", "--board", "9x6", "--marker", "0.75"], "--marker is an option of ChArUco boards"),
        (["PHOTOS", "--board", "9x6", "--dictionary", "4X4_50"], "--dictionary is an option of ChArUco"),
        (["PHOTOS", "--legacy"], "--legacy is an option of ChArUco boards; expected --charuco"),
        (["PHOTOS", "--charuco", "7x5"], "a 7x5 ChArUco board (squares) is in 0 of 3 photographs"),
        (["missing", "--board", "9x6"], "no such file or folder"),
        (["EMPTY", "--board", "9x6"], "there are no photographs"),
        (["PHOTOS", "SMALL", "--board", "9x6"], "320 x 240 pixels; expected 640 x 480"),
        (["PHOTOS", "BROKEN", "--board", "9x6"], "cannot be read as an image"),
    ],
)
def test_what_is_wrong_is_said(
    arguments: list[str], said: str, checker: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photos, empty = tmp_path / "photos", tmp_path / "empty"
    photos.mkdir()
    empty.mkdir()
    for file in checker[:3]:
        (photos / file.name).write_bytes(file.read_bytes())
    small, broken = tmp_path / "small.png", tmp_path / "broken.png"
    write_png(small, np.zeros((240, 320, 3), dtype=np.uint8))
    broken.write_bytes(checker[0].read_bytes()[:3000])
    names = {"PHOTOS": photos, "EMPTY": empty, "SMALL": small, "BROKEN": broken}
    out = tmp_path / "out" / "i.json"
    given = [str(names.get(a, a)) for a in arguments]
    assert main(["prepare", "calibrate", *given, "-o", str(out)]) == 2
    assert said in capsys.readouterr().err and not out.parent.exists()


def test_output_must_be_json(checker: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "i.txt"
    assert main(["prepare", "calibrate", str(checker[0]), "--board", "9x6", "-o", str(out)]) == 2
    assert "ending in .json" in capsys.readouterr().err and not out.exists()

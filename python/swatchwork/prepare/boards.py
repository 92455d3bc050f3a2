# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Calibration boards in photographs: checkerboards and ChArUco boards, their corners to a part of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ..arrays import F32, F64, U8
from ..capture.images import read_coded, read_image
from ..errors import InputError

SEARCHED_PX = 1600
"""A checkerboard is searched for in a picture no longer than this, and refined in the whole one."""
WINDOW = 0.5
"""Half side of the window a corner is refined in, over the distance of its nearest neighbour."""
FEWEST_CORNERS = 8
"""Of a ChArUco board in part; a pose takes four, and chance finds of a marker are worth less than none."""


@dataclass(frozen=True)
class Checkerboard:
    """Inner corners along its two sides."""

    columns: int
    rows: int

    def __post_init__(self) -> None:
        _check_size(self.columns, self.rows, "inner corners of a checkerboard, such as 9x6")


@dataclass(frozen=True)
class Charuco:
    """Squares along its two sides, the marker's side as a share of a square's, OpenCV's name of the markers.

    ``legacy``: even row counts start with a white square in the top left corner (before OpenCV 4.6).
    """

    columns: int
    rows: int
    marker: float = 0.75
    dictionary: str = "4X4_50"
    legacy: bool = False

    def __post_init__(self) -> None:
        _check_size(self.columns, self.rows, "squares of a ChArUco board, such as 7x5")
        if not 0 < self.marker < 1:
            raise InputError(f"the marker is {self.marker:g} of a square", expected="a share between 0 and 1")
        if not hasattr(cv2.aruco, f"DICT_{self.dictionary}"):
            known = sorted(name[5:] for name in dir(cv2.aruco) if name.startswith("DICT_"))
            raise InputError(f"no markers {self.dictionary!r}", expected="one of " + ", ".join(known))
        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{self.dictionary}"))
        needed, there = self.columns * self.rows // 2, len(markers.bytesList)
        if needed > there:
            raise InputError(
                f"{self.columns}x{self.rows} squares hold {needed} markers",
                expected=f"at most the {there} of {self.dictionary}",
                hint="Name the markers that the board was printed with",
            )


Board = Checkerboard | Charuco


@dataclass(frozen=True, eq=False)
class Sighting:
    """A board in one photograph.

    Attributes:
        file: of the photograph.
        uv_px: F64[C, 2], corners with pixel centres at +0.5.
        x_on_board: F64[C, 3], the same corners in squares of the board, z = 0.
    """

    file: Path
    uv_px: F64
    x_on_board: F64


def read_gray(file: Path) -> U8:
    """A photograph as 8-bit gray [H, W] as a display shows it; EXR and .hdr through the square root.

    Raises:
        InputError: as `swatchwork.capture.read_image`.
    """
    if file.suffix.lower() in (".exr", ".hdr"):
        linear = np.nan_to_num(read_image(file).linear.mean(axis=-1))
        top = max(float(np.quantile(linear, 0.99)), 1e-12)
        return np.asarray(np.sqrt(np.clip(linear / top, 0, 1)) * 255 + 0.5, dtype=np.uint8)
    coded = read_coded(file)
    gray = coded[..., :3].mean(axis=-1) if coded.shape[-1] >= 3 else coded[..., 0]
    return np.asarray(gray * (255 / np.iinfo(coded.dtype).max) + 0.5, dtype=np.uint8)


def find_board(file: Path, gray: U8, board: Board) -> Sighting | None:
    """The board's corners, or None where it is not seen (a checkerboard: not whole)."""
    found = _checkerboard(gray, board) if isinstance(board, Checkerboard) else _charuco(gray, board)
    if found is None:
        return None
    uv_px, x_on_board = found
    # OpenCV's pixel centres are at whole numbers, ours half a pixel on.
    return Sighting(file, uv_px.astype(np.float64) + 0.5, x_on_board.astype(np.float64))


def _checkerboard(gray: U8, board: Checkerboard) -> tuple[F32, F32] | None:
    scale = min(1.0, SEARCHED_PX / max(gray.shape))
    size = (round(gray.shape[1] * scale), round(gray.shape[0] * scale))
    searched = cv2.resize(gray, size, interpolation=cv2.INTER_AREA) if scale < 1 else gray
    found, corners = False, None
    # Evening out the contrast first finds some boards in uneven light, and loses others.
    for flags in (cv2.CALIB_CB_EXHAUSTIVE, cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE):
        found, corners = cv2.findChessboardCornersSB(searched, (board.columns, board.rows), flags=flags)
        if found:
            break
    if not found:
        return None
    grid = np.mgrid[: board.columns, : board.rows].T.reshape(-1, 2)
    x_on_board = np.column_stack([grid, np.zeros(len(grid))]).astype(np.float32)
    uv = (np.asarray(corners, dtype=np.float32).reshape(-1, 2) + np.float32(0.5)) / np.float32(scale)
    return _refined(gray, uv - np.float32(0.5), board.columns), x_on_board


def _refined(gray: U8, uv: F32, columns: int) -> F32:
    """Corners moved to where the gradients around them meet, in windows that reach no other corner."""
    grid = uv.reshape(-1, columns, 2)
    apart = min(float(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min()) for axis in (0, 1))
    half = int(np.clip(WINDOW * apart, 2, 11))
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    refined = cv2.cornerSubPix(gray, uv.reshape(-1, 1, 2).copy(), (half, half), (-1, -1), until)
    return np.asarray(refined, dtype=np.float32).reshape(-1, 2)


def _charuco(gray: U8, board: Charuco) -> tuple[F32, F32] | None:
    markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{board.dictionary}"))
    pattern = cv2.aruco.CharucoBoard((board.columns, board.rows), 1.0, board.marker, markers)
    pattern.setLegacyPattern(board.legacy)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(pattern).detectBoard(gray)
    # Corners in one line say nothing of the camera, and the calibration cannot start from them.
    if ids is None or len(ids) < FEWEST_CORNERS or pattern.checkCharucoCornersCollinear(ids):
        return None
    x_on_board = np.asarray(pattern.getChessboardCorners(), dtype=np.float32)[np.asarray(ids).reshape(-1)]
    return np.asarray(corners, dtype=np.float32).reshape(-1, 2), x_on_board


def _check_size(columns: int, rows: int, expected: str) -> None:
    if columns < 3 or rows < 3:
        raise InputError(f"the board is {columns}x{rows}", expected=f"3x3 or more {expected}")

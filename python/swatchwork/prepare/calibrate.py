# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Intrinsics and distortion from photographs of a board (Zhang 2000, OpenCV's calibrateCamera).

Minimises the squared distance in pixels between the corners found and the board's corners projected by a
camera with fx, fy, cx, cy, k1, k2, p1, p2, shared by all photographs, and a pose for each. k3 stays 0:
`Camera` has none, and its estimate trades against k2.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ..arrays import F64, Bool
from ..capture import Camera
from ..errors import CaptureWarning, InputError, is_out_of_memory
from ..progress import SILENT, Progress
from .boards import Board, Checkerboard, Sighting, find_board, read_gray

SUFFIXES = (".jpg", ".jpeg", ".png", ".exr", ".hdr")
FEWEST = 3
"""Photographs: each gives two equations for the five numbers of a camera matrix."""
CELLS = (10, 8)
"""Columns and rows of the grid whose cells with a corner are the coverage."""
ENOUGH_COVERAGE = 0.5
OUTLIER = 2.0
"""An image whose rms is that many times the median one: a blurred or bent board, or a wrong corner."""
PARALLEL_DEGREES = 10.0
"""Boards nearly parallel say the same of the camera (Zhang 2000, section 3.3): the fit would settle anywhere,
and its own deviations would not tell."""
NEVER_AN_OUTLIER_PX = 0.2
"""Rms that is no sign of a bad image, however good the others are."""
LOOSE = 0.01
"""Standard deviation of a focal length, as a share of it, from which the photographs do not tell it."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera, and how well it explains the photographs.

    Attributes:
        camera: its pose is the identity; pixel centres at +0.5.
        sightings: boards found.
        residual_px: F64[C, 2] of each, found minus projected.
        rms_px: over all corners; ``image_rms_px`` of each image.
        deviation_px: standard deviations of fx, fy, cx, cy, as the residuals' scatter tells them.
        coverage: Bool[rows, columns], cells of the image that hold a corner.
        not_found: photographs in which no board was found.
        outliers: images whose rms is over `OUTLIER` times the median.
    """

    camera: Camera
    sightings: tuple[Sighting, ...]
    residual_px: tuple[F64, ...]
    rms_px: float
    image_rms_px: tuple[float, ...]
    deviation_px: tuple[float, float, float, float]
    coverage: Bool
    not_found: tuple[Path, ...]
    outliers: tuple[Path, ...]


def calibrate(files: Sequence[Path], board: Board, progress: Progress = SILENT) -> Calibration:
    """Find the board in each photograph, and the camera that all of them agree on.

    Raises:
        InputError: a photograph is missing or damaged or differs in size; the board is found in fewer
            than three; the corners determine no camera.
    """
    sightings, not_found, size = [], [], (0, 0)
    with progress.stage("Finding corners", len(files)) as task:
        for file in files:
            gray = read_gray(file)
            height, width = gray.shape
            size = size if any(size) else (width, height)
            if (width, height) != size:
                raise InputError(
                    f"{width} x {height} pixels",
                    file=file,
                    expected=f"{size[0]} x {size[1]} as {files[0].name} has",
                    hint="Calibrate each camera and each zoom by itself; do not turn or crop photographs",
                )
            seen = find_board(file, gray, board)
            sightings += [seen] if seen is not None else []
            not_found += [file] if seen is None else []
            task.advance()
    if len(sightings) < FEWEST:
        kind = (
            "checkerboard (inner corners)" if isinstance(board, Checkerboard) else "ChArUco board (squares)"
        )
        raise InputError(
            f"a {board.columns}x{board.rows} {kind} is in {len(sightings)} of {len(files)} photographs",
            file=files[0].parent if files else None,
            expected=f"{FEWEST} or more, better 10 to 20",
            hint="Check the board's size; a checkerboard must be whole in the picture, with a white margin",
        )
    found = fit(sightings, size, tuple(not_found))
    _warn(found)
    return found


def fit(
    sightings: Sequence[Sighting], size: tuple[int, int], not_found: tuple[Path, ...] = ()
) -> Calibration:
    """The camera of an image ``size`` (width, height) that explains the corners best.

    Raises:
        InputError: the corners determine no camera, such as where all boards face it squarely.
    """
    points = [s.x_on_board.astype(np.float32) for s in sightings]
    corners = [s.uv_px.astype(np.float32).reshape(-1, 1, 2) for s in sightings]
    try:
        rms, K, lens, turns, places, deviation, _, image_rms = cv2.calibrateCameraExtended(
            points, corners, size, None, None, flags=cv2.CALIB_FIX_K3
        )
    except cv2.error as error:
        if is_out_of_memory(error):
            raise
        raise _undetermined(str(error).strip().splitlines()[-1]) from error
    turned = _turned(turns)
    if turned < PARALLEL_DEGREES:
        raise _undetermined(f"the boards are turned by no more than {turned:.1f} degrees to each other")
    k1, k2, p1, p2 = (float(v) for v in np.ravel(lens)[:4])
    fx, fy, cx, cy = float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])
    if not np.isfinite([fx, fy, cx, cy, k1, k2, p1, p2]).all() or min(fx, fy) <= 0:
        raise _undetermined("its focal length comes out as no number")
    camera = Camera(size[0], size[1], fx, fy, cx, cy, np.eye(4), k1, k2, p1, p2)
    residuals = []
    for x, uv, turn, place in zip(points, corners, turns, places, strict=True):
        projected, _ = cv2.projectPoints(x, turn, place, K, lens)
        residuals.append(np.asarray(uv - projected, dtype=np.float64).reshape(-1, 2))
    each = tuple(float(v) for v in np.ravel(image_rms))
    limit = max(OUTLIER * float(np.median(each)), NEVER_AN_OUTLIER_PX)
    loose = tuple(float(v) for v in np.ravel(deviation)[:4])
    return Calibration(
        camera,
        tuple(sightings),
        tuple(residuals),
        float(rms),
        each,
        (loose[0], loose[1], loose[2], loose[3]),
        covered(np.concatenate([s.uv_px for s in sightings]), size),
        not_found,
        tuple(s.file for s, value in zip(sightings, each, strict=True) if value > limit),
    )


def _turned(turns: Sequence[F64]) -> float:
    """Largest angle between the normals of two boards, in degrees."""
    normals = np.stack([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    return float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1).min())))


def covered(uv_px: F64, size: tuple[int, int]) -> Bool:
    """Bool[rows, columns]: the cells of a grid over the image that hold a corner."""
    cells = np.zeros(CELLS[::-1], dtype=bool)
    at = (uv_px / size * CELLS).astype(int)
    inside = ((at >= 0) & (at < CELLS)).all(axis=1)
    cells[at[inside, 1], at[inside, 0]] = True
    return cells


def _undetermined(reason: str) -> InputError:
    return InputError(
        f"the corners determine no camera ({reason})",
        expected="boards tilted by 20 to 40 degrees, in different directions",
    )


def _warn(found: Calibration) -> None:
    """What is legal but suspicious."""
    camera, said = found.camera, []
    if found.outliers:
        names = ", ".join(file.name for file in found.outliers)
        said.append(f"{names}: corners fit {OUTLIER:g} times worse than elsewhere; leave out or take again")
    if found.not_found:
        names = ", ".join(file.name for file in found.not_found)
        said.append(f"no board found in {names}")
    loose = max(found.deviation_px[0] / camera.fx, found.deviation_px[1] / camera.fy)
    if not loose < LOOSE:
        said.append(f"the focal length is known to {100 * loose:.1f} % only; tilt the board more")
    share = float(found.coverage.mean())
    if share < ENOUGH_COVERAGE:
        said.append(f"corners cover {100 * share:.0f} % of the image; bring the board to its borders too")
    w, h = camera.width, camera.height
    if not np.isfinite(camera.rays(np.array([[0, 0], [w, 0], [0, h], [w, h]], dtype=np.float64))).all():
        said.append("the lens model does not reach the image's corners; bring the board there")
    for text in said:
        warnings.warn(text, CaptureWarning, stacklevel=3)

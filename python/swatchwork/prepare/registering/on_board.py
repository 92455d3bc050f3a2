# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Poses of photographs that show a flat board, in the board's own coordinates.

The first corner is the origin; x runs along its columns, y along its rows, and z into the board, away from
whoever looks at it. A checkerboard's first corner is the one beside which the inner square is dark.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from swatchwork.arrays import F64, U8
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.boards import Board, Checkerboard, Sighting, find_board
from swatchwork.prepare.registering.consensus import TURNED
from swatchwork.prepare.registering.least import least_squares, misses_px, root_mean_square
from swatchwork.prepare.registering.motion import apart
from swatchwork.prepare.registering.view import View
from swatchwork.progress import SILENT, Progress

RIVAL = 1.5
"""A second pose whose rms is not that many times larger may be the true one (the plane tilted to the other
side, of a board that is small in the picture)."""
SAME_DEGREES = 0.1
"""Poses that differ by less ended in the same minimum."""
FLOOR_PX = 0.02
"""Added to the rms in that comparison: of exact corners, every ratio would be chance."""


@dataclass(frozen=True, eq=False)
class BoardPoses:
    """What the board says of each photograph, by name.

    Attributes:
        cameras: in the board's coordinates, world units.
        corners: found, F64[C, 2] in the image and F64[C, 3] on the board in world units.
        rms_px: of the corners.
        ambiguous: photographs whose board fits nearly as well when tilted to the other side.
        unseen: photographs in which no board was found.
    """

    cameras: dict[str, Camera]
    corners: dict[str, tuple[F64, F64]]
    rms_px: dict[str, float]
    ambiguous: tuple[str, ...]
    unseen: tuple[str, ...]

    @property
    def centre(self) -> F64:
        """Of the corners that were found, F64[3]."""
        x = np.concatenate([x for _, x in self.corners.values()])
        return np.asarray((x.min(axis=0) + x.max(axis=0)) / 2)


def board_poses(
    views: Sequence[View], board: Board, square: float, progress: Progress = SILENT
) -> BoardPoses:
    """Find the board in each photograph, and where that was taken from.

    Args:
        square: side of a square, world units.

    Raises:
        InputError: the square is no length; a checkerboard that looks the same upside down; no photograph
            shows the board.
    """
    if not (np.isfinite(square) and square > 0):
        raise InputError(f"a square is {square:g} long", expected="a positive length, in the mesh's unit")
    if isinstance(board, Checkerboard) and (board.columns + board.rows) % 2 == 0:
        raise InputError(
            f"a checkerboard with {board.columns}x{board.rows} inner corners looks the same upside down",
            expected="an odd number of corners along one side and an even one along the other, such as 9x6",
            hint="Take another board, or a ChArUco board; or place the photographs by pairs",
        )
    cameras, corners, rms_px = dict[str, Camera](), dict[str, tuple[F64, F64]](), dict[str, float]()
    ambiguous, unseen = [], []
    with progress.stage("Looking for the board", len(views)) as task:
        for view in views:
            seen = find_board(view.file, view.gray, board)
            task.advance()
            if seen is None:
                unseen.append(view.name)
                continue
            if isinstance(board, Checkerboard):
                seen = upright(seen, view.gray, board)
            x = square * seen.x_on_board
            camera, rms, rival = pose_of_plane(view.lens, seen.uv_px, x)
            cameras[view.name], corners[view.name], rms_px[view.name] = camera, (seen.uv_px, x), rms
            if rival < RIVAL * rms + FLOOR_PX:
                ambiguous.append(view.name)
    if not cameras:
        kind = f"{board.columns}x{board.rows} "
        kind += (
            "checkerboard (inner corners)" if isinstance(board, Checkerboard) else "ChArUco board (squares)"
        )
        raise InputError(
            f"a {kind} is in none of the {len(views)} photographs",
            expected="the board in one photograph at least",
            hint="Check the board's size; a checkerboard must be whole in the picture, with a white margin",
        )
    return BoardPoses(cameras, corners, rms_px, tuple(ambiguous), tuple(unseen))


def upright(seen: Sighting, gray: U8, board: Checkerboard) -> Sighting:
    """The corners numbered from the same one in each photograph: the detector starts where it likes."""
    grid = seen.uv_px.reshape(board.rows, board.columns, 2)
    along, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if along[0] * down[1] - along[1] * down[0] < 0:
        # Seen from behind, which no print is.
        grid = grid[:, ::-1]
    middle = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4
    height, width = gray.shape
    u, v = np.clip(middle.astype(int), 0, [width - 1, height - 1]).reshape(-1, 2).T
    odd = np.add.outer(np.arange(board.rows - 1), np.arange(board.columns - 1)).ravel() % 2 == 1
    if gray[v, u][odd].mean() < gray[v, u][~odd].mean():
        grid = grid[::-1, ::-1]
    return replace(seen, uv_px=np.ascontiguousarray(grid).reshape(-1, 2))


def pose_of_plane(lens: Camera, uv_px: F64, x_in_world: F64) -> tuple[Camera, float, float]:
    """The pose by points [C, 3] of a plane seen at [C, 2]; its rms, and that of the pose tilted otherwise."""
    rays = lens.rays(uv_px)
    xy = np.ascontiguousarray(rays[:, :2] * [1.0, -1.0] / -rays[:, 2:])
    reached = np.isfinite(xy).all(axis=1)
    centre = x_in_world.mean(axis=0)
    size = float(np.ptp(x_in_world, axis=0).max())
    count, turns, places, _ = cv2.solvePnPGeneric(
        (x_in_world[reached] - centre) / size, xy[reached], np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    found = []
    for turn, place in zip(turns[:count], places[:count], strict=True):
        rotation = cv2.Rodrigues(turn)[0]
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation.T @ TURNED, centre - size * (rotation.T @ np.ravel(place))
        camera, _ = least_squares(replace(lens, world_from_camera=pose), uv_px[reached], x_in_world[reached])
        found.append((root_mean_square(misses_px(camera, uv_px, x_in_world)[reached]), camera))
    found.sort(key=lambda entry: entry[0])
    best = found[0]
    others = [rms for rms, c in found[1:] if apart(best[1], c, centre)[0] > SAME_DEGREES]
    return best[1], best[0], min(others, default=np.inf)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Cameras whose places to each other are known, placed before the mesh: by a board, or by matched points.

With s the scale, R and t the rotation and translation, x_in_world = s R x_in_rig + t. Pairs of one photograph
tell R, and t up to its distance by the pose of that photograph; s is told by pairs of two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F64, Bool
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.boards import Board, find_board
from swatchwork.prepare.registering.aligning import Rig, align
from swatchwork.prepare.registering.contours import ImageEdges
from swatchwork.prepare.registering.least import misses_px, root_mean_square
from swatchwork.prepare.registering.pairs import Pairs
from swatchwork.prepare.registering.posing import default_tolerance_px, needed, pose_from_pairs
from swatchwork.prepare.registering.refining import iou
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene

UNITS = (1000.0, 100.0, 10.0, 25.4, 0.001, 0.01, 0.1, 1 / 25.4)
NEAR_UNIT = 0.05
"""Share by which a scale may be off such a one: a square measured by eye."""
BOARD_PX = 3.0
"""Distance up to which a corner of the board counts; corners are found to a tenth of a pixel."""


@dataclass(frozen=True, eq=False)
class BoardPoses:
    """By photograph: cameras in the board's frame, rms of the corners in pixels; those without a board."""

    cameras: dict[str, Camera]
    rms_px: dict[str, float]
    not_seen: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class PlacedRig:
    """Where a rig of cameras is in the mesh's world.

    Attributes:
        world_from_rig: F64[4, 4], rigid, of points in the rig times ``scale``.
        cameras: by photograph, in the mesh's world.
        rms_px: by photograph with pairs, over those that agree.
        outliers: by photograph, numbers of the pairs that do not, counted from 0.
    """

    world_from_rig: F64
    scale: float
    cameras: dict[str, Camera]
    rms_px: dict[str, float]
    outliers: dict[str, tuple[int, ...]]


def board_poses(views: Sequence[View], board: Board, square: float) -> BoardPoses:
    """Each photograph's camera in the frame of a board that lies still; ``square`` is a square's side.

    Raises:
        InputError: ``square`` is not positive, or no photograph shows the board.
    """
    if not (np.isfinite(square) and square > 0):
        raise InputError(f"the board's square is {square:g}", expected="a positive length in the mesh's unit")
    cameras, rms, not_seen = {}, {}, []
    for view in views:
        seen = find_board(view.file, view.gray, board)
        if seen is None:
            not_seen.append(view.name)
            continue
        posed = pose_from_pairs(
            view.lens, seen.uv_px, seen.x_on_board * square, tolerance_px=BOARD_PX, name=view.file.name
        )
        cameras[view.name], rms[view.name] = posed.camera, posed.rms_px
    if not cameras:
        raise InputError(
            f"a {board.columns}x{board.rows} board is in none of {len(views)} photographs",
            expected="the board beside the object, whole if it is a checkerboard",
        )
    return BoardPoses(cameras, rms, tuple(not_seen))


def place_mesh(
    scene: RayScene,
    views: Sequence[View],
    cameras: Mapping[str, Camera],
    pairs: Mapping[str, Pairs],
    free_scale: bool,
) -> PlacedRig:
    """The rigid transform, or with ``free_scale`` the similarity, that brings a rig to the mesh.

    It starts from the pose of a photograph by its pairs, is fitted robustly to all pairs, and then to the
    contours of all photographs that have a mask; what fits the masks less well is not taken.

    Args:
        cameras: in the rig's frame, by photograph.
        pairs: at least six in a photograph of the rig; with ``free_scale``, of two photographs.

    Raises:
        InputError: too few pairs, no agreement, a mirrored mesh (as `pose_from_pairs`), or a mesh and a rig
            in different units.
    """
    used = {name: pairs[name] for name in sorted(pairs) if name in cameras and len(pairs[name])}
    _check(used, free_scale)
    posed = {}
    for name, of in used.items():
        if len(of) >= 6 or (len(used) == 1 and len(of) >= 4):
            found = pose_from_pairs(cameras[name], of.uv_px, of.x_in_world, name=of.photograph)
            posed[name] = found.camera
    scales = _scales(posed, cameras) if free_scale else [1.0]
    fits = [_fit(_start(posed[n], cameras[n], s), used, cameras, free_scale) for n in posed for s in scales]
    best = min(fits, key=lambda p: _cost(p, used, cameras))
    if not free_scale:
        _check_units(best, posed, used, cameras)
    best = _by_contours(scene, views, best, used, cameras, free_scale)
    placed = {name: _at(camera, best) for name, camera in cameras.items()}
    agree = _agree(best, used, cameras)
    count, total = sum(int(a.sum()) for a in agree.values()), sum(len(of) for of in used.values())
    if count < needed(total):
        raise InputError(
            f"{count} of {total} pairs agree on a place of the mesh among the cameras",
            expected="half or more",
            hint="Did the object move on the board, or between photographs? Check the pairs",
        )
    off = {n: misses_px(placed[n], used[n].uv_px, used[n].x_in_world) for n in used}
    world_from_rig = np.eye(4)
    world_from_rig[:3, :3] = Rotation.from_rotvec(best[:3]).as_matrix()
    world_from_rig[:3, 3] = best[3:6]
    return PlacedRig(
        world_from_rig,
        float(np.exp(best[6])),
        placed,
        {n: root_mean_square(off[n][agree[n]]) for n in used},
        {n: tuple(int(i) for i in np.flatnonzero(~agree[n])) for n in used},
    )


def _check(used: Mapping[str, Pairs], free_scale: bool) -> None:
    counts = {name: len(p) for name, p in used.items()}
    if not counts or max(counts.values()) < (4 if len(counts) == 1 else 6):
        raise InputError(
            f"the photographs of the rig have {list(counts.values()) or 'no'} pairs",
            expected="six or more in one photograph whose camera is known",
        )
    if free_scale and sum(count >= 6 for count in counts.values()) < 2:
        raise InputError(
            f"pairs are in {len(counts)} photograph{'' if len(counts) == 1 else 's'}, which do not tell the "
            "scale of cameras whose unit is unknown",
            expected="six or more pairs in each of two photographs taken from different places",
        )


def _start(posed: Camera, camera: Camera, scale: float) -> F64:
    """Rotation vector, translation and logarithm of the scale [7] that bring one camera to its pose."""
    rotation = posed.world_from_camera[:3, :3] @ camera.world_from_camera[:3, :3].T
    place = posed.position - scale * rotation @ camera.position
    return np.concatenate([Rotation.from_matrix(rotation).as_rotvec(), place, [np.log(scale)]])


def _scales(posed: Mapping[str, Camera], cameras: Mapping[str, Camera]) -> list[float]:
    names = list(posed)
    found = []
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            rig = float(np.linalg.norm(cameras[a].position - cameras[b].position))
            if rig > 0:
                found.append(float(np.linalg.norm(posed[a].position - posed[b].position)) / rig)
    found = [s for s in found if s > 0]
    return [float(np.median(found))] if found else [1.0]


def _at(camera: Camera, p: F64) -> Camera:
    rotation = Rotation.from_rotvec(p[:3]).as_matrix()
    pose = np.eye(4)
    pose[:3, :3] = rotation @ camera.world_from_camera[:3, :3]
    pose[:3, 3] = np.exp(p[6]) * rotation @ camera.position + p[3:6]
    return replace(camera, world_from_camera=pose)


def _residual(p: F64, used: Mapping[str, Pairs], cameras: Mapping[str, Camera]) -> F64:
    """In tolerances; a point that is not seen counts as far off."""
    parts = []
    for name, of in used.items():
        uv, _ = _at(cameras[name], p).project(of.x_in_world)
        off = (uv - of.uv_px) / default_tolerance_px(cameras[name])
        parts.append(np.nan_to_num(off, nan=1e3).ravel())
    return np.concatenate(parts)


def _cost(p: F64, used: Mapping[str, Pairs], cameras: Mapping[str, Camera]) -> float:
    off = _residual(p, used, cameras).reshape(-1, 2)
    return float(np.minimum((off**2).sum(axis=1), 1).sum())


def _fit(start: F64, used: Mapping[str, Pairs], cameras: Mapping[str, Camera], free_scale: bool) -> F64:
    count = 7 if free_scale else 6
    # Coordinates have the world's unit: steps of translations are scaled by its size.
    size = max(float(np.abs(np.concatenate([of.x_in_world for of in used.values()])).max()), 1e-9)
    unit = np.array([1.0, 1, 1, size, size, size, 1])

    def whole(q: F64) -> F64:
        return np.asarray(np.concatenate([q, start[count:] / unit[count:]]) * unit)

    def residual(q: F64) -> F64:
        return _residual(whole(q), used, cameras)

    found = least_squares(residual, start[:count] / unit[:count], loss="cauchy", f_scale=0.3)
    return whole(np.asarray(found.x, dtype=np.float64))


def _agree(p: F64, used: Mapping[str, Pairs], cameras: Mapping[str, Camera]) -> dict[str, Bool]:
    return {
        n: misses_px(_at(cameras[n], p), of.uv_px, of.x_in_world) < default_tolerance_px(cameras[n])
        for n, of in used.items()
    }


def _check_units(
    rigid: F64, posed: Mapping[str, Camera], used: Mapping[str, Pairs], cameras: Mapping[str, Camera]
) -> None:
    """Raises where another scale makes pairs of two photographs agree that do not with the given one."""
    if len(posed) < 2:
        return
    name = next(iter(posed))
    [scale] = _scales(posed, cameras)
    free = _fit(_start(posed[name], cameras[name], scale), used, cameras, True)
    total = sum(len(of) for of in used.values())
    own, other = (sum(int(a.sum()) for a in _agree(p, used, cameras).values()) for p in (rigid, free))
    found = float(np.exp(free[6]))
    # The size of a board is known to a few per mille.
    if other < max(needed(total), own + 3) or abs(found - 1) < 0.01:
        return
    near = next((u for u in UNITS if abs(found / u - 1) < NEAR_UNIT), None)
    names = {1000.0: ("millimetres", "metres"), 100.0: ("centimetres", "metres")}
    names |= {10.0: ("millimetres", "centimetres"), 25.4: ("millimetres", "inches")}
    hint = "Measure the board's square again, in the mesh's unit"
    if near is not None:
        mesh, board = names[near] if near in names else names[round(1 / near, 6)][::-1]
        hint = f"The mesh looks to be in {mesh} and --square in {board}"
    raise InputError(
        f"the mesh and the board are in different units: {other} of {total} pairs agree with a board "
        f"{found:.4g} times as large, {own} with the given one",
        expected="the board's square in the mesh's unit",
        hint=hint,
    )


def _by_contours(
    scene: RayScene,
    views: Sequence[View],
    p: F64,
    used: Mapping[str, Pairs],
    cameras: Mapping[str, Camera],
    free_scale: bool,
) -> F64:
    """All cameras moved together until the masks fit; as before where they fit no better."""
    masked = [v for v in views if v.name in cameras and v.region is not None and v.region.any()]
    if not masked:
        return p
    agree = _agree(p, used, cameras)
    kept = {n: Pairs(of.photograph, of.uv_px[agree[n]], of.x_in_world[agree[n]]) for n, of in used.items()}
    count, centre = (7 if free_scale else 6), scene.centre

    def spread(moving: tuple[Camera, ...]) -> list[F64]:
        maps = []
        for camera in moving:
            back, away = camera.world_from_camera[:3, :3].T, camera.position - centre
            whole = np.zeros((6, 7))
            x, y, z = away
            whole[:3, :3] = back
            whole[3:, :3] = back @ -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            whole[3:, 3:6] = back
            whole[3:, 6] = back @ away
            maps.append(whole[:, :count])
        return maps

    def move(moving: tuple[Camera, ...], step: F64) -> tuple[Camera, ...]:
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        grow = np.exp(step[6]) if free_scale else 1.0
        made = []
        for camera in moving:
            pose = np.eye(4)
            pose[:3, :3] = turn @ camera.world_from_camera[:3, :3]
            pose[:3, 3] = grow * turn @ (camera.position - centre) + centre + step[3:6]
            made.append(replace(camera, world_from_camera=pose))
        return tuple(made)

    start = tuple(_at(cameras[v.name], p) for v in masked)
    found = align(
        scene,
        [ImageEdges.of(v) for v in masked],
        Rig(start, move, spread),
        [kept.get(v.name) for v in masked],
        stages=2,
    ).stages[-1]
    before, after = (
        float(np.mean([iou(scene, v, c) or 0.0 for v, c in zip(masked, moved, strict=True)]))
        for moved in (start, found)
    )
    if after < before:
        return p
    scale = np.exp(p[6])
    if free_scale and len(masked) > 1:
        rig = np.ptp([cameras[v.name].position for v in masked], axis=0)
        if np.linalg.norm(rig) > 0:
            names = {v.name: c for v, c in zip(masked, found, strict=True)}
            scale = _scales(names, cameras)[0]
    return _start(found[0], cameras[masked[0].name], float(scale))

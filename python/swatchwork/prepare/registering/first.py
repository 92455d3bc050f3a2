# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The first poses: by a board in the photographs, by clicked pairs, a sphere's outline, or a silhouette."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from swatchwork.arrays import Bool
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.boards import Board
from swatchwork.prepare.registering.least import misses_px, root_mean_square
from swatchwork.prepare.registering.on_board import BoardPoses, board_poses
from swatchwork.prepare.registering.outlining import Outlines
from swatchwork.prepare.registering.pairs import Pairs
from swatchwork.prepare.registering.placing import PlacedRig, carried, place_mesh
from swatchwork.prepare.registering.posing import Posed, default_tolerance_px, pose_from_pairs
from swatchwork.prepare.registering.refining import refine_by_contours
from swatchwork.prepare.registering.spheres import sphere_camera, sphere_in_rig
from swatchwork.prepare.registering.units import check_on_mesh
from swatchwork.prepare.registering.view import View
from swatchwork.progress import SILENT, Progress
from swatchwork.surface import RayScene

CORNER_PX = 0.5
"""Standard deviation of a board's corner: the corner's own tenth, and the board's bending."""


@dataclass(frozen=True, eq=False)
class Clues:
    """What places the first photographs.

    Attributes:
        pairs: points clicked, by the photograph's name.
        board: in the photographs, fixed to the object; ``square`` is the side of a square, world units.
        sphere: radius of the object, world units, where it is a sphere about the world's origin.
    """

    pairs: Mapping[str, Pairs] = field(default_factory=dict)
    board: Board | None = None
    square: float = 0.0
    sphere: float | None = None


@dataclass(frozen=True, eq=False)
class FirstPoses:
    """Poses to start from, by the photograph's name.

    Attributes:
        cameras: in the mesh's world.
        placed_by: "board", "pairs", "outline" (of a sphere) or "silhouette".
        pairs: those that agree; ``inliers`` Bool[C] says which of all.
        corners: of the board, in the mesh's world.
        masks_off: photographs whose mask contradicts their pairs.
        suspicions: in words.
    """

    cameras: dict[str, Camera]
    placed_by: dict[str, str]
    pairs: dict[str, Pairs] = field(default_factory=dict)
    inliers: dict[str, Bool] = field(default_factory=dict)
    corners: dict[str, Pairs] = field(default_factory=dict)
    masks_off: frozenset[str] = frozenset()
    suspicions: tuple[str, ...] = ()


def first_poses(
    scene: RayScene, views: Sequence[View], clues: Clues, outlines: Outlines, progress: Progress = SILENT
) -> FirstPoses:
    """Place the photographs that a clue says something of; without any clue, one by its silhouette.

    Raises:
        InputError: a clue is of no photograph or fits no pose; mesh and board are in different units; there
            is no clue, and no silhouette that leaves no doubt.
    """
    by_name = {view.name: view for view in views}
    marked = {name: of for name, of in clues.pairs.items() if len(of)}
    if marked and not any(name in by_name for name in marked):
        raise InputError(
            "there are pairs of " + ", ".join(of.photograph for of in marked.values()) + " only",
            expected="pairs of " + ", ".join(list(by_name)[:8]) + (", ..." if len(by_name) > 8 else ""),
            hint="Give the photographs that were clicked, too",
        )
    marked = {name: of for name, of in marked.items() if name in by_name}
    if marked:
        check_on_mesh(scene, marked)
    if clues.board is not None:
        return _by_board(scene, views, clues, clues.board, marked, progress)
    if marked:
        return _by_pairs(scene, by_name, marked, progress)
    if clues.sphere is not None:
        return _by_outline(views, clues.sphere)
    found = outlines.of(list(by_name), enough=1)
    if not found:
        said = "; ".join(f"{name} {why}" for name, why in list(outlines.why.items())[:3])
        raise InputError(
            "nothing says where any photograph was taken from" + (f": {said}" if said else ""),
            expected="6 to 12 pairs of points in one of them, a board in the photographs, or masks",
            hint="Click pairs with `swatchwork prepare pairs`",
        )
    return FirstPoses(found, dict.fromkeys(found, "silhouette"))


def _by_board(
    scene: RayScene,
    views: Sequence[View],
    clues: Clues,
    board: Board,
    marked: Mapping[str, Pairs],
    progress: Progress,
) -> FirstPoses:
    seen = board_poses(views, board, clues.square, progress)
    boardless = {name: of for name, of in marked.items() if name not in seen.cameras}
    if marked and not any(name in seen.cameras for name in marked):
        raise InputError(
            "the board is in none of the photographs with pairs (" + ", ".join(marked) + ")",
            expected="pairs in a photograph that shows the board: " + ", ".join(list(seen.cameras)[:8]),
        )
    if clues.sphere is not None and not marked:
        centre, _ = sphere_in_rig(views, seen.cameras, clues.sphere)
        mesh_from_rig = np.eye(4)
        mesh_from_rig[:3, 3] = -centre
        found = PlacedRig(carried(seen.cameras, mesh_from_rig), mesh_from_rig, {}, None, None, None)
    else:
        found = place_mesh(scene, views, seen.cameras, marked, stand=seen.centre)
    said = [f"{name}: the board is so small or far that its tilt is not sure" for name in seen.ambiguous]
    said += [words for name, of in found.inliers.items() for words in _left_out(name, of)]
    beside = _by_pairs(scene, {view.name: view for view in views}, boardless, progress)
    pairs = {name: _only(marked[name], of) for name, of in found.inliers.items()}
    return FirstPoses(
        found.cameras | beside.cameras,
        dict.fromkeys(found.cameras, "board") | beside.placed_by,
        pairs | beside.pairs,
        found.inliers | beside.inliers,
        _corners(seen, found),
        beside.masks_off,
        (*said, *beside.suspicions),
    )


def _corners(seen: BoardPoses, found: PlacedRig) -> dict[str, Pairs]:
    turn, shift = found.mesh_from_rig[:3, :3], found.mesh_from_rig[:3, 3]
    return {name: Pairs(name, uv_px, x @ turn.T + shift) for name, (uv_px, x) in seen.corners.items()}


def _by_pairs(
    scene: RayScene, views: Mapping[str, View], marked: Mapping[str, Pairs], progress: Progress
) -> FirstPoses:
    posed = {
        name: pose_from_pairs(views[name].lens, of.uv_px, of.x_in_world, name=str(views[name].file))
        for name, of in marked.items()
    }
    pairs = {name: _only(marked[name], found.inliers) for name, found in posed.items()}
    cameras, masks_off, said = dict[str, Camera](), set[str](), list[str]()
    with progress.stage("Aligning contours", len(posed)) as task:
        for name, found in posed.items():
            refined = refine_by_contours(scene, views[name], found.camera, pairs[name])
            cameras[name] = refined.camera
            said += _said(name, found)
            off = root_mean_square(
                np.minimum(misses_px(refined.camera, pairs[name].uv_px, pairs[name].x_in_world), 1e6)
            )
            # A stand in the mask moves the pose a little; the mask of another photograph moves it away.
            if refined.iou is not None and off > found.rms_px + default_tolerance_px(found.camera):
                cameras[name] = found.camera
                masks_off.add(name)
                said.append(
                    f"{name}: its mask and its pairs contradict each other (by the mask's outline the pairs "
                    f"are {off:.0f} px off), and the mask is left out; is it another photograph's?"
                )
            task.advance()
    inliers = {name: found.inliers for name, found in posed.items()}
    return FirstPoses(
        cameras,
        dict.fromkeys(cameras, "pairs"),
        pairs,
        inliers,
        masks_off=frozenset(masks_off),
        suspicions=tuple(said),
    )


def _by_outline(views: Sequence[View], radius: float) -> FirstPoses:
    """The first photograph with a mask; its camera's axes are the world's."""
    view = next((view for view in views if view.region is not None), None)
    if view is None:
        raise InputError(
            "no photograph of the sphere has a mask",
            expected="masks, or alpha, white where the sphere is",
            hint="Give --masks, or place the photographs by a board",
        )
    camera, _ = sphere_camera(view, radius)
    return FirstPoses({view.name: camera}, {view.name: "outline"})


def _only(pairs: Pairs, inliers: Bool) -> Pairs:
    return Pairs(pairs.photograph, pairs.uv_px[inliers], pairs.x_in_world[inliers])


def _left_out(name: str, inliers: Bool) -> list[str]:
    out = np.flatnonzero(~inliers)
    if not len(out):
        return []
    numbers = ", ".join(str(i + 1) for i in out)
    if len(out) == 1:
        return [f"{name}: pair {numbers} disagrees with the others and is left out"]
    return [f"{name}: pairs {numbers} disagree with the others and are left out"]


def _said(name: str, posed: Posed) -> list[str]:
    said = _left_out(name, posed.inliers)
    if posed.ambiguous:
        said.append(
            f"{name}: another pose fits the pairs nearly as well ({posed.rival_px:.1f} px, this one "
            f"{posed.rms_px:.1f} px); click points at other depths"
        )
    if posed.focal_off:
        said.append(
            f"{name}: the pairs fit better with a focal length {posed.focal_fits:.3f} times that of the "
            "intrinsics; calibrate with the lens as it was for these photographs"
        )
    return said

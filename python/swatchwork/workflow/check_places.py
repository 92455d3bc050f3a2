# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What is wrong with where mesh and cameras are, in words, the weightiest first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..surface import Mesh, RayScene
from .check_shapes import (
    FrameShape,
    Move,
    axis_moves,
    best_move,
    best_pose,
    better,
    overlap,
    scale_moves,
)
from .check_words import Finding

NEAREST, FARTHEST = 1.2, 50.0
"""Radii of the object that cameras stand away, in captures whose units agree."""
TRIED = 6
"""Frames on which other meshes are tried."""


def findings_on_shape(mesh: Mesh, shapes: Sequence[FrameShape], seen: Sequence[int]) -> list[Finding]:
    """Units, a mirrored or turned mesh, swapped photographs, poses; ``seen`` counts points by frame."""
    scene = RayScene([mesh])
    judged = [s for s in shapes if s.iou is not None]
    tried = [judged[i] for i in _spread(len(judged), TRIED)]
    centre, radius = mesh.bounds
    away = float(np.median([np.linalg.norm(s.frame.camera.position - centre) for s in shapes])) / radius
    if not NEAREST <= away <= FARTHEST:
        return [_units(scene, tried, away)]
    if judged and not all(s.fits for s in judged):
        own, other, move = best_move(scene, tried, axis_moves(centre))
        if better(own, other):
            return [_turned(own, other, move)]
    found, explained = _swapped(scene, judged)
    blind = [s for s, count in zip(shapes, seen, strict=True) if not count]
    if blind:
        found.append(
            Finding(
                "sees nothing",
                "wrong",
                f"{_names(blind)} {'see' if len(blind) > 1 else 'sees'} nothing of the mesh",
                "No point of the mesh is in front of the camera, inside its picture and unhidden.",
                "Check the pose: transform_matrix is world_from_camera, and the camera looks along its -z.",
                tuple(s.frame.name for s in blind),
            )
        )
    hidden = {s.frame.name for s in blind}
    off = [s for s in judged if not s.fits and s.frame.name not in explained | hidden]
    found += _misfits(off, len(judged))
    return found


def _units(scene: RayScene, tried: list[FrameShape], away: float) -> Finding:
    guess = "Millimetres against metres differ by 1000, inches against metres by 39.4."
    if tried:
        _, other, move = best_move(scene, tried, scale_moves())
        if other > 0.85:
            guess = (
                f"With the mesh {move.words}, its silhouette covers the photographs' (intersection over "
                f"union {other:.2f})."
            )
    near = away < NEAREST
    return Finding(
        "units",
        "wrong",
        "Mesh and cameras are in different units",
        f"The cameras stand {away:.3g} radii of the mesh away from its centre; photographs are taken from "
        f"{NEAREST:g} to {FARTHEST:g}. The mesh is too {'large' if near else 'small'}, or the distances "
        f"of the cameras too {'small' if near else 'large'}. {guess}",
        "Scale the mesh, or the positions in transform_matrix, so that both have one unit.",
    )


def _turned(own: float, other: float, move: Move) -> Finding:
    where = "the origin" if not move.about.any() else "its centre"
    what = "mirrored" if move.mirrors else "turned"
    advice = (
        "Undo the mirror where the mesh was exported: a swap of two axes needs a change of sign too."
        if move.mirrors
        else "Export the mesh with the cameras' up axis: many programs turn y up to z up on the way."
    )
    return Finding(
        "mirrored mesh" if move.mirrors else "turned mesh",
        "wrong",
        f"The mesh is {what}",
        f"As it is, its silhouette and the photographs' have an intersection over union of {own:.2f}; with "
        f"{move.words} about {where} it is {other:.2f}.",
        advice,
    )


def _swapped(scene: RayScene, judged: list[FrameShape]) -> tuple[list[Finding], set[str]]:
    """Photographs that fit another frame's pose, and the names of those explained so."""
    place: dict[int, tuple[int, float, float]] = {}
    for i, shape in enumerate(judged):
        both, either = overlap(scene, shape.frame.camera, shape)
        if both < 0.97 * either and len(judged) > 1:
            own, other, j = best_pose(scene, judged, i)
            if better(own, other):
                place[i] = (j, own, other)
    found: list[Finding] = []
    for i, (j, own, other) in place.items():
        pair = j in place and place[j][0] == i
        if pair and j < i:
            continue
        a, b = judged[i].frame.name, judged[j].frame.name
        text = (
            f"{a} has an intersection over union of {own:.2f} in its own pose, of {other:.2f} in that of {b}"
        )
        if pair:
            text += f"; {b} has {place[j][1]:.2f} in its own and {place[j][2]:.2f} in that of {a}"
        found.append(
            Finding(
                "swapped photographs",
                "wrong",
                f"{a} and {b} are swapped" if pair else f"{a} was taken from where {b} is said to be",
                text + ".",
                'Exchange their "file_path" (and masks), or their "transform_matrix".'
                if pair
                else "Check the order in which photographs and poses were paired.",
                (a, b) if pair else (a,),
            )
        )
    return found, {judged[i].frame.name for i in place}


def _misfits(off: list[FrameShape], judged: int) -> list[Finding]:
    if not off:
        return []
    worst = sorted(off, key=lambda s: s.iou or 0.0)
    if len(off) > max(3, 0.6 * judged):
        middle = float(np.median([s.iou or 0.0 for s in off]))
        return [
            Finding(
                "mesh does not fit",
                "wrong",
                f"The mesh does not cover the object in {len(off)} of {judged} photographs",
                f"Their median intersection over union is {middle:.2f}. Neither a swap or reversal of "
                f"axes nor other photographs' poses explain it. In {worst[0].frame.name}, "
                f"{worst[0].offset_in_words()}.",
                "Align the mesh with the cameras, or check that both are in one "
                "world and that the masks are the object's.",
                tuple(s.frame.name for s in worst),
            )
        ]
    return [
        Finding(
            "pose",
            "wrong" if (s.iou or 0.0) < 0.8 else "suspicious",
            f"The mesh does not cover the object in {s.frame.name}",
            f"Intersection over union {s.iou:.2f}: {s.offset_in_words()}. The other photographs fit.",
            "Register this photograph anew, or leave it out; look at its mask too.",
            (s.frame.name,),
        )
        for s in worst
    ]


def _names(shapes: Sequence[FrameShape]) -> str:
    names = [s.frame.name for s in shapes[:4]]
    return ", ".join(names) + (f" and {len(shapes) - 4} more" if len(shapes) > 4 else "")


def _spread(count: int, wanted: int) -> list[int]:
    wanted = min(count, wanted)
    return [round(i * count / wanted) for i in range(wanted)]

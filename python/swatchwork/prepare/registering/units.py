# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whether a board's squares and the mesh are measured in the same unit, told by what does not fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from swatchwork.arrays import F64, norm
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering.pairs import Pairs
from swatchwork.prepare.registering.refining import iou
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene, surface_points

FACTORS = {
    1000.0: ("millimetres", "metres"),
    100.0: ("centimetres", "metres"),
    10.0: ("millimetres", "centimetres"),
    25.4: ("millimetres", "inches"),
    12.0: ("inches", "feet"),
    2.54: ("centimetres", "inches"),
}
"""Mesh over board, and the units that have it."""
BY_PAIRS, BY_SILHOUETTES, BY_DISTANCE = 0.04, 0.08, 1.5
"""Relative difference from such a factor: of a fit; of scales tried 10 % apart; and of distances, since the
object may stand beside the board, or high."""
FAR = 3.0
"""Ratio of the distances to the object and to the board that no object on or near it has."""
OFF = 0.02
"""Least difference of a scale from 1 that counts."""
POOR_IOU, GOOD_IOU = 0.8, 0.9
TRIED, BETWEEN = np.geomspace(1 / 3, 3, 25), np.geomspace(0.92, 1.087, 9)
"""Scales tried on the silhouettes, each 10 % after the last, and then about the best of them, each 2 %."""


PAIRS_OFF = 0.05
"""Distance from the mesh, in radii of the object, that no point clicked on it has."""
SAMPLES = 20_000
"""Points that stand for the mesh there: a hundredth of the radius apart or so."""


class Fit(Protocol):
    """A transform by pairs: its scale, how many of how many pairs agree, and their number by photograph."""

    @property
    def scale(self) -> float: ...
    @property
    def agree(self) -> int: ...
    @property
    def count(self) -> int: ...
    @property
    def each(self) -> tuple[int, ...]: ...


def check_on_mesh(scene: RayScene, pairs: Mapping[str, Pairs]) -> None:
    """Raises InputError where most pairs' points are nowhere near the mesh: another mesh, or another unit."""
    x = np.concatenate([of.x_in_world for of in pairs.values()])
    tree = cKDTree(surface_points(scene.meshes[0], SAMPLES).position)

    def near(change: float | F64) -> float:
        off = np.asarray(tree.query(change * x)[0])
        return float((off < PAIRS_OFF * scene.radius).mean())

    if near(1.0) > 0.5:
        return
    flips = 1.0 - 2.0 * np.eye(3)
    known = FACTORS | {1 / factor: units[::-1] for factor, units in FACTORS.items()}
    factor = max(known, key=near)
    hint = "Click pairs on the mesh that is registered"
    if near(factor) > 0.5:
        hint = f"The mesh looks to be in {known[factor][0]} where the pairs are in {known[factor][1]}"
    elif max(near(flip) for flip in flips) > 0.5:
        hint = "They are on its mirror image: undo the mirror where the mesh was exported"
    raise InputError(
        f"{100 * (1 - near(1.0)):.0f} % of the pairs' points are not on the mesh (the mesh is "
        f"{2 * scene.radius:.4g} large, the points spread over {np.ptp(x, axis=0).max():.4g})",
        expected="pairs and mesh in one unit and one place",
        hint=hint,
    )


def check_pairs(rigid: Fit, similar: Fit) -> None:
    """Raises InputError where the pairs fit the rig only once it is scaled."""
    told = sum(count >= 3 for count in rigid.each) >= 2 or len(rigid.each) > 3
    if not told or abs(np.log(similar.scale)) < OFF:
        return
    more = similar.agree - rigid.agree
    if similar.agree >= 0.6 * similar.count and more >= max(3, 0.2 * similar.count):
        raise scale_error(
            similar.scale,
            f"with this scale {similar.agree} of {similar.count} pairs agree, without {rigid.agree}",
            BY_PAIRS,
        )


def check_distance(
    scene: RayScene,
    views: Mapping[str, View],
    cameras_in_rig: Mapping[str, Camera],
    name: str,
    posed: Camera | None,
    stand: F64,
) -> None:
    """Raises InputError where the mesh is much farther from, or nearer to, a camera than the board is.

    ``posed`` is photograph ``name``'s camera in the mesh's world. Without it the mesh's own size is compared:
    the object stands on the board and is not larger than the distance.
    """
    to_board = float(norm(cameras_in_rig[name].position - stand))
    if posed is None:
        ratio = 3 * scene.radius / to_board
        if not 0.01 < ratio < 10:
            raise scale_error(ratio, _sizes(scene, to_board, name), BY_DISTANCE)
        return
    to_mesh = float(norm(posed.position - scene.centre))
    ratio = to_mesh / to_board
    if 1 / FAR < ratio < FAR:
        return
    said = f"{name} is {to_mesh:.4g} from the mesh by its pairs, and {to_board:.4g} from the board"
    exact, fits = best_scale(scene, views, cameras_in_rig, name, posed, ratio)
    if fits >= GOOD_IOU:
        said += f"; with this scale silhouettes cover each other to {fits:.2f}"
        raise scale_error(exact, said, BY_SILHOUETTES)
    raise scale_error(ratio, said, BY_DISTANCE)


def check_silhouettes(
    scene: RayScene,
    views: Mapping[str, View],
    cameras_in_rig: Mapping[str, Camera],
    name: str,
    posed: Camera,
    reached: float | None,
) -> None:
    """Raises InputError where the silhouettes fit badly, and well once the rig is scaled about one."""
    if reached is None or reached > POOR_IOU:
        return
    scale, fits = best_scale(scene, views, cameras_in_rig, name, posed, 1.0)
    if fits >= max(GOOD_IOU, reached + 0.1) and abs(np.log(scale)) > 0.05:
        said = f"with this scale silhouettes cover each other to {fits:.2f}, without to {reached:.2f}"
        raise scale_error(scale, said, BY_SILHOUETTES)


def best_scale(
    scene: RayScene,
    views: Mapping[str, View],
    cameras_in_rig: Mapping[str, Camera],
    name: str,
    posed: Camera,
    about: float,
) -> tuple[float, float]:
    """The scale of the rig near ``about`` by which its other cameras see their masks, and the IoU.

    Photograph ``name`` stays where it is. Without other masks the IoU is 0.
    """
    back = np.linalg.inv(cameras_in_rig[name].world_from_camera)
    others = [other for other in cameras_in_rig if other != name and views[other].region is not None][:4]
    if not others:
        return about, 0.0

    def covered(scale: float) -> float:
        values = []
        for other in others:
            relative = back @ cameras_in_rig[other].world_from_camera
            relative[:3, 3] *= scale
            camera = replace(cameras_in_rig[other], world_from_camera=posed.world_from_camera @ relative)
            values.append(iou(scene, views[other], camera) or 0.0)
        return float(np.mean(values))

    for factors in (TRIED, BETWEEN):
        found = [covered(about * float(factor)) for factor in factors]
        best = int(np.argmax(found))
        about *= float(factors[best])
    return about, found[best]


def scale_error(scale: float, said: str, near: float, thing: str = "mesh") -> InputError:
    """Names the scale of a thing, and the units that explain it up to a relative difference ``near``."""
    times, how = (scale, "large") if scale > 1 else (1 / scale, "small")
    units = units_of(scale, near)
    hint = f"Check the length of a square's side, and give --square in the {thing}'s unit"
    if units is not None:
        hint = f"The {thing} looks to be in {units[0]} where --square is in {units[1]}"
        hint += f": give --square in {units[0]}"
    about = "" if near == BY_PAIRS else "about "
    return InputError(
        f"the {thing} is {about}{times:.3g} times too {how} for the board ({said})",
        expected=f"{thing} and --square in one unit",
        hint=hint,
    )


def units_of(scale: float, near: float) -> tuple[str, str] | None:
    """Units of mesh and board by the factor between them, or None where none is near."""
    known = FACTORS | {1 / factor: units[::-1] for factor, units in FACTORS.items()}
    best = min(known, key=lambda factor: abs(np.log(scale / factor)))
    return known[best] if abs(np.log(scale / best)) < np.log1p(near) else None


def _sizes(scene: RayScene, to_board: float, name: str) -> str:
    return f"the mesh is {2 * scene.radius:.4g} large, and {name} is {to_board:.4g} from the board"

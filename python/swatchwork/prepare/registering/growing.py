# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From the poses of one or a few photographs to those of all that see the same surface.

Features of placed photographs are lifted onto the mesh; the photograph that shares most of these points is
placed by them (`resect`), everything is refined together (`refine`), and so on, until none can be placed.
Then matches have a turn that no essential matrix vouches for: the mesh may. A photograph that cannot be
placed is told with its numbers, and is never guessed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F64, I64
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering.bundle import refine
from swatchwork.prepare.registering.least import misses_px
from swatchwork.prepare.registering.lifting import finite
from swatchwork.prepare.registering.motion import apart
from swatchwork.prepare.registering.rematching import loose_points
from swatchwork.prepare.registering.resection import CHANCE, INLIER_PX, LEAST, Resection, resect
from swatchwork.prepare.registering.sighting import Sightings, first_points
from swatchwork.prepare.registering.sliding import Extra
from swatchwork.prepare.registering.tracks import Tracks, coarseness
from swatchwork.prepare.registering.view import View
from swatchwork.progress import SILENT, Progress
from swatchwork.surface import RayScene

REFINE_AFTER = 1.25
"""All is refined when there are this many times the frames that there were at the last time."""
BETWEEN = 12
"""Steps of a refinement in between; the last is left to whoever wants it."""
OFF_DEG, OFF_SHARE = 5.0, 0.1
"""A given pose that ends up farther than this from where it was given was not one of this photograph."""
GRACE_PX = 6.0
"""How far sightings may be from their point while poses are still rough."""


@dataclass(frozen=True)
class Placed:
    """What became of a frame.

    Attributes:
        status: "given", "placed", "contradicts" (a given pose that the others' surface does not agree with),
            or "cannot be placed".
        shared: points on the mesh that it shares with placed frames.
        inliers: how many of these are within 4 px of where its pose has them.
        rms_px: of the inliers; NaN without.
        why: why it cannot be placed, or what contradicts it, with numbers; empty otherwise.
    """

    status: str
    shared: int
    inliers: int
    rms_px: float
    why: str = ""


@dataclass(frozen=True, eq=False)
class Grown:
    """Poses of all frames that could be placed, by name; ``frames`` says what became of each view."""

    cameras: dict[str, Camera]
    frames: dict[str, Placed]

    @property
    def missing(self) -> dict[str, str]:
        """Why each frame without a pose has none."""
        return {name: f.why for name, f in self.frames.items() if f.why and name not in self.cameras}


def grow(
    scene: RayScene,
    views: Sequence[View],
    posed: Mapping[str, Camera],
    tracks: Tracks,
    extra_terms: Sequence[Extra] = (),
    *,
    scan_error: float = 0.0,
    progress: Progress = SILENT,
) -> Grown:
    """Place as many of the views as the tracks allow.

    Args:
        posed: at least one frame's pose, by name; refined with the others, as the mesh says.
        extra_terms, scan_error: as for `refine`.

    Raises:
        InputError: no pose is given, or one of no photograph.
    """
    by_name: dict[str, View] = {view.name: view for view in views}
    if not posed:
        raise InputError(
            "no photograph's pose is known",
            expected="one at least",
            hint="Place a photograph by points clicked in it and on the mesh",
        )
    for name in posed:
        if name not in by_name:
            raise InputError(f"there is a pose for {name!r}", expected="the name of one of the photographs")
    cameras = dict(posed)
    at_last = 1
    with progress.stage("Placing photographs", len(views) - len(posed)) as task:
        while True:
            points = surface_points_of(scene, cameras, tracks)
            found, refused = _next(scene, by_name, cameras, tracks, points)
            if found is None:
                found = _loose(scene, by_name, cameras, tracks, refused)
            if found is None:
                break
            name, resection = found
            task.describe(name)
            assert resection.camera is not None
            cameras[name] = resection.camera
            if len(cameras) >= REFINE_AFTER * at_last:
                cameras = refine(
                    scene, views, cameras, tracks, extra_terms, scan_error=scan_error, steps=BETWEEN
                ).cameras
                at_last = len(cameras)
            task.advance()
    frames = {}
    for name in by_name:
        if name in cameras:
            known = points
            if name in posed and len(cameras) > 1:
                # By the others alone: a given pose must not speak for itself.
                others = {other: camera for other, camera in cameras.items() if other != name}
                known = surface_points_of(scene, others, tracks)
            frames[name] = _counted(scene, name, cameras[name], posed.get(name), tracks, known)
        else:
            shared, why = refused[name]
            said = _said(name, tracks) if shared < LEAST else ""
            frames[name] = Placed("cannot be placed", shared, 0, float("nan"), why + said)
    return Grown(cameras, frames)


def _counted(
    scene: RayScene, name: str, camera: Camera, given: Camera | None, tracks: Tracks, points: F64
) -> Placed:
    """How a frame's pose agrees with the points that it shares with others."""
    size = np.bincount(tracks.track, minlength=tracks.count)
    frame = tracks.names.index(name) if name in tracks.names else -1
    rows = np.flatnonzero((tracks.frame == frame) & finite(points)[tracks.track])
    rows = rows[size[tracks.track[rows]] > 1]
    error_px = misses_px(camera, tracks.uv_px[rows], points[tracks.track[rows]])
    good = error_px[error_px < INLIER_PX * coarseness(camera)]
    rms_px = float(np.sqrt((good**2).mean())) if len(good) else float("nan")
    if given is None:
        return Placed("placed", len(rows), len(good), rms_px)
    if len(rows) >= LEAST and len(good) < max(LEAST, CHANCE * len(rows)):
        why = (
            f"of {len(rows)} points shared with other photographs {len(good)} are where the given pose has "
            "them; is the pose another photograph's?"
        )
        return Placed("contradicts", len(rows), len(good), rms_px, why)
    angle, away = apart(given, camera, scene.centre)
    if angle > OFF_DEG or away > OFF_SHARE:
        why = (
            f"the given pose is {angle:.1f} degrees and {100 * away:.0f} % of the distance away from the one "
            f"that {len(good)} points shared with other photographs agree on; is it another photograph's?"
        )
        return Placed("contradicts", len(rows), len(good), rms_px, why)
    return Placed("given", len(rows), len(good), rms_px)


def surface_points_of(scene: RayScene, cameras: Mapping[str, Camera], tracks: Tracks) -> F64:
    """Where tracks that placed frames see are on the mesh, F64[T, 3]; NaN where that is not sure.

    A track whose sightings do not agree on a place (most of them, within 6 px) has none.
    """
    names = [name for name in tracks.names if name in cameras]
    seen = Sightings.of(tracks, names, least=1)
    of = [cameras[name] for name in names]
    x, _, sure = first_points(scene, of, seen, GRACE_PX)
    near = np.zeros(len(seen), dtype=bool)
    for f, rows in enumerate(seen.rows):
        near[rows] = misses_px(of[f], seen.uv_px[rows], x[seen.track[rows]]) < GRACE_PX * coarseness(of[f])
    size = np.bincount(seen.track, minlength=len(x))
    sure &= 2 * np.bincount(seen.track[near], minlength=len(x)) > size
    points = np.full((tracks.count, 3), np.nan)
    points[seen.track_number[sure]] = x[sure]
    return points


def _next(
    scene: RayScene, views: Mapping[str, View], cameras: Mapping[str, Camera], tracks: Tracks, points: F64
) -> tuple[tuple[str, Resection] | None, dict[str, tuple[int, str]]]:
    """The first frame, of those that share most points, that can be placed; and why those before cannot."""
    known = finite(points)
    rows: dict[str, I64] = {name: np.zeros(0, np.int64) for name in views if name not in cameras}
    for f, name in enumerate(tracks.names):
        if name in rows:
            rows[name] = np.flatnonzero((tracks.frame == f) & known[tracks.track])
    refused: dict[str, tuple[int, str]] = {}
    for name in sorted(rows, key=lambda name: -len(rows[name])):
        mine = rows[name]
        result = resect(scene, views[name], tracks.uv_px[mine], points[tracks.track[mine]])
        if result.camera is not None:
            return (name, result), refused
        refused[name] = (len(mine), result.why)
    return None, refused


def _loose(
    scene: RayScene,
    views: Mapping[str, View],
    cameras: Mapping[str, Camera],
    tracks: Tracks,
    refused: dict[str, tuple[int, str]],
) -> tuple[str, Resection] | None:
    """The frame that matches without an essential matrix place by most points, if any.

    Where they come nearer to it than tracks, why they do not reach it is put into ``refused``.
    """
    found = []
    for name in views:
        if name not in cameras:
            uv_px, x = loose_points(scene, cameras, tracks, name)
            result = resect(scene, views[name], uv_px, x)
            if result.camera is not None:
                found.append((name, result))
            elif len(x) >= LEAST > refused[name][0]:
                refused[name] = (refused[name][0], result.why)
    return max(found, key=lambda one: int(one[1].inlier.sum()), default=None)


def _said(name: str, tracks: Tracks) -> str:
    """Where the points are lost: features, or matches."""
    if name not in tracks.names:
        return " (no features were sought in it)"
    frame = tracks.names.index(name)
    most = int(tracks.agreeing[frame].max(initial=0))
    count = f"{len(tracks.features[frame])} " if tracks.features else ""
    return (
        f" ({count}features, at most {most} of them matched with another photograph); does it "
        "show the same object, from near enough to another photograph?"
    )

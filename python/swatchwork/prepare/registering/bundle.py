# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""All poses at once, the mesh held fixed.

Unknown are each camera's pose, 6 numbers (the step of `moved`), and each track's point, which slides on the
mesh: 2 numbers in its tangent plane, and a third along the normal where the scan is said to have an error.
With residuals in standard deviations (s_o of a feature, in pixels),

    minimise  sum over sightings o of rho(|project(camera_f, x_t) - uv_o|) / s_o^2
              + sum over tracks t of (offset_t / scan_error)^2  + sum over frames of |extra_f(camera_f)|^2

where rho(e) = c^2 log(1 + e^2 / c^2) is Cauchy's loss, c = 1.5 px, as weights anew at each step. Steps are
Levenberg and Marquardt's (`sliding`). After each one points are put back onto the mesh, and only then is it
judged: it is kept where the objective is less, so the end is never worse than the start. At the bottom each
track may take up another place on the mesh, where one of its sightings' rays meets it by the poses found, if
that is better; then all goes on.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F64, Bool
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering.sighting import Sightings, first_points
from swatchwork.prepare.registering.sliding import Extra, Problem, State
from swatchwork.prepare.registering.tracks import Tracks, coarseness
from swatchwork.prepare.registering.view import View
from swatchwork.surface import RayScene

ROBUST_PX = 1.5
"""Where the loss turns from squares to logarithms. Tolerances are of photographs of the size that features
are sought in (`coarseness`)."""
OUTLIER = 3.0
"""A sighting farther than this many times the loss's turn from its point is an outlier."""
NEAR_PX = 6.0
"""How far off sightings are that count half where a track's first place is chosen."""
STEPS = 100
FALL = 0.01
"""A fall of the objective below this is the end of it: a tenth of a standard deviation of any pose."""
STILL_PX = 0.05
"""Where no step goes down, the bottom is reached if none would have moved images by more than this: a
triangle's edge under a point is a kink in the objective."""
TINY_PX = 1e-6
"""A shorter step is not tried."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """Poses refined together.

    Attributes:
        cameras: by frame.
        rms_px: of each frame's sightings that are no outliers; NaN without any.
        points: F64[T, 3] on the mesh (or off it within its error); NaN for tracks that fewer than two of the
            frames see, or none surely.
        history: the objective at the start and after each step kept.
        status: "converged", "iteration limit", or "no progress": none of the steps that the slope asks for
            made it better.
        outliers: Bool[O], which of the tracks' sightings are farther off than 4.5 px; sightings that were not
            used are none.
        used: Bool[O], which sightings had a part.
        deviation: of each frame's pose, F64[6] along the step of `moved` (radians, world units), as the
            residuals say, points and the other poses being free; infinite where nothing holds it.
    """

    cameras: dict[str, Camera]
    rms_px: dict[str, float]
    points: F64
    history: tuple[float, ...]
    status: str
    outliers: Bool
    used: Bool
    deviation: dict[str, F64]


def refine(
    scene: RayScene,
    views: Sequence[View],
    cameras: Mapping[str, Camera],
    tracks: Tracks,
    extra_terms: Sequence[Extra] = (),
    *,
    scan_error: float = 0.0,
    held: Collection[str] = (),
    steps: int = STEPS,
    robust_px: float = ROBUST_PX,
) -> Bundle:
    """Refine the poses of ``cameras`` on the mesh, the first of the scene's.

    Args:
        views: the photographs; each camera is of one of them.
        cameras: poses to start from, by the photograph's name.
        tracks: what they see of the object.
        extra_terms: further residuals that each frame's pose should make small.
        scan_error: standard deviation of the scan's surface along its normal, world units.
        held: frames that keep their pose.
        robust_px: where the loss turns from squares to logarithms.

    Raises:
        InputError: a camera of no photograph, an error of the scan below zero.
    """
    known = {view.name for view in views}
    for name in (*cameras, *held):
        if name not in known:
            raise InputError(f"there is a pose for {name!r}", expected="the name of one of the photographs")
    if not (np.isfinite(scan_error) and scan_error >= 0):
        raise InputError(f"the scan's error is {scan_error:g}", expected="zero or more, in the mesh's units")
    names = list(cameras)
    seen = Sightings.of(tracks, names)
    x, normal, sure = first_points(scene, list(cameras.values()), seen, NEAR_PX)
    seen = seen.only(sure)
    coarse = np.array([coarseness(camera) for camera in cameras.values()])
    problem = Problem(scene, names, seen, tuple(extra_terms), scan_error, frozenset(held), robust_px, coarse)
    start = State(list(cameras.values()), x[sure], normal[sure], np.zeros(int(sure.sum())))
    state, history, status = solved(problem, start, steps)
    again = relifted(problem, state)
    if status == "converged" and problem.objective(again) < history[-1] - FALL:
        state, more, status = solved(problem, again, steps)
        history += more

    error_px = np.hypot(*problem.errors(state).T)
    points = np.full((tracks.count, 3), np.nan)
    points[seen.track_number] = state.x
    used, outliers = np.zeros((2, len(tracks.track)), dtype=bool)
    used[seen.number], outliers[seen.number] = True, error_px > OUTLIER * problem.turn_px
    rms_px = {}
    for name, rows in zip(names, seen.rows, strict=True):
        good = error_px[rows][~outliers[seen.number[rows]]]
        rms_px[name] = float(np.sqrt((good**2).mean())) if len(good) else float("nan")
    # Residuals larger than stated (a scan's errors, features that follow highlights) make poses looser too.
    free = 2 * len(seen) - 2 * len(seen.track_number) - 6 * len(names)
    features_part = float(problem.losses_of_tracks(state).sum())
    excess = np.sqrt(max(1.0, features_part / free)) if free > 0 else 1.0
    return Bundle(
        dict(zip(names, state.cameras, strict=True)),
        rms_px,
        points,
        tuple(history),
        status,
        outliers,
        used,
        dict(zip(names, excess * problem.deviation(state), strict=True)),
    )


def relifted(problem: Problem, state: State) -> State:
    """The state with points lifted anew by its poses, where that is better."""
    x, normal, sure = first_points(problem.scene, state.cameras, problem.seen, NEAR_PX)
    other = State(
        state.cameras, np.where(sure[:, None], x, state.on_mesh), normal, np.zeros(len(state.offset))
    )
    loss, other_loss = problem.losses_of_tracks(state), problem.losses_of_tracks(other)
    better = sure & (other_loss < loss)
    return State(
        state.cameras,
        np.where(better[:, None], other.on_mesh, state.on_mesh),
        np.where(better[:, None], normal, state.normal),
        np.where(better, 0.0, state.offset),
    )


def solved(problem: Problem, state: State, steps: int) -> tuple[State, list[float], str]:
    """Levenberg and Marquardt's steps down, until they are small; the objective's history, and a status."""
    history, damping = [problem.objective(state)], 1e-4
    for _ in range(steps if problem.names else 0):
        system, asked_px = problem.linearised(state), 0.0
        while True:
            trial, length_px = problem.stepped(state, system, damping)
            asked_px = max(asked_px, length_px)
            value = problem.objective(trial)
            if value < history[-1]:
                break
            if length_px < TINY_PX or damping > 1e12:
                return state, history, "converged" if asked_px < STILL_PX else "no progress"
            damping *= 8
        state, damping = trial, max(damping / 5, 1e-9)
        history.append(value)
        if history[-2] - value < FALL:
            return state, history, "converged"
    return state, history, "iteration limit" if problem.names else "converged"

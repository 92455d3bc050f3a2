# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where to stand for the next photographs: suggested cameras, a page, and figures."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis import Criterion, Plan, Prior, Views, next_best_views, prior_of, uniform_views
from ..arrays import F64, unit
from ..capture import Camera, Capture, Frame, read_capture, write_capture
from ..errors import InputError, OutputError
from ..light import Environment, read_environment
from ..progress import SILENT, Progress
from ..reflectance import paper
from ..report import Figure, Picture, Section, Sheet, curve_plot, write_sheet
from ..simulate import random_directions
from .scenes import Object, candidate_directions, object_of, overview

CANDIDATES = 150
POINTS = 600
MOST = 60
"""Views at most, where a condition number is to be reached."""
RANDOM_TRIALS = 5


@dataclass(frozen=True)
class PlanSummary:
    """What is suggested, and what it brings."""

    cameras: str
    page: str
    views: int
    have: int
    left: tuple[float, ...]
    """Share of what was unknown, before the first and after each of the new views."""
    coverage: tuple[float, ...]
    """Share of the surface that can be seen, in some view."""
    condition: tuple[float | None, ...]
    """Condition number (n = 4) that 95 % of it stays below; None where there is none."""
    reached: bool | None
    """Whether the condition number asked for was reached; None where none was."""
    unseen: float
    """Share of the surface that no candidate view sees."""
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        last = self.condition[-1]
        seen = f"{100 * self.coverage[-1]:.0f} % of what can be seen is"
        text = f"{self.views} views in {self.cameras}: {seen}, "
        text += f"condition number {last:.0f}" if last is not None else "too few views for n = 4 in places"
        if self.reached is False:
            text += ", which is not as low as asked for"
        return f"{text}; {self.page} shows where to stand ({self.seconds:.0f} s)"


def plan_views(
    output: str | PathLike[str],
    *,
    mesh: str | PathLike[str] | None = None,
    shape: str | None = None,
    environment: Environment | None = None,
    views: int | None = None,
    condition: float | None = None,
    have: str | PathLike[str] | None = None,
    occluders: Sequence[str | PathLike[str]] = (),
    criterion: Criterion = "A",
    lowest_degrees: float = -90.0,
    distance: float = 4.0,
    size: int = 1024,
    candidates: int = CANDIDATES,
    seed: int = 0,
    progress: Progress = SILENT,
) -> PlanSummary:
    """Suggest where to photograph an object from.

    Args:
        output: folder of transforms.json (cameras without photographs) and plan.html.
        mesh: the object, or ``shape``; by default the one that ``have`` names.
        environment: the light; by default the first frame's of ``have``.
        views: how many more; or ``condition``, the number that 95 % of the surface is to stay below, at which
            it stops.
        have: transforms.json of photographs already taken; the plan goes on from them.
        occluders: meshes that block light and sight, such as a table.
        lowest_degrees: no camera below this elevation (world z is up).
        distance: of the cameras, in radii of the object, where nothing is at hand.
        size: of their square images in pixels.

    Raises:
        InputError: neither mesh, shape nor ``have``; no light; an impossible number.
        OutputError: the folder cannot be written.
    """
    start = time.perf_counter()
    _check(views, condition, lowest_degrees, distance, candidates)
    taken = read_capture(have, require_images=False) if have is not None else None
    thing, light = _given(mesh, shape, environment, taken, occluders, seed)
    at_hand = [frame.camera for frame in taken.frames] if taken else []
    if at_hand:
        away = [np.linalg.norm(camera.position - thing.centre) for camera in at_hand]
        distance = float(np.median(away)) / thing.radius
    directions = candidate_directions(candidates, lowest_degrees)
    cameras = [thing.camera(d, size, distance) for d in directions]
    cameras = [_like(camera, at_hand[0]) for camera in cameras] if at_hand else cameras
    V = len(cameras)
    with progress.stage("Casting rays"):
        seen_by = Views.of(thing.scene, thing.points, [*cameras, *at_hand], light, thing.sky)
    prior = prior_of(seen_by, paper(), progress)
    own, before = list(range(V)), list(range(V, V + len(at_hand)))
    most = views if views is not None else MOST
    found = next_best_views(
        prior,
        most,
        candidates=own,
        have=before,
        criterion=criterion,
        enough=condition,
        progress=progress,
    )
    if not found.chosen:
        raise InputError(
            f"the photographs at hand have a condition number of {found.condition[-1]:.0f} already",
            expected=f"a --condition below it, or --views; {condition:g} was asked for",
        )
    chosen = [cameras[v] for v in found.chosen]
    folder = Path(output)
    file = _write_cameras(folder, chosen)
    others = _others(prior, directions, V, before, len(found.chosen), seed)
    page = folder / "plan.html"
    taken_directions = unit(np.stack([c.position for c in at_hand]) - thing.centre) if at_hand else None
    sheet = _sheet(thing, prior, found, directions, before, taken_directions, others)
    write_sheet(page, sheet)
    finite = tuple(float(c) if np.isfinite(c) else None for c in found.condition)
    reached = None if condition is None else bool(found.condition[-1] <= condition)
    return PlanSummary(
        str(file),
        str(page),
        len(chosen),
        len(at_hand),
        tuple(map(float, found.left)),
        tuple(map(float, found.coverage)),
        finite,
        reached,
        float((~prior.seen.any(axis=1)).mean()),
        time.perf_counter() - start,
    )


def _check(
    views: int | None, condition: float | None, lowest: float, distance: float, candidates: int
) -> None:
    if (views is None) == (condition is None):
        raise InputError(
            "how many views is not said" if views is None else "both --views and --condition are given",
            expected="--views COUNT, or --condition NUMBER to stop at",
        )
    if views is not None and views < 1:
        raise InputError(f"--views is {views}", expected="1 or more")
    if condition is not None and not condition >= 1:
        raise InputError(f"--condition is {condition:g}", expected="1 or more, such as 30")
    if not -90 <= lowest < 90:
        raise InputError(f"--lowest is {lowest:g}", expected="degrees of elevation from -90 to below 90")
    if not distance > 1.05:
        raise InputError(f"--distance is {distance:g}", expected="more than 1.05 radii of the object")
    if candidates < 2:
        raise InputError(f"--candidates is {candidates}", expected="2 or more")


def _given(
    mesh: str | PathLike[str] | None,
    shape: str | None,
    environment: Environment | None,
    taken: Capture | None,
    occluders: Sequence[str | PathLike[str]],
    seed: int,
) -> tuple[Object, Environment]:
    """The object and its light, from what is said or from the photographs at hand."""
    if mesh is None and shape is None and taken is not None and taken.mesh_path is not None:
        mesh, occluders = taken.mesh_path, [*taken.occluder_paths, *occluders]
    thing = object_of(mesh, shape, occluders, POINTS, seed)
    if environment is None and taken is not None:
        source = taken.environment or taken.frames[0].environment
        environment = read_environment(source) if source is not None else None
    if environment is None:
        raise InputError(
            "no light is given",
            expected="--environment FILE --convention NAME, or --have with an environment",
        )
    return thing, environment


def _like(camera: Camera, other: Camera) -> Camera:
    """A camera's pose with another's lens."""
    return Camera(
        other.width,
        other.height,
        other.fx,
        other.fy,
        other.cx,
        other.cy,
        camera.world_from_camera,
        other.k1,
        other.k2,
        other.p1,
        other.p2,
    )


def _write_cameras(folder: Path, cameras: Sequence[Camera]) -> Path:
    names = [f"images/{i + 1:04d}.exr" for i in range(len(cameras))]
    frames = tuple(
        Frame(name, folder / name, None, 1.0, camera, None)
        for name, camera in zip(names, cameras, strict=True)
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made ({error.strerror})") from error
    return write_capture(Capture(folder, folder / "transforms.json", None, (), None, frames), folder)


def _others(
    prior: Prior, directions: F64, V: int, before: list[int], count: int, seed: int
) -> dict[str, F64]:
    """What is left after uniform and after random views from the same candidates (mean of some trials)."""
    uniform = uniform_views(directions, count)
    found = {"uniform": next_best_views(prior, 0, have=[*before, *uniform], trace=True).left[len(before) :]}
    trials = []
    for trial in range(RANDOM_TRIALS):
        d = directions @ random_directions(4 * count, seed + trial).T
        order = list(dict.fromkeys(int(v) for v in d.argmax(axis=0)))[:count]
        order += [v for v in range(V) if v not in order][: count - len(order)]
        trials.append(next_best_views(prior, 0, have=[*before, *order], trace=True).left[len(before) :])
    found["random"] = np.mean(trials, axis=0)
    return found


def _sheet(
    thing: Object,
    prior: Prior,
    found: Plan,
    directions: F64,
    before: list[int],
    taken: F64 | None,
    others: dict[str, F64],
) -> Sheet:
    chosen = directions[list(found.chosen)]
    k = len(chosen)
    steps = [float(i) for i in range(k + 1)]
    curves = {"planned": found.left, **others}
    left = curve_plot(
        {name: list(zip(steps, 100 * values, strict=True)) for name, values in curves.items()},
        x_label="new views",
        y_label="left unknown, %",
        logarithmic=False,
    )
    condition = curve_plot(
        {"planned": list(zip(steps, found.condition, strict=True))},
        x_label="new views",
        y_label="condition number",
    )
    coverage = curve_plot(
        {"planned": list(zip(steps, 100 * found.coverage, strict=True))},
        x_label="new views",
        y_label="seen, %",
        logarithmic=False,
    )
    none = np.zeros((0, 3))
    pictures = (
        Picture(
            "before: how much is unknown at each point, bright is all",
            overview(thing, found.unknown_before, 1.0, none, taken),
        ),
        Picture(
            f"after {k} more views, numbered in the order of use; grey ones were taken already",
            overview(thing, found.unknown_after, 1.0, chosen, taken),
        ),
    )
    rows = []
    for i, d in enumerate(chosen):
        azimuth, elevation = np.degrees(np.arctan2(d[1], d[0])), np.degrees(np.arcsin(np.clip(d[2], -1, 1)))
        number = found.condition[i + 1]
        rows.append(
            (
                str(i + 1),
                f"{azimuth:.0f}",
                f"{elevation:.0f}",
                f"{100 * found.coverage[i + 1]:.1f}",
                f"{number:.1f}" if np.isfinite(number) else "none yet",
                f"{100 * found.left[i + 1]:.1f}",
            )
        )
    hidden = float((~prior.seen.any(axis=1)).mean())
    last = found.condition[-1]
    return Sheet(
        title=f"Where to photograph {thing.name} from",
        summary=f"{k} more views, each the one that says most beyond those before it.",
        figures=(
            Figure(str(k), "more views", f"{len(before)} at hand" if before else ""),
            Figure(
                f"{100 * found.coverage[-1]:.0f} %",
                "of what can be seen is",
                f"{100 * hidden:.0f} % cannot be",
            ),
            Figure(
                f"{last:.0f}" if np.isfinite(last) else "none",
                "condition number",
                "95 % of the surface is below, n = 4",
            ),
        ),
        sections=(
            Section("Where to stand", "World z is up.", pictures),
            Section("What each view brings", plots=tuple(p for p in (left, condition, coverage) if p)),
            Section(
                "The views",
                "Azimuth from +x towards +y, and elevation, in degrees, about the object's centre.",
                head=("view", "azimuth", "elevation", "seen %", "condition", "left unknown %"),
                rows=tuple(rows),
            ),
        ),
        version=version("swatchwork"),
    )

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
from ..capture import Camera, Capture, EnvironmentSource, Frame, read_capture, write_capture, write_exr
from ..errors import InputError
from ..light import Environment, read_environment
from ..observe import Lights
from ..progress import SILENT, Progress
from ..reflectance import basis_by_name
from ..report import Figure, Html, Picture, Section, Sheet, curve_plot, write_sheet
from ..simulate import random_directions
from ..surface import write_mesh_obj
from .scenes import NONE, Object, candidate_directions, object_of, overview
from .together import files_together

CANDIDATES = 150
POINTS = 600
MOST = 60
"""Views at most, where a condition number is to be reached."""
MOST_CANDIDATES = 300
"""And views at hand: what is known of them takes 20 bytes a point and pair of them, 1.1 GB."""
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
    criterion: Criterion = "D",
    lowest_degrees: float = -90.0,
    distance: float = 4.0,
    size: int = 1024,
    candidates: int = CANDIDATES,
    basis: str = "extended",
    seed: int = 0,
    progress: Progress = SILENT,
) -> PlanSummary:
    """Suggest where to photograph an object from.

    Args:
        output: folder of transforms.json (cameras without photographs), mesh.obj, env.exr, plan.html.
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
    _free(Path(output), have)
    taken = read_capture(have, require_images=False) if have is not None else None
    thing, light = _given(mesh, shape, environment, taken, occluders, seed)
    at_hand = [frame.camera for frame in taken.frames] if taken else []
    if at_hand:
        away = [np.linalg.norm(camera.position - thing.centre) for camera in at_hand]
        distance = float(np.median(away)) / thing.radius
    directions = candidate_directions(candidates, lowest_degrees)
    if len(directions) < (views or 2) or len(directions) + len(at_hand) > MOST_CANDIDATES:
        raise InputError(
            f"{len(directions)} candidate views and {len(at_hand)} at hand",
            expected=f"at least the {views or 2} asked for, and at most {MOST_CANDIDATES} with those at hand",
            hint="Change --candidates, or lower --lowest",
        )
    cameras = [thing.camera(d, size, distance) for d in directions]
    cameras = [_like(camera, at_hand[0]) for camera in cameras] if at_hand else cameras
    V = len(cameras)
    with progress.stage("Casting rays"):
        lights = _lights_of(light, V, taken)
        seen_by = Views.of(thing.scene, thing.points, [*cameras, *at_hand], lights, thing.sky)
    prior = prior_of(seen_by, basis_by_name(basis), progress)
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
    others = _others(prior, directions, V, before, len(found.chosen), seed)
    taken_directions = unit(np.stack([c.position for c in at_hand]) - thing.centre) if at_hand else NONE
    sheet = _sheet(thing, prior, found, directions, before, taken_directions, others)
    with files_together(folder, "transforms.json") as made:
        _write(made, chosen, thing, light)
        write_sheet(made / "plan.html", sheet)
    finite = tuple(float(c) if np.isfinite(c) else None for c in found.condition)
    reached = None if condition is None else bool(found.condition[-1] <= condition)
    return PlanSummary(
        str(folder / "transforms.json"),
        str(folder / "plan.html"),
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
    if not -90 <= lowest <= 85:
        raise InputError(f"--lowest is {lowest:g}", expected="degrees of elevation from -90 to 85")
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


def _free(folder: Path, have: str | PathLike[str] | None) -> None:
    """Refuse a folder whose transforms.json is somebody's photographs."""
    file = folder / "transforms.json"
    mine = (folder / "plan.html").exists()
    same = have is not None and file.exists() and file.samefile(_file_of(have))
    if same or (file.exists() and not mine):
        raise InputError(
            "holds a transforms.json that is not a plan",
            file=folder,
            expected="a new folder, or that of an earlier plan",
            hint="Nothing was written: choose another --output",
        )


def _file_of(have: str | PathLike[str]) -> Path:
    path = Path(have)
    return path / "transforms.json" if path.is_dir() else path


def _lights_of(light: Environment, V: int, taken: Capture | None) -> Lights:
    """The light of the candidates, then that of each photograph at hand."""
    still = np.broadcast_to(np.eye(3), (V, 3, 3))
    of_all = np.zeros(V, np.int32)
    if taken is None:
        return Lights((light,), of_all, still.copy())
    own = Lights.of_capture(taken)
    return Lights(
        (light, *own.environments),
        np.concatenate([of_all, own.of_frame + 1]).astype(np.int32),
        np.concatenate([still, own.turn]),
    )


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


def _write(folder: Path, cameras: Sequence[Camera], thing: Object, light: Environment) -> None:
    """The cameras with object and light, so that other commands can go on from them."""
    names = [f"planned/{i + 1:04d}.exr" for i in range(len(cameras))]
    frames = tuple(
        Frame(name, folder / name, None, 1.0, camera, None)
        for name, camera in zip(names, cameras, strict=True)
    )
    mesh = folder / "mesh.obj"
    write_mesh_obj(mesh, thing.scene.meshes[0])
    write_exr(folder / "env.exr", light.radiance)
    source = EnvironmentSource(folder / "env.exr", light.convention, light.world_from_environment)
    write_capture(Capture(folder, folder / "transforms.json", mesh, (), source, frames), folder)


def _others(
    prior: Prior, directions: F64, V: int, before: list[int], count: int, seed: int
) -> dict[str, list[Plan]]:
    """What uniform and random views from the same candidates bring, view by view."""

    def traced(order: Sequence[int]) -> Plan:
        return next_best_views(prior, 0, have=[*before, *order], trace=True)

    trials = []
    for trial in range(RANDOM_TRIALS):
        d = directions @ random_directions(4 * count, seed + trial).T
        order = list(dict.fromkeys(int(v) for v in d.argmax(axis=0)))[:count]
        order += [v for v in range(V) if v not in order][: count - len(order)]
        trials.append(traced(order))
    return {"uniform": [traced([int(v) for v in uniform_views(directions, count)])], "random": trials}


def _sheet(
    thing: Object,
    prior: Prior,
    found: Plan,
    directions: F64,
    before: list[int],
    taken: F64,
    others: dict[str, list[Plan]],
) -> Sheet:
    chosen = directions[list(found.chosen)]
    k = len(chosen)
    steps = [float(i) for i in range(k + 1)]

    def curve(of: str, y_label: str, factor: float, logarithmic: bool) -> Html:
        curves = {"planned": getattr(found, of)}
        for name, plans in others.items():
            curves[name] = np.mean([getattr(plan, of)[len(before) :] for plan in plans], axis=0)
        return curve_plot(
            {name: list(zip(steps, factor * values, strict=True)) for name, values in curves.items()},
            x_label="new views",
            y_label=y_label,
            logarithmic=logarithmic,
        )

    plots = (
        curve("left", "left unknown, %", 100, False),
        curve("condition", "condition number", 1, True),
        curve("coverage", "seen, %", 100, False),
    )
    pictures = (
        Picture(
            "before: how much is unknown at each point, bright is all",
            overview(thing, found.unknown_before, 1.0, taken=taken),
        ),
        Picture(
            f"after {k} more views, numbered in the order of use, pale behind the object"
            + ("; grey ones were taken already" if len(taken) else ""),
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
                "95 % of what can be seen is below, n = 4",
            ),
        ),
        sections=(
            Section("Where to stand", "World z is up.", pictures),
            Section("What each view brings", plots=tuple(p for p in plots if p)),
            Section(
                "The views",
                "Azimuth from +x towards +y, and elevation, in degrees, about the object's centre.",
                head=("view", "azimuth", "elevation", "seen %", "condition", "left unknown %"),
                rows=tuple(rows),
            ),
        ),
        version=version("swatchwork"),
    )

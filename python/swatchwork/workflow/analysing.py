# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How many views suffice, and which light: the paper's section 5 for a capture, or for an object."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..analysis import (
    BLENDED,
    NOISE,
    Conditioning,
    Directions,
    Views,
    conditioning,
    next_best_views,
    prior_of,
    uniform_views,
)
from ..arrays import F64, unit
from ..capture import read_capture
from ..errors import InputError
from ..light import Environment
from ..observe import Lights
from ..progress import SILENT, Progress
from ..reflectance import basis_by_name
from ..report import Figure, Picture, Section, Sheet, curve_plot, write_sheet
from ..simulate import random_directions
from .planning import CANDIDATES
from .relighting import rotation_matrix
from .scenes import OVERVIEW_FROM, Object, candidate_directions, object_of, object_of_capture, overview

Arrangement = Literal["random", "uniform", "planned"]
COUNTS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100)
SHARE = 0.95
"""Of the points that some view sees; the worst of all is often a crease that two views graze."""
GOOD = 0.25
"""Standard deviation of a blend weight, from the noise, that 95 % of the points should stay below."""


@dataclass(frozen=True)
class ViewsRow:
    """What the first k views determine."""

    k: int
    coverage: float
    """Share of the points that some view of all sees, that these see."""
    rank_median: float
    rank_worst: int
    condition_median: float | None
    condition_most: float | None
    """That 95 % of the points stay below; None where fewer have n - 1 views."""
    condition_worst: float | None
    weight_error: float | None
    """Standard deviation of a blend weight, from the noise, that 95 % of the points stay below."""
    representative_rank: int


@dataclass(frozen=True)
class LightRow:
    """How one light suits the object."""

    light: str
    condition_median: float | None
    condition_most: float | None
    representative_rank: int


@dataclass(frozen=True)
class AnalysisSummary:
    """Figures by k, and by light where several were given."""

    object: str
    basis: str
    kernels: int
    points: int
    unseen: float
    """Share of the points that no view sees."""
    noise: float
    blended: int
    rows: tuple[ViewsRow, ...]
    lights: tuple[LightRow, ...]
    """The best first."""
    page: str | None
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        enough = [r.k for r in self.rows if r.weight_error is not None and r.weight_error <= GOOD]
        last = self.rows[-1]
        noise = f"{100 * self.noise:g} % of noise"
        if enough:
            text = f"with {enough[0]} views {noise} moves blend weights by less than {GOOD:g}"
        elif last.weight_error is not None:
            text = f"with {last.k} views {noise} moves blend weights by up to {last.weight_error:.2g}"
        else:
            fewer = f"fewer than {self.blended - 1} of them"
            text = f"with {last.k} views more than 5 % of the points are in {fewer}"
        if last.weight_error is not None:
            text += f" at 95 % of what is seen (n = {self.blended})"
        text += f"; representative rank {last.representative_rank} of {self.kernels}"
        if self.unseen > 0.005:
            text += f"; {100 * self.unseen:.1f} % of the surface is in no view"
        return text + f" ({self.seconds:.1f} s)"


def analyze_views(
    *,
    capture: str | PathLike[str] | None = None,
    mesh: str | PathLike[str] | None = None,
    shape: str | None = None,
    environments: Sequence[Environment] = (),
    names: Sequence[str] = (),
    directional: bool = False,
    rotations: int = 1,
    arrangement: Arrangement | None = None,
    views: int | None = None,
    occluders: Sequence[str | PathLike[str]] = (),
    basis: str = "extended",
    noise: float = NOISE,
    blended: int = BLENDED,
    seed: int = 0,
    page: str | PathLike[str] | None = None,
    progress: Progress = SILENT,
) -> AnalysisSummary:
    """Ranks and condition numbers of both optimisation matrices against k (section 5).

    Args:
        capture: its frames, mesh, occluders and light; or
        mesh: an object, or ``shape``, under ``environments`` (the first, where views are counted), or under a
            random directional light a view (``directional``).
        names: of the environments, for the table that compares them.
        rotations: each environment at so many angles about z: which suits the object best.
        arrangement: where the views of a mesh are, random by default; ``planned`` by next best view.
        views: at most so many; the capture's own number, or 20.
        noise: relative noise of a measurement: the tolerance of the ranks.
        blended: n, whose (n - 1)th singular value the condition number is taken at.
        page: an HTML page to write.

    Raises:
        InputError: what is needed is missing, or given twice.
    """
    start = time.perf_counter()
    if not 0 < noise < 1:
        raise InputError(f"--noise is {noise:g}", expected="a share between 0 and 1, such as 0.01")
    if blended < 2:
        raise InputError(f"--blended is {blended}", expected="2 or more: one weight needs no view")
    generic = basis_by_name(basis)
    seen, thing, frames = _views(
        capture, mesh, shape, environments, directional, arrangement, views, occluders, seed, progress
    )
    counts = [k for k in COUNTS if k < frames] + [frames]
    found = conditioning(seen, generic, counts, noise, blended, progress)
    rows = tuple(_row(found, i) for i in range(len(counts)))
    if not environments and rotations > 1:
        if directional:
            raise InputError("--rotations of a directional light", expected="an environment")
        environments, names = _own_light(seen), ["the capture's light"]
    lights = _lights(seen, generic.name, environments, names, rotations, noise, blended, progress)
    summary = AnalysisSummary(
        thing.name,
        generic.name,
        generic.kernels,
        len(thing.points),
        float((~seen.seen.any(axis=1)).mean()),
        noise,
        blended,
        rows,
        lights,
        str(page) if page is not None else None,
        time.perf_counter() - start,
    )
    if page is not None:
        write_sheet(Path(page), _sheet(summary, found, thing))
    return summary


def _views(
    capture: str | PathLike[str] | None,
    mesh: str | PathLike[str] | None,
    shape: str | None,
    environments: Sequence[Environment],
    directional: bool,
    arrangement: Arrangement | None,
    views: int | None,
    occluders: Sequence[str | PathLike[str]],
    seed: int,
    progress: Progress,
) -> tuple[Views, Object, int]:
    """The views to analyse, their object, and how many."""
    if mesh is not None and shape is not None:
        raise InputError("--mesh and --shape are given", expected="one of them")
    if directional and environments:
        raise InputError("--directional and --environment are given", expected="one of them")
    if capture is not None:
        if mesh is not None or shape is not None or directional or occluders:
            raise InputError(
                "a capture and an object are given", expected="a capture, or --mesh or --shape with a light"
            )
        if arrangement is not None:
            raise InputError(
                "--arrangement is given with a capture",
                expected="its own views",
                hint="`swatchwork plan --have` suggests more",
            )
        whole = read_capture(capture, require_images=False)
        read = whole.first(views) if views is not None else whole
        thing = object_of_capture(read, seed=seed)
        lights = Lights.of_capture(read) if not environments else environments[0]
        cameras = [frame.camera for frame in read.frames]
        return Views.of(thing.scene, thing.points, cameras, lights, thing.sky), thing, len(cameras)
    thing = object_of(mesh, shape, occluders, seed=seed)
    k = views or 20
    if directional:
        rng = np.random.default_rng([seed, 9])
        towards = unit(rng.normal(size=(k, 3)))
        light: Environment | Directions = Directions(towards)
    elif environments:
        light = environments[0]
    else:
        raise InputError(
            "no light is given", expected="--environment FILE --convention NAME, or --directional"
        )
    directions = _directions(thing, arrangement or "random", k, light, seed, progress)
    cameras = [thing.camera(d, 1024, 4.0) for d in directions]
    return Views.of(thing.scene, thing.points, cameras, light, thing.sky), thing, k


def _directions(
    thing: Object,
    arrangement: Arrangement,
    k: int,
    light: Environment | Directions,
    seed: int,
    progress: Progress,
) -> F64:
    if arrangement == "random":
        return random_directions(k, seed)
    candidates = candidate_directions(max(CANDIDATES, k), -90)
    if arrangement == "uniform":
        return np.asarray(candidates[uniform_views(candidates, k)])
    if isinstance(light, Directions):
        raise InputError("planned views under directional light", expected="an environment, or other views")
    cameras = [thing.camera(d, 1024, 4.0) for d in candidates]
    few = Object.of_mesh(thing.name, thing.scene.meshes[0], thing.scene.meshes[1:], 600, seed)
    prior = prior_of(
        Views.of(few.scene, few.points, cameras, light, few.sky), basis_by_name("paper"), progress
    )
    return np.asarray(candidates[list(next_best_views(prior, k, progress=progress).chosen)])


def _row(found: Conditioning, i: int) -> ViewsRow:
    ever = found.views[-1] > 0
    ranks, conditions = found.ranks[i][ever], found.conditions[i][ever]
    coverage = float((found.views[i][ever] > 0).mean()) if ever.any() else 0.0
    return ViewsRow(
        found.counts[i],
        coverage,
        float(np.median(ranks)) if len(ranks) else 0.0,
        int(ranks.min()) if len(ranks) else 0,
        _quantile(conditions, 0.5),
        _quantile(conditions, SHARE),
        _quantile(conditions, 1.0),
        _quantile(found.weight_errors[i][ever], SHARE),
        int(found.representative_ranks[i]),
    )


def _quantile(values: F64, share: float) -> float | None:
    """None where it is infinite, or there are no values."""
    if not len(values):
        return None
    found = float(np.quantile(values, share, method="higher"))
    return found if np.isfinite(found) else None


def _own_light(seen: Views) -> list[Environment]:
    """The one light of a capture; InputError where its frames have several, or one that turns."""
    lights = seen.lights
    assert isinstance(lights, Lights)
    if len(list(lights.groups())) > 1:
        raise InputError("--rotations: the light differs between frames", expected="--environment FILE")
    return [lights.of(0)]


def _lights(
    seen: Views,
    basis: str,
    environments: Sequence[Environment],
    names: Sequence[str],
    rotations: int,
    noise: float,
    blended: int,
    progress: Progress,
) -> tuple[LightRow, ...]:
    """Each environment at each rotation, for the same views; nothing where there is only one."""
    if len(environments) * rotations < 2:
        return ()
    k = seen.seen.shape[1]
    still = np.zeros(k, np.int32)
    rows = []
    for light, name in zip(environments, names, strict=True):
        for r in range(rotations):
            angle = 360 * r / rotations
            turn = np.broadcast_to(rotation_matrix(("z", angle)), (k, 3, 3)).copy()
            views = Views(seen.points, seen.sky, seen.seen, seen.viewer, Lights((light,), still, turn))
            found = conditioning(views, basis_by_name(basis), [k], noise, blended, progress)
            row = _row(found, 0)
            label = f"{name}, turned by {angle:.0f} degrees" if rotations > 1 else name
            rows.append(LightRow(label, row.condition_median, row.condition_most, row.representative_rank))
    return tuple(sorted(rows, key=_worse))


def _worse(row: LightRow) -> tuple[float, float]:
    most = np.inf if row.condition_most is None else row.condition_most
    return most, np.inf if row.condition_median is None else row.condition_median


def _sheet(summary: AnalysisSummary, found: Conditioning, thing: Object) -> Sheet:
    ks = [float(r.k) for r in summary.rows]

    def curve(name: str) -> list[tuple[float, float]]:
        values = [getattr(r, name) for r in summary.rows]
        return [(k, float("nan") if v is None else float(v)) for k, v in zip(ks, values, strict=True)]

    condition = curve_plot(
        {"median": curve("condition_median"), "95 % are below": curve("condition_most")},
        x_label="k, views",
        y_label="condition number",
    )
    ranks = curve_plot(
        {
            "blend, median": curve("rank_median"),
            "blend, worst": curve("rank_worst"),
            "representative": curve("representative_rank"),
        },
        x_label="k, views",
        y_label="rank",
        logarithmic=False,
    )
    spectrum = curve_plot(
        {
            f"k = {found.counts[i]}": [
                (float(j + 1), float(v / max(found.representative[i, 0], 1e-300)))
                for j, v in enumerate(found.representative[i])
                if v > 1e-6 * found.representative[i, 0]
            ]
            for i in sorted({0, len(ks) // 2, len(ks) - 1})
        },
        x_label="singular value",
        y_label="relative size",
    )
    rows = tuple(
        (
            str(r.k),
            f"{100 * r.coverage:.1f}",
            f"{r.rank_median:g}, {r.rank_worst}",
            _number(r.condition_median),
            _number(r.condition_most),
            _number(r.condition_worst),
            "none" if r.weight_error is None else f"{r.weight_error:.2f}",
            str(r.representative_rank),
        )
        for r in summary.rows
    )
    last = summary.rows[-1]
    sections = [
        Section(
            "Blends",
            f"The blend of a point needs rank {summary.blended - 1} for n = {summary.blended}; the condition "
            "number tells how much noise grows on its way into the weights.",
            _maps(found, thing),
            plots=tuple(p for p in (condition, ranks) if p),
        ),
        Section(
            "Representatives",
            f"All points together, {summary.kernels} kernels a channel. Beyond the rank, "
            f"{100 * summary.noise:g} % of noise drowns what tells kernels apart; non-negative weights and "
            "the sparse blend have to make up for it.",
            plots=(spectrum,) if spectrum else (),
        ),
        Section(
            "Figures",
            head=(
                "k",
                "seen %",
                "rank: median, worst",
                "condition: median",
                "95 %",
                "worst",
                "weight error",
                "representative rank",
            ),
            rows=rows,
        ),
    ]
    if summary.lights:
        sections.append(
            Section(
                "Which light",
                f"For the same {last.k} views, the best first.",
                head=("light", "condition: median", "95 %", "representative rank"),
                rows=tuple(
                    (
                        light.light,
                        _number(light.condition_median),
                        _number(light.condition_most),
                        str(light.representative_rank),
                    )
                    for light in summary.lights
                ),
            )
        )
    sentence = summary.in_words().rsplit(" (", 1)[0]
    return Sheet(
        title=f"How well {summary.object} is determined",
        summary=sentence[0].upper() + sentence[1:] + ".",
        figures=(
            Figure(str(last.k), "views"),
            Figure(_number(last.condition_most), "condition number", "95 % of what is seen is below"),
            Figure(f"{last.representative_rank} of {summary.kernels}", "representative rank"),
            Figure(f"{100 * summary.unseen:.1f} %", "of the surface is in no view"),
        ),
        sections=tuple(sections),
        version=version("swatchwork"),
    )


def _maps(found: Conditioning, thing: Object) -> tuple[Picture, ...]:
    """Each point's weight error with all views, from two sides."""
    error = np.minimum(found.weight_errors[-1], 1.0)
    shown = np.where(np.isfinite(error), error, 1.0)
    words = "how far noise moves the weights of each point, 0 (dark) to 1 or more (bright)"
    sides = (OVERVIEW_FROM, -OVERVIEW_FROM)
    captions = (words, "the same from the other side")
    return tuple(
        Picture(caption, overview(thing, shown, 1.0, side=side))
        for caption, side in zip(captions, sides, strict=True)
    )


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.1f}"

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The viewer's page: of a reconstruction that was just made, or of a material folder."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .. import report as page
from .. import viewer
from ..capture import Capture, read_capture
from ..errors import InputError
from ..light import Environment
from ..material import Material, expected_error, read_material
from ..observe.rendering import Lights
from ..progress import SILENT, Progress
from ..relight import RelitScene
from ..simulate import procedural_environment
from ..viewer import Light, Shot, TexelMap, ViewerScene, shot_of
from .pages import MADE_UP, spread
from .pictures import WORST
from .relighting import given_environment, occluder_meshes

VIEWER = "viewer.html"
SHOWN_SHOTS = 24
RESIDUAL = 0.3
"""Relative residual that the top colour of its map stands for."""


@dataclass(frozen=True)
class ViewSummary:
    """A page that was written, or found."""

    page: str
    megabytes: float
    lights: tuple[str, ...] | None
    """None of a page that was found: it is not read."""
    photographs: int | None
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        return f"{self.page} ({self.megabytes:.1f} MB), for any browser"


def view_folder(
    material_folder: str | PathLike[str],
    output: str | PathLike[str] | None = None,
    *,
    capture: str | PathLike[str] | None = None,
    lights: Sequence[str | PathLike[str]] = (),
    convention: str | None = None,
    progress: Progress = SILENT,
) -> ViewSummary:
    """The viewer of a material folder: the page that its reconstruction wrote, or a new one.

    Args:
        material_folder: as ``reconstruct_folder`` writes it.
        output: the page; by default ``viewer.html`` in the folder, which is made only where it is missing or
            ``capture`` or ``lights`` say what should be on it.
        capture: folder or transforms.json with the light and the photographs to show.
        lights: further HDR images, all of ``convention``.

    Raises:
        InputError: material, capture or a light is wrong, the viewer's script was not built, or ``output``
            is there and no viewer's page.
        OutputError: the page cannot be written.
    """
    start = time.perf_counter()
    folder = Path(material_folder)
    path = folder / VIEWER if output is None else Path(output)
    if convention is not None and not lights:
        raise InputError("--convention says how --light is read", expected="--light FILE too")
    if (
        output is None
        and capture is None
        and not lights
        and path.is_file()
        and (folder / "svbrdf.json").is_file()
    ):
        return ViewSummary(str(path), path.stat().st_size / 1e6, None, None, time.perf_counter() - start)
    viewer.check_replaceable(path)
    own = [Light.of(Path(f).name, _given(f, convention)) for f in lights]
    material = read_material(folder)
    taken = read_capture(capture) if capture is not None else None
    with progress.stage("shadows"):
        scene = RelitScene.of(material, occluder_meshes(taken) if taken else (), progress)
    with progress.stage("viewer"):
        found = viewer_of(
            folder.resolve().name, scene, material, taken, Lights.of_capture(taken) if taken else None, own
        )
        viewer.write_viewer(path, found)
    size = path.stat().st_size / 1e6
    names = tuple(light.name for light in found.lights)
    return ViewSummary(str(path), size, names, len(found.shots), time.perf_counter() - start)


def _given(file: str | PathLike[str], convention: str | None) -> Environment:
    found = given_environment(file, convention)
    assert found is not None
    return found


def viewer_of(
    title: str,
    scene: RelitScene,
    material: Material,
    capture: Capture | None = None,
    lights: Lights | None = None,
    further: Sequence[Light] = (),
) -> ViewerScene:
    """What the page of a material shows: its capture's lights and photographs, further lights, and maps."""
    shown: list[Light] = []
    shots: list[Shot] = []
    if capture is not None and lights is not None:
        many, verdicts = len(lights.environments) > 1, verdicts_of(material)
        for i, environment in enumerate(lights.environments):
            shown.append(Light.of(f"the capture's{f', {i + 1}' if many else ''}", environment))
        for i in spread(len(capture.frames), SHOWN_SHOTS):
            frame, light = capture.frames[i], int(lights.of_frame[i])
            white = 4 * float(lights.environments[light].mean_radiance.mean())
            turn = lights.turn[i] @ lights.environments[light].world_from_environment
            scale, left_out = verdicts.get(frame.name, (1.0, False))
            shot = shot_of(frame, white, light, turn, scale)
            shots.append(replace(shot, name=f"{frame.name} (left out)") if left_out else shot)
    shown += further
    shown += [Light.of(name, procedural_environment(kind, 0, height=64)) for name, kind in MADE_UP]
    return ViewerScene(
        title=title,
        scene=scene,
        lights=tuple(shown),
        shots=tuple(shots),
        maps=maps_of(material),
        colours=page.PALETTE,
        notes=notes_of(material),
        version=version("swatchwork"),
    )


def verdicts_of(material: Material) -> dict[str, tuple[float, bool]]:
    """By frame: what its radiance was divided by for the material, and whether it was left out.

    Empty of a material made before photographs were compared.
    """
    record = material.solver.get("photographs", {})
    return {
        frame["name"]: (frame["scale"] if frame["done"] == "scaled" else 1.0, frame["done"] == "left out")
        for frame in record.get("frames", ())
    }


def maps_of(material: Material) -> tuple[TexelMap, ...]:
    """Residual, error to expect, and photographs of each texel."""
    seen = material.coverage > 0
    maps = [TexelMap("residual", np.where(seen, material.residual, np.nan).astype(np.float32), RESIDUAL, "%")]
    if material.trust is not None:
        error = np.where(seen, expected_error(material), np.nan).astype(np.float32)
        maps.append(TexelMap("error to expect in another view", error, WORST, "%"))
    count = np.maximum(material.coverage, 0).astype(np.float32)
    maps.append(TexelMap("photographs of each point", count, float(max(count.max(), 1)), "photographs"))
    return tuple(maps)


def notes_of(material: Material) -> tuple[str, ...]:
    """How much of the surface each representative is, and how well it is known."""
    notes = []
    for i, share in enumerate(material.shares):
        note = f"representative {i + 1}: {100 * share:.0f} % of the surface"
        if material.spread is not None:
            note += f", known to {100 * material.spread[i]:.1f} %"
        notes.append(note)
    return tuple(notes)

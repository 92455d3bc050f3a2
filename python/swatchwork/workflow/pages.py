# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The report of a reconstruction: which pictures and figures go on the page."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from .. import report as page
from ..capture import Camera, Capture, Frame, read_photograph
from ..interreflection import IndirectShare
from ..light import Environment
from ..material import Material
from ..reconstruct import Reconstruction
from ..relight import RelitScene, render, see, shade
from ..simulate import procedural_environment
from ..streaming import Diagnosis
from .costs import StageCost
from .pictures import (
    ERROR_SCALE,
    alone,
    at_page_size,
    blend_picture,
    compare_pictures,
    coverage_picture,
    map_pictures,
    spheres,
    thinned,
    trust_picture,
)

SHOWN_VIEWS = 3
MADE_UP = (("a made-up room", "room"), ("a made-up sky", "sky"))
"""Lights that every material is shown under, beside its capture's."""
KINDS = {"exposure": "its exposure", "pose": "its pose", "light": "its light", "disagrees": "it disagrees"}
"""What is wrong with a photograph, in a word or two."""


def reconstruction_report(
    found: Reconstruction,
    capture: Capture,
    material: Material,
    costs: Sequence[StageCost],
    warnings: Sequence[str],
    summary: dict[str, Any],
) -> page.Report:
    """Everything the page of one reconstruction shows."""
    used = np.flatnonzero(~found.frames.left_out)
    chosen = [capture.frames[used[i]] for i in spread(len(used), SHOWN_VIEWS)]
    scene = relit(found)
    views, exposures = [], []
    for frame in chosen:
        photograph, camera = at_page_size(read_photograph(frame), frame.camera, found.mesh)
        light = environment_of(found, capture, frame)
        indirect = found.indirect and found.indirect.under(capture.frames.index(frame))
        rendered = render(scene, camera, light, samples=1, indirect=indirect)
        shown = photograph.radiance / np.float32(found.frames.scale[capture.frames.index(frame)])
        comparison, exposure = compare_pictures(
            frame.name, shown, photograph.alpha, rendered, valid=photograph.valid
        )
        views.append(comparison)
        exposures.append(exposure)
    first = views[0]
    photographs = _count(summary["views"], "photograph")
    small = thinned(material)
    return page.Report(
        title=capture.root.resolve().name,
        summary=f"{photographs} under known light, and what the object is made of.",
        hero=(
            page.Picture(f"one of {photographs}", first.reference.pixels),
            page.Picture("the material recovered from them", first.rendered.pixels),
        ),
        figures=headline(summary),
        warnings=tuple(warnings),
        views=tuple(views),
        error_scale=ERROR_SCALE,
        relit=under_other_lights(scene, camera),
        spheres=spheres(
            found.basis, material, chosen[0].camera, environment_of(found, capture, chosen[0]), exposures[0]
        ),
        blend_map=blend_picture(small),
        coverage=coverage_picture(small),
        coverage_note=coverage_note(summary),
        trust=trust_picture(material) if material.trust else None,
        photographs=photograph_rows(found.frames),
        photographs_doubt=found.frames.doubt,
        maps=map_pictures(small),
        trials=tuple(page.Trial(t.n, t.N, t.objective) for t in found.solution.history),
        chosen=(material.n, material.N),
        status=(
            f"{found.solution.status}; penalties lambda0 = {summary['lambda0']:.2g}, "
            f"lambda1 = {summary['lambda1']:.2g} (Eq. 5)."
        ),
        inputs=inputs(capture),
        settings=(
            ("basis", f"{summary['basis']}, {material.basis.kernels} kernels a channel"),
            ("atlas", f"{summary['resolution']} x {summary['resolution']}, {summary['texels']:,} texels"),
            *interreflections(summary),
            ("cores", str(os.cpu_count())),
        ),
        costs=tuple(page.StageCost(c.name, c.seconds, c.peak_mb) for c in costs),
        next_steps=next_steps(capture),
        version=version("swatchwork"),
    )


def coverage_note(summary: dict[str, Any]) -> str:
    """What share of the points has another's blend, and why."""
    unseen, undecided = (100 * summary[name] / summary["texels"] for name in ("unseen", "undecided"))
    notes = []
    if unseen:
        notes.append(
            f"{unseen:.1f} % of the points are in no photograph; their blend is the nearest other's."
        )
    if undecided:
        notes.append(
            f"At {undecided:.1f} % no two photographs agree, or there is but one: they count as in none, and "
            "have the blend of a neighbour that one agrees with, where there is one."
        )
    return " ".join(notes) or "Every point is in at least one photograph."


def under_other_lights(scene: RelitScene, camera: Camera) -> tuple[page.Picture, ...]:
    """The material from one camera under each of the made-up lights."""
    view = see(scene.rays, camera, samples=1)
    return tuple(
        alone(f"under {name}", shade(scene, view, procedural_environment(kind, 0, height=64)))
        for name, kind in MADE_UP
    )


def photograph_rows(frames: Diagnosis) -> tuple[page.PhotographRow, ...]:
    """Each photograph against the others, for the page; none where they could not be compared."""
    if not any(frame.points for frame in frames.frames):
        return ()
    done = [
        "left out" if out else f"scaled by 1 / {scale:.3g}" if scale != 1 else "kept" if frame.kind else ""
        for frame, out, scale in zip(frames.frames, frames.left_out, frames.scale, strict=True)
    ]
    return tuple(
        page.PhotographRow(
            frame.name, frame.scale, frame.misfit, KINDS.get(frame.kind, ""), what, bool(frame.points)
        )
        for frame, what in zip(frames.frames, done, strict=True)
    )


def interreflections(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """A row on light by way of the object itself, where that was asked for."""
    if summary["indirect"] is None:
        return []
    words = IndirectShare(**summary["indirect"]).in_words()
    return [("interreflections", f"{_count(summary['interreflections'], 'round')}; {words}")]


def relit(found: Reconstruction) -> RelitScene:
    """The reconstruction ready to render, with the shadows it was made with."""
    return RelitScene(
        mesh=found.mesh,
        rays=found.scene,
        basis=found.basis,
        representatives=found.solution.representatives,
        texel_of_pixel=found.blend.texel_of_pixel,
        index=found.blend.index,
        weight=found.blend.weight,
        sky=found.rendering.sky,
    )


def headline(summary: dict[str, Any]) -> tuple[page.Figure, ...]:
    """The cards at the top."""
    seconds = sum(stage["seconds"] for stage in summary["stages"])
    return (
        page.Figure(
            f"{100 * summary['misfit']:.1f} %", "misfit to the photographs", "RMS of the relative error"
        ),
        page.Figure(
            str(summary["N"]),
            "material" if summary["N"] == 1 else "materials",
            f"{summary['n']} blended at a point" if summary["n"] > 1 else "one at each point",
        ),
        page.Figure(
            str(summary["views"]),
            "photograph" if summary["views"] == 1 else "photographs",
            f"{summary['views_left_out']} more left out" if summary["views_left_out"] else "",
        ),
        page.Figure(
            f"{summary['texels']:,}", "surface points", f"atlas of {summary['resolution']} texels a side"
        ),
        page.Figure(f"{seconds:.0f} s", "altogether", f"{os.cpu_count()} cores, {summary['peak_mb']:.0f} MB"),
    )


def environment_of(found: Reconstruction, capture: Capture, frame: Frame) -> Environment:
    """The light of one of the capture's frames."""
    return found.rendering.lights.of(capture.frames.index(frame))


def inputs(capture: Capture) -> tuple[tuple[str, str], ...]:
    """What the capture consists of, in words."""
    sizes = sorted({(f.camera.width, f.camera.height) for f in capture.frames})
    pixels = ", ".join(f"{width} x {height}" for width, height in sizes)
    lights = {str(f.environment.file.name) for f in capture.frames if f.environment is not None}
    rows = [
        ("capture", capture.root.resolve().name),
        ("photographs", f"{len(capture.frames)}, {pixels} pixels"),
        ("mesh", capture.mesh_path.name if capture.mesh_path else "none"),
        ("light", ", ".join(sorted(lights))),
    ]
    if capture.occluder_paths:
        rows.append(("occluders", ", ".join(p.name for p in capture.occluder_paths)))
    return tuple(rows)


def next_steps(capture: Capture) -> tuple[tuple[str, str], ...]:
    """Commands that continue from here."""
    return (
        (
            "Render it from the capture's cameras, or any others, under the light they name:",
            f"swatchwork relight MATERIAL --cameras {capture.file.name} -o renders",
        ),
        (
            "Under a light of your own:",
            f"swatchwork relight MATERIAL --cameras {capture.file.name} "
            "--environment sky.exr --convention blender -o renders",
        ),
        ("Measure renders against photographs:", "swatchwork evaluate renders CAPTURE"),
    )


def spread(count: int, wanted: int) -> list[int]:
    """``wanted`` of ``count`` numbers, evenly, the first among them."""
    wanted = min(count, wanted)
    return [round(i * count / wanted) for i in range(wanted)]


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}" + ("" if count == 1 else "s")

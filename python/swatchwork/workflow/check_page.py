# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The page of a check: findings, the mesh over the photographs, the probe on a ball, coverage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..arrays import I64, U8, unit
from ..light import Environment
from ..report import Figure, Picture, Section, Sheet, crop_box, display, exposure_for, shrink
from ..surface import RayScene
from .check_light import balls
from .check_shapes import FrameShape
from .check_words import Finding
from .scenes import Object, overview

if TYPE_CHECKING:
    from .checking import CheckSummary

SHOWN = 24
"""Photographs on the page, the worst among them first."""
PICTURE_PX = 320
BALL_PX = 240
MESH, REGION = (240, 120, 20), (40, 150, 240)
"""Colours of the two outlines, RGB."""


def check_sheet(
    summary: CheckSummary,
    thing: Object,
    shapes: Sequence[FrameShape],
    light: Environment,
    counts: I64,
) -> Sheet:
    """Everything the page shows; ``counts`` [M] are the photographs that see each point."""
    wrong = sum(f.level != "note" for f in summary.findings)
    by_name = {shape.frame.name: shape for shape in shapes}
    sections = [_finding(i, f, by_name) for i, f in enumerate(summary.findings, 1)]
    if not sections:
        sections = [Section("Nothing looks wrong", "Look at the outlines below all the same.")]
    named = {name for f in summary.findings for name in f.frames}
    order = sorted(shapes, key=lambda s: (s.frame.name not in named, s.iou if s.iou is not None else 0.5))
    shown = order[:SHOWN]
    more = f" The worst {SHOWN} of {len(shapes)} are shown." if len(shapes) > SHOWN else ""
    sections += [
        Section(
            "Mesh over photographs",
            "Orange: the mesh, from the frame's camera. Blue: the object by alpha or mask. They should "
            "lie on "
            "each other within a pixel or two." + more,
            tuple(Picture(_caption(s), overlay(s)) for s in shown),
        ),
        _probe(shapes[0], light, summary.albedo),
        _coverage(summary, thing, shapes, counts),
        Section(
            "The photographs",
            "IoU: intersection over union of the mesh's silhouette with alpha or mask. Exposure: "
            "brightness over "
            "the other photographs', the median over shared points.",
            head=("photograph", "IoU", "exposure", "of the surface, %"),
            rows=tuple(
                (
                    f.name,
                    f"{f.iou:.3f}" if f.iou is not None else "not judged",
                    f"{f.exposure:.2f}" if f.exposure is not None else "not judged",
                    f"{100 * f.seen:.0f}",
                )
                for f in summary.frames
            ),
        ),
    ]
    judged = [f.iou for f in summary.frames if f.iou is not None]
    words = {0: "Nothing looks wrong.", 1: "One thing looks wrong."}.get(wrong, f"{wrong} things look wrong.")
    return Sheet(
        title=f"Check of {Path(summary.capture).resolve().name}",
        summary=words,
        figures=(
            Figure(str(wrong), "things look wrong" if wrong != 1 else "thing looks wrong"),
            Figure(
                f"{np.median(judged):.3f}" if judged else "not judged",
                "median silhouette IoU",
                f"{len(judged)} of {len(shapes)} photographs",
            ),
            Figure(
                f"{100 * summary.albedo:.0f} %" if summary.albedo is not None else "not judged",
                "of the light is reflected",
                "2 to 100 % is plausible",
            ),
            Figure(
                f"{100 * summary.coverage[2]:.0f} %",
                "of the surface in 2 or more",
                f"{100 * summary.coverage[0]:.0f} % in none",
            ),
            Figure(f"{summary.distance:.3g}", "radii to the cameras", "1.2 to 50 is plausible"),
        ),
        sections=tuple(sections),
        version=version("swatchwork"),
    )


def _finding(number: int, finding: Finding, shapes: dict[str, FrameShape]) -> Section:
    text = f"{finding.text} What to do: {finding.advice}"
    return Section(f"{number}. {finding.title}", text, _illustrated(finding, shapes))


def _illustrated(finding: Finding, shapes: dict[str, FrameShape]) -> tuple[Picture, ...]:
    """Two pictures of what is found: of both frames, or of the one beside another, or beside itself."""
    named = [shapes[name] for name in finding.frames if name in shapes]
    # A note about many photographs is not illustrated by two of them.
    if not named or finding.level == "note":
        return ()
    if finding.kind == "exposure of a frame":
        others = [shape for name, shape in shapes.items() if name not in finding.frames]
        pair = [*named, *others][:2]
        exposure = _exposure(pair[-1])
        return tuple(
            Picture(f"{s.frame.name}, at one exposure", overlay(s, exposure, outlined=False)) for s in pair
        )
    if len(named) > 1:
        return tuple(Picture(_caption(s), overlay(s)) for s in named[:2])
    plain = Picture("the photograph alone", overlay(named[0], outlined=False))
    return (Picture(_caption(named[0]), overlay(named[0])), plain)


def _caption(shape: FrameShape) -> str:
    figure = f"IoU {shape.iou:.3f}" if shape.iou is not None else "neither alpha nor mask"
    return f"{shape.frame.name}: {figure}"


def _exposure(shape: FrameShape) -> float:
    """The factor that shows a photograph's object well."""
    inside = shape.region if shape.region is not None and shape.region.any() else shape.silhouette
    return exposure_for(shape.radiance, inside.astype(np.float32))


def shown_part(shape: FrameShape) -> tuple[slice, slice]:
    """Rows and columns of the reduced picture that `overlay` shows."""
    around = shape.silhouette if shape.region is None else shape.silhouette | shape.region
    return crop_box(around.astype(np.float32), 0.12)


def overlay(shape: FrameShape, exposure: float | None = None, outlined: bool = True) -> U8:
    """The photograph around the object, with both outlines [H, W, 3], enlarged to a common size."""
    rows, columns = shown_part(shape)
    shown = display(shape.radiance, None, _exposure(shape) if exposure is None else exposure)
    pixels = shown[rows, columns, :3]
    scale = PICTURE_PX / max(pixels.shape[:2])
    size = (max(1, round(pixels.shape[1] * scale)), max(1, round(pixels.shape[0] * scale)))
    canvas = np.ascontiguousarray(cv2.resize(pixels, size, interpolation=cv2.INTER_LINEAR))
    for mask, colour in ((shape.region, REGION), (shape.silhouette, MESH)):
        if mask is None or not outlined:
            continue
        part = mask[rows, columns].astype(np.uint8)
        large = cv2.resize(part * 255, size, interpolation=cv2.INTER_LINEAR) > 127
        lines, _ = cv2.findContours(large.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(canvas, lines, -1, colour, 1, cv2.LINE_AA)
    return np.asarray(canvas, dtype=np.uint8)


def _probe(first: FrameShape, light: Environment, albedo: float | None) -> Section:
    mirror, grey, alpha = balls(light, first.camera, BALL_PX)
    inside = first.region if first.region is not None and first.region.any() else first.silhouette
    # One exposure, so that the eye compares brightness too.
    exposure = exposure_for(grey, alpha, key=0.7)
    rows, columns = crop_box(inside.astype(np.float32))
    photograph = shrink(display(first.radiance, None, exposure)[rows, columns], BALL_PX)
    text = (
        f"All three at one exposure, as the camera of {first.frame.name} sees them. Lamps and windows in the "
        "mirror should be where the object's highlights say; the grey ball (half of the light reflected) "
        "should be lit from the same side as the object."
    )
    if albedo is not None:
        text += f" The object reflects {100 * albedo:.0f} % of the light, by its mean radiance."
    return Section(
        "The light",
        text,
        (
            Picture("the probe on a mirror ball", display(mirror, alpha, exposure)),
            Picture("on a grey ball", display(grey, alpha, exposure)),
            Picture(first.frame.name, photograph),
        ),
    )


def _coverage(summary: CheckSummary, thing: Object, shapes: Sequence[FrameShape], counts: I64) -> Section:
    top = float(max(counts.max(), 1))
    stand = unit(np.stack([s.frame.camera.position for s in shapes]) - thing.centre)
    # Half a turn about x shows the other side and the underside.
    turn = np.diag([1.0, -1.0, -1.0])
    mesh, points = thing.scene.meshes[0], thing.points
    over = Object(
        thing.name,
        RayScene([replace(mesh, vertices=mesh.vertices @ turn)]),
        replace(points, position=points.position @ turn),
    )
    values, none_new = counts.astype(np.float64), np.zeros((0, 3))
    none, one, more = (100 * share for share in summary.coverage)
    return Section(
        "Coverage",
        f"{none:.0f} % of the surface is in no photograph, {one:.0f} % in one, {more:.0f} % in two or more.",
        (
            Picture(
                f"photographs of each point, 0 (dark) to {top:.0f}; grey dots are cameras",
                overview(thing, values, top, none_new, stand),
            ),
            Picture(
                "the other side, turned over about the x axis",
                overview(over, values, top, none_new, stand @ turn),
            ),
        ),
    )

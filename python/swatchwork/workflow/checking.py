# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whether mesh, photographs, poses, probe and exposures of a capture agree: findings, figures, a page."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from os import PathLike
from typing import Any

import numpy as np

from ..capture import read_capture, read_photograph
from ..observe import Lights
from ..progress import SILENT, Progress
from ..report import write_sheet
from ..surface import points_in_sight
from .check_light import Exposures, exposures, mirrored_radiance, sampled, white_radiance
from .check_page import check_sheet
from .check_places import findings_on_shape
from .check_shapes import frame_shape
from .check_words import Finding, findings_on_coverage, findings_on_light
from .scenes import object_of_capture

POINTS = 1000
"""That stand for the surface."""
GLOBAL = ("units", "mirrored mesh", "turned mesh", "mesh does not fit")
"""Findings with which nothing that rests on the mesh's place can be judged."""


@dataclass(frozen=True)
class FrameCheck:
    """Figures on one photograph; None where they cannot be had."""

    name: str
    iou: float | None
    """Of the mesh's silhouette with alpha or mask."""
    exposure: float | None
    """Brightness over the other photographs', at shared points."""
    seen: float
    """Share of the surface that it shows."""


@dataclass(frozen=True)
class CheckSummary:
    """What was found, the weightiest first."""

    capture: str
    page: str
    findings: tuple[Finding, ...]
    frames: tuple[FrameCheck, ...]
    albedo: float | None
    """Mean radiance of the object over that of a white matte one in the same light."""
    coverage: tuple[float, float, float]
    """Shares of the surface in no, one, and two or more photographs."""
    distance: float
    """Median distance of the cameras, in radii of the object."""
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """Lines for a person."""
        end = f"{self.page} shows it ({self.seconds:.0f} s)"
        if not self.findings:
            return f"Nothing looks wrong with {self.capture}; {end}"
        lines = []
        for number, finding in enumerate(self.findings, 1):
            lines.append(f"{number}. {finding.title} ({finding.level})")
            lines.append(f"   {finding.text}")
            lines.append(f"   What to do: {finding.advice}")
        return "\n".join([*lines, end])


def check_capture(
    capture_folder: str | PathLike[str],
    page: str | PathLike[str],
    *,
    progress: Progress = SILENT,
) -> CheckSummary:
    """Look for what is wrong with a capture, and write the page that shows it.

    Symmetric objects hide swaps and mirrors: a sphere's silhouette is the same from everywhere.

    Raises:
        InputError: the capture, its mesh, its light or a photograph cannot be read.
        OutputError: the page cannot be written.
    """
    start = time.perf_counter()
    capture = read_capture(capture_folder)
    thing = object_of_capture(capture, POINTS)
    lights = Lights.of_capture(capture)
    of_frame = [lights.of(i) for i in range(len(capture.frames))]
    shapes, seen, radiance = [], [], []
    with progress.stage("Comparing photographs with the mesh", len(capture.frames)) as task:
        for frame in capture.frames:
            photograph = read_photograph(frame)
            shapes.append(frame_shape(frame, photograph, thing.scene))
            seen.append(points_in_sight(thing.scene, thing.points, frame.camera))
            radiance.append(sampled(photograph, frame.camera, thing.points, seen[-1]))
            task.advance()
    visible, values = np.stack(seen), np.stack(radiance)
    names = [frame.name for frame in capture.frames]
    with progress.stage("Looking for what is wrong"):
        findings = findings_on_shape(thing.scene.meshes[0], shapes, [int(s.sum()) for s in seen])
        found = Exposures(None, np.full(len(names), np.nan), np.zeros(len(names), bool))
        counts = visible.sum(axis=0)
        shares = tuple(float(m.mean()) for m in (counts == 0, counts == 1, counts >= 2))
        coverage = (shares[0], shares[1], shares[2])
        if not any(f.kind in GLOBAL for f in findings):
            # What is sampled through a wrong pose is no exposure.
            misplaced = {name for f in findings for name in f.frames}
            values[[name in misplaced for name in names]] = np.nan
            found = exposures(
                values,
                white_radiance(of_frame, thing.points, thing.sky),
                mirrored_radiance(of_frame, [f.camera for f in capture.frames], thing.points),
            )
            findings += findings_on_light(names, found)
            findings += findings_on_coverage(coverage, shapes)
    centre, radius = thing.centre, thing.radius
    away = [float(np.linalg.norm(f.camera.position - centre)) / radius for f in capture.frames]
    frames = tuple(
        FrameCheck(
            shape.frame.name,
            shape.iou,
            float(factor) if np.isfinite(factor) else None,
            float(mask.mean()),
        )
        for shape, factor, mask in zip(shapes, found.factor, seen, strict=True)
    )
    summary = CheckSummary(
        str(capture_folder),
        str(page),
        tuple(findings),
        frames,
        found.albedo,
        coverage,
        float(np.median(away)),
        time.perf_counter() - start,
    )
    write_sheet(page, check_sheet(summary, thing, shapes, of_frame[0], counts))
    return summary

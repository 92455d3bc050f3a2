# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The page of a registration: the mesh over each photograph, and figures of merit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..report import Figure, Picture, Section, Sheet
from .check_page import overlay
from .check_shapes import FrameShape

if TYPE_CHECKING:
    from .preparing_register import RegisteredPhotograph, RegisterSummary

UNKNOWN = "not known"


def register_sheet(
    summary: RegisterSummary, shapes: Sequence[FrameShape], missing: Mapping[str, str]
) -> Sheet:
    """Everything the page shows; ``shapes`` are of the photographs placed, in order."""
    placed = summary.photographs
    count = len(placed) + len(missing)
    suspicious = [Section("What to look at", " ".join(_sentence(s) for s in summary.suspicions))]
    lost = [Section("Not placed", head=("photograph", "why"), rows=tuple(missing.items()))]
    return Sheet(
        title=f"Registration of {Path(summary.capture).name}",
        summary=f"{len(placed)} of {count} photographs are placed in the mesh's world.",
        figures=(
            Figure(f"{len(placed)} / {count}", "photographs placed"),
            Figure(
                _px([p.features_px for p in placed]), "points shared by photographs", "median of their rms"
            ),
            Figure(_px([p.pairs_px for p in placed]), "clicked pairs", "median of their rms"),
            Figure(_iou([p.iou for p in placed]), "median silhouette IoU"),
        ),
        sections=(
            *(suspicious if summary.suspicions else []),
            *(lost if missing else []),
            Section(
                "Mesh over photographs",
                "Orange: the mesh, from the pose found. Blue: the object by mask or alpha. They should lie "
                "on each other within a pixel or two.",
                tuple(Picture(_caption(p), overlay(s)) for p, s in zip(placed, shapes, strict=True)),
            ),
            Section(
                "The photographs",
                "Rms distances in pixels. Known to: standard deviations of the camera's direction, and of "
                "its place over the distance to the object, as the residuals say.",
                head=("photograph", "placed by", "pairs", "shared points", "their rms", "IoU", "known to"),
                rows=tuple(_row(p) for p in placed),
            ),
        ),
        version=version("swatchwork"),
    )


def _sentence(words: str) -> str:
    return words if words.endswith((".", "?")) else words + "."


def _caption(p: RegisteredPhotograph) -> str:
    return f"{p.name}: IoU {p.iou:.3f}" if p.iou is not None else p.name


def _row(p: RegisteredPhotograph) -> tuple[str, ...]:
    left = f", {len(p.pairs_left_out)} left out" if p.pairs_left_out else ""
    known = (
        f"{p.degrees:.3f}°, {100 * p.share:.2f} %" if p.degrees is not None and p.share is not None else ""
    )
    return (
        p.name,
        p.placed_by,
        f"{p.pairs_px:.2f} px{left}" if p.pairs_px is not None else "none",
        str(p.features),
        f"{p.features_px:.2f} px" if p.features_px is not None else "",
        f"{p.iou:.3f}" if p.iou is not None else UNKNOWN,
        known or UNKNOWN,
    )


def _px(values: Sequence[float | None]) -> str:
    known = [v for v in values if v is not None]
    return f"{np.median(known):.2f} px" if known else "none"


def _iou(values: Sequence[float | None]) -> str:
    known = [v for v in values if v is not None]
    return f"{np.median(known):.3f}" if known else UNKNOWN

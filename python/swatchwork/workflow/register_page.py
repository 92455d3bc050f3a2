# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The page of a registration: the mesh over each photograph, and figures of merit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ..arrays import F64, U8
from ..prepare.registering import Pairs
from ..report import Figure, Picture, Section, Sheet
from .check_page import overlay, shown_part
from .check_shapes import FrameShape

if TYPE_CHECKING:
    from .preparing_register import RegisteredPhotograph, RegisterSummary

BEYOND_PX = 1e5
"""What is farther outside the picture is not drawn: OpenCV counts with 32 bits."""
UNKNOWN = "not known"
AGREES, LEFT_OUT = (60, 220, 90), (240, 50, 60)
"""Colours of pairs, RGB."""
CROSS_PX, RING_PX = 4, 5
FINE = 4
"""Bits of a pixel's fraction that OpenCV draws with."""


def register_sheet(
    summary: RegisterSummary,
    shapes: Sequence[FrameShape],
    missing: Mapping[str, str],
    pairs: Mapping[str, Pairs],
) -> Sheet:
    """Everything the page shows; ``shapes`` are of the photographs placed, in order; ``pairs`` by name."""
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
                "on each other within a pixel or two. Where pairs were clicked, a cross is the click and a "
                "ring the mesh's point: green where they agree, red where the pair is left out.",
                tuple(
                    Picture(_caption(p), _with_pairs(s, pairs.get(p.name), p.pairs_left_out))
                    for p, s in zip(placed, shapes, strict=True)
                ),
            ),
            Section(
                "The photographs",
                "Rms distances in pixels. Known to: standard deviations of the camera's direction, and of "
                "its place over the distance to the object, as the residuals say.",
                head=(
                    "photograph",
                    "placed by",
                    "board",
                    "pairs",
                    "shared points",
                    "their rms",
                    "IoU",
                    "known to",
                ),
                rows=tuple(_row(p) for p in placed),
            ),
        ),
        version=version("swatchwork"),
    )


def _sentence(words: str) -> str:
    return words if words.endswith((".", "?")) else words + "."


def _caption(p: RegisteredPhotograph) -> str:
    return f"{p.name}: IoU {p.iou:.3f}" if p.iou is not None else p.name


def _with_pairs(shape: FrameShape, pairs: Pairs | None, left_out: Sequence[int]) -> U8:
    """The overlay [H, W, 3] with a cross at each click, a ring at the mesh's point, and a line between."""
    canvas = np.ascontiguousarray(overlay(shape))
    if pairs is None:
        return canvas
    rows, columns = shown_part(shape)
    full, small = shape.frame.camera, shape.camera
    corner = np.array([columns.start, rows.start])
    part = np.array([columns.stop, rows.stop]) - corner
    enlarged = np.array(canvas.shape[1::-1]) / part
    clicks = (pairs.uv_px * [small.width / full.width, small.height / full.height] - corner) * enlarged
    clicks = clicks.clip(-BEYOND_PX, BEYOND_PX)
    points = (small.project(pairs.x_in_world)[0] - corner) * enlarged
    for number, (click, point) in enumerate(zip(clicks, points, strict=True), 1):
        colour = LEFT_OUT if number in left_out else AGREES
        for way in ((1, 1), (1, -1)):
            arm = CROSS_PX * np.array(way) / np.sqrt(2)
            cv2.line(canvas, _fine(click - arm), _fine(click + arm), colour, 1, cv2.LINE_AA, FINE)
        if np.isfinite(point).all() and np.abs(point).max() < BEYOND_PX:
            cv2.circle(canvas, _fine(point), RING_PX << FINE, colour, 1, cv2.LINE_AA, FINE)
            cv2.line(canvas, _fine(click), _fine(point), colour, 1, cv2.LINE_AA, FINE)
    return canvas


def _fine(at: F64) -> tuple[int, int]:
    """OpenCV's whole number of sixteenths; its pixel centres are at whole pixels."""
    u, v = np.round((at - 0.5) * (1 << FINE)).astype(int)
    return int(u), int(v)


def _row(p: RegisteredPhotograph) -> tuple[str, ...]:
    left = f", {len(p.pairs_left_out)} left out" if p.pairs_left_out else ""
    known = (
        f"{p.degrees:.3f}°, {100 * p.share:.2f} %" if p.degrees is not None and p.share is not None else ""
    )
    return (
        p.name,
        p.placed_by,
        f"{p.board_px:.2f} px" if p.board_px is not None else "none",
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

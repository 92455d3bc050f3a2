# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The page on a light probe: the ball with its outline, the map, and the map seen on the ball."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np

from ..arrays import U8, Bool
from ..prepare.panorama import Mirror, View
from ..prepare.probe import Probe, rerender
from ..report import Figure, Picture, Section, Sheet, display, heat, relative_error, shrink

SHOWN_PX = 700


def probe_sheet(
    views: Sequence[View], probe: Probe, mirror: Mirror, text: str, world: str, filled: str
) -> Sheet:
    """The page.

    Args:
        text: what is to be known of the map, in words.
        world: which axes its directions are in.
        filled: how what is unseen was filled.
    """
    environment = probe.environment
    radiance = environment.radiance
    # White at the brightest tenth: lamps are to burn out, the room is to be seen.
    exposure = 0.8 / max(float(np.quantile(radiance.max(axis=-1), 0.9)), 1e-12)
    flags = display(radiance, None, exposure)[..., :3]
    flags[probe.unseen > 0] = (90, 90, 200)
    flags[probe.clipped > 0.5] = (230, 40, 40)
    maps = (
        Picture("the probe", display(radiance, None, exposure)),
        Picture("blue: not seen by any view, filled in; red: clipped, at least as bright", flags),
    )
    sections = [Section("The probe", f"{environment.convention}; world: {world}.", maps)]
    for view, turn, nrms in zip(views, probe.world_from_cameras, probe.rerendered, strict=True):
        on = view.on_ball()
        rendered = rerender(view, probe.environment, turn, mirror)
        bright = 0.8 / max(float(np.quantile(view.radiance[on].max(axis=-1), 0.9)), 1e-12)
        box = _box(on)
        error = relative_error(rendered, view.radiance, on)
        pictures = (
            Picture("the photograph; green: the outline used", _outlined(view, bright)[box]),
            Picture("the probe, seen on the ball", display(rendered, on.astype(float), bright)[box]),
            Picture("difference, white is the photograph's RMS", heat(error, on, 1.0)[box]),
        )
        small = tuple(Picture(p.caption, shrink(p.pixels, SHOWN_PX)) for p in pictures)
        words = f"The probe on the ball differs from the photograph by {100 * nrms:.1f} % (NRMS)."
        sections.append(Section(Path(view.name).name, words, small))
    worst = max(view.outline.residual_px for view in views)
    agreements = [a.nrms for a in probe.agreements if a.nrms is not None]
    figures = [
        Figure(f"{worst:.2f} px", "outline", "RMS distance of the edges from it"),
        Figure(f"{100 * probe.unseen_sr / (4 * np.pi):.2f} %", "of the sphere unseen", filled),
        Figure(f"{100 * probe.clipped_share:.3g} %", "of the sphere clipped"),
    ]
    if agreements:
        figures.append(Figure(f"{100 * max(agreements):.0f} %", "views differ", "NRMS where both see"))
    return Sheet(
        "Light probe from a mirror ball", text, tuple(figures), tuple(sections), version("swatchwork")
    )


def _outlined(view: View, exposure: float) -> U8:
    shown = np.ascontiguousarray(display(np.nan_to_num(view.radiance), None, exposure)[..., :3])
    points = np.round((view.outline.ball.outline() - 0.5) * 16).astype(np.int32)
    cv2.polylines(shown, [points], True, (40, 230, 40), 1, cv2.LINE_AA, 4)
    return shown


def _box(on: Bool) -> tuple[slice, slice]:
    rows, columns = np.nonzero(on)
    margin = round(0.08 * np.ptp(rows)) + 2
    return (
        slice(max(0, rows.min() - margin), rows.max() + margin),
        slice(max(0, columns.min() - margin), columns.max() + margin),
    )

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Warnings about what a reconstruction found: legal, but worth a look."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..capture import Capture
from ..errors import CaptureWarning
from ..material import Material, normal_albedo
from ..reconstruct import Reconstruction

BRIGHTEST_ALBEDO = 1.05
"""Directional albedo at normal incidence above which exposures are in doubt; the excess is room for noise."""

CARRIED_SHARE = 0.01
"""Share of the blend weight from which a representative counts: rare ones rest on too few measurements."""


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """CaptureWarnings given within, in words and without repeats; they go on to whoever listened before."""
    said: list[str] = []
    with warnings.catch_warnings():
        listener = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any) -> None:
            if issubclass(category, CaptureWarning) and str(message) not in said:
                said.append(str(message))
            listener(message, category, *rest)

        warnings.showwarning = show  # type: ignore[assignment]
        yield said


def warn_of_bright_materials(material: Material, capture: Capture) -> None:
    """Warn of representatives that reflect more light than they receive.

    Warns:
        CaptureWarning: some representative that carries at least 1 % of the blend weight has a directional
            albedo at normal incidence above 1.05 in a channel.
    """
    share = material.shares
    albedo = np.einsum("j,njc->nc", normal_albedo(material.basis), material.representatives)
    bright = np.flatnonzero((share >= CARRIED_SHARE) & (albedo.max(axis=1) > BRIGHTEST_ALBEDO))
    if len(bright):
        each = ", ".join(
            f"{i + 1} (albedo {albedo[i].max():.2f}, {100 * share[i]:.0f} % of it)" for i in bright
        )
        message = (
            f"{capture.file}: the object reflects more light at normal incidence than it receives: "
            f"representative {each}; expected albedos up to 1. Check that photographs and environment have "
            "one exposure and unit: the frames' exposure values, and the light probe's scale and its sun."
        )
        warnings.warn(CaptureWarning(message), stacklevel=3)


def left_out_by_frame(found: Reconstruction) -> dict[str, Any]:
    """For svbrdf.json: the share of each frame's measurements left out, where outliers were found.

    None for a frame that was left out altogether.
    """
    shares = found.blend.left_out_by_frame
    if shares is None:
        return {}
    each = zip(shares, found.frames.left_out, strict=True)
    return {"left_out_by_frame": [None if out else round(float(share), 4) for share, out in each]}


def warn_of_outliers(found: Reconstruction, capture: Capture) -> None:
    """Say what share of each frame's measurements was left out.

    Warns:
        CaptureWarning: outliers were found.
    """
    shares = found.blend.left_out_by_frame
    if shares is None:
        return
    each = ", ".join(
        f"{frame.name} {100 * share:.0f} %"
        for frame, share, out in zip(capture.frames, shares, found.frames.left_out, strict=True)
        if not out
    )
    undecided = len(found.blend.undecided) / len(found.observations.atlas)
    message = (
        f"{capture.file}: measurements that contradict those of the same point in other photographs were "
        f"left out: {each}; expected none. At {100 * undecided:.0f} % of the points no two photographs "
        "agree, or there is but one, and a neighbouring point's blend that one agrees with stands in, where "
        "there is one. Look for hands, flies, labels or reflections of the room in the photographs, mask "
        "them, or use --no-robust to count every measurement."
    )
    warnings.warn(CaptureWarning(message), stacklevel=3)

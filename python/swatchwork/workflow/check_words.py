# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What is wrong with a capture, in words, each with what to do next; here the light and the coverage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .check_light import Exposures
from .check_shapes import FrameShape

DARKEST, BRIGHTEST = 0.02, 1.0
"""Albedos of real objects."""
OFF = 1.25
"""Factor of a frame's exposure against the others' that is worth a word."""
UNSEEN = 0.4
"""Share of the surface in no photograph that is worth a word: an object on a table hides a quarter."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong ("wrong"), looks so ("suspicious"), or is good to know ("note")."""

    kind: str
    level: str
    title: str
    text: str
    advice: str
    frames: tuple[str, ...] = ()


def findings_on_light(names: Sequence[str], found: Exposures) -> list[Finding]:
    """Photographs against the probe, and against each other."""
    result = []
    albedo = found.albedo
    if albedo is not None and not DARKEST <= albedo <= BRIGHTEST:
        bright = albedo > BRIGHTEST
        result.append(
            Finding(
                "exposure of the probe",
                "suspicious",
                f"Photographs and probe differ in exposure: the object would reflect {100 * albedo:.3g} %",
                f"Under this probe a white matte object of its shape would be {1 / albedo:.3g} times as "
                f"bright as "
                f"the photographs show it; real objects reflect {100 * DARKEST:g} to {100 * BRIGHTEST:g} "
                f"% of the "
                f"light. The photographs are too {'bright' if bright else 'dark'} for the probe, or the "
                f"probe too "
                f"{'dark' if bright else 'bright'} for them; clipped lamps in the probe do this too.",
                'Bring both to one scale, with "exposure" in transforms.json (radiance = pixel / '
                "exposure) or by "
                "scaling the probe; check with a surface of known albedo.",
            )
        )
    factor = found.factor
    order = map(int, np.argsort(-np.abs(np.log(factor))))
    off = [i for i in order if np.isfinite(factor[i])]
    off = [i for i in off if found.sure[i] and not 1 / OFF <= factor[i] <= OFF]
    pair = np.isfinite(factor).sum() == 2
    if off and pair:
        a, b = (names[i] for i in map(int, np.flatnonzero(np.isfinite(factor))))
        low, high = np.nanmin(factor), np.nanmax(factor)
        result.append(
            Finding(
                "exposure of a frame",
                "suspicious",
                f"{a} and {b} differ in exposure by a factor of {high / low:.2f}",
                "That is the median over points that both show. Which of the two is off cannot be told.",
                'Check their "exposure", and that automatic exposure and white balance were off.',
                (a, b),
            )
        )
        return result
    for i in off:
        result.append(
            Finding(
                "exposure of a frame",
                "suspicious",
                f"{names[i]} is {factor[i]:.2f} times as bright as the other photographs",
                "That is the median over points of the surface that it shares with others, each under "
                "its own light. A matte surface keeps its brightness from view to view.",
                'Check its "exposure", and that automatic exposure was off. If the object is a mirror, '
                "this may be its gloss.",
                (names[i],),
            )
        )
    return result


def findings_on_coverage(shares: tuple[float, float, float], shapes: Sequence[FrameShape]) -> list[Finding]:
    """What is seen too little, and what cannot be judged."""
    result = []
    if shares[0] > UNSEEN:
        result.append(
            Finding(
                "coverage",
                "note",
                f"{100 * shares[0]:.0f} % of the surface is in no photograph",
                "What no photograph shows is filled in from what is nearest to it.",
                "Ask where to stand next: swatchwork plan --have CAPTURE/transforms.json --views 4 -o plan.",
            )
        )
    blank = [s for s in shapes if s.iou is None]
    if blank:
        result.append(
            Finding(
                "silhouettes",
                "note",
                f"The silhouette cannot be judged in {len(blank)} of {len(shapes)} photographs",
                "They have neither alpha nor a mask: whether the mesh lies on the object is for the eye "
                "to say, in the pictures below.",
                'Give masks ("mask_path") to have poses, units and order judged.',
                tuple(s.frame.name for s in blank),
            )
        )
    return result

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Which photographs cannot be what the others foretell of them: exposure, pose, light.

A rough model of all trusted photographs foretells each from the others. The few that it foretells badly, or
that a small displacement helps, are candidates: a model without the candidate says what is wrong with it, and
its verdict stands if the size is beyond what sound photographs show. Of several, the one without which the
others agree best is taken out, and all is asked again.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import F64, Bool
from ..capture import Capture, Frame
from ..errors import CaptureWarning
from ..keeping import IN_MEMORY, Keeper
from ..light import vertical
from ..observe import Rendering, SmallPicture
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from .displaced import FEWEST, Displaced, Displacements, misfit
from .foretold import Foretold, Model
from .suspects import Diagnosis, Evidence, FrameOptions, Kind

CANDIDATES = 3
"""Photographs, at most, that a round looks at closely."""
LEFT_OUT = 3
"""At most one photograph in so many is left out."""
SLIPPED = float(np.log(1.1))
"""Logarithm of an exposure that is worth a word: the rough model makes sound photographs of measured
materials up to 6 % darker or brighter than the others (docs/validation.md)."""
SURE = 4.0
"""Standard errors, and spreads of the other photographs, that an exposure is off by."""
CORRELATED = 10.0
"""Pairs that count as one in the standard error: neighbours share their model's misfit."""
EXPLAINED, EXPLAINED_MISFIT = 0.35, 0.05
"""Of a photograph's misfit, as a share and altogether, that a displacement explains: a degree explains up to
a quarter of a sound one's, two degrees over 0.4 of a wrong one's (docs/validation.md has the cases)."""
FEWEST_DEGREES = {"pose": 1.5, "light": 3.0}
ALIEN, ALIEN_TIMES = 0.5, 2.5
"""Misfit, and times the others', of what nothing explains."""
MANY, OVERLAP = 150, 0.9
"""Points, or else a mask that disagrees with the mesh, without which that is no reason: what two others
foretell of a photograph from a side of its own may be as wrong."""
ODD, PROBED, OFF = 0.4, 0.1, 0.05
"""Of candidates, one of: misfit, share of it that a small displacement explains, logarithm of exposure."""
ROUNDS_OF_ALL = 4
"""Of scales for all photographs, which lean on one another."""


class Court:
    """The photographs and what is known of them, for as long as they are judged."""

    def __init__(
        self,
        rendering: Rendering,
        basis: GenericBasis,
        frames: Sequence[Frame],
        centre: F64,
        seed: int = 0,
    ) -> None:
        self.frames, self.centre = frames, centre
        self.foretold = Foretold(rendering, basis, seed)
        self.pictures = [SmallPicture.kept(kept) for kept in rendering.observations.samples]
        self.plain = np.ones(len(frames))
        self.overlap = [float(kept.rows("overlap")[0]) for kept in rendering.observations.samples]
        if len(self.foretold.texels):
            self.typical = float(np.median(self.foretold.radiance.mean(axis=1)))

    def displacements(self, model: Model, frame: int) -> Displacements:
        camera, picture = self.frames[frame].camera, self.pictures[frame]
        return Displacements(model, frame, camera, picture, self.centre, self.typical)

    def axis(self, frame: int) -> F64:
        """The vertical of the frame's light in the world."""
        source = self.frames[frame].environment
        assert source is not None, "read_capture requires an environment"
        return vertical(source.convention, source.world_from_environment)

    def each(self, model: Model) -> list[Displacements]:
        return [self.displacements(model, frame) for frame in range(len(self.frames))]


def diagnose(
    rendering: Rendering,
    basis: GenericBasis,
    capture: Capture,
    centre: F64,
    options: FrameOptions | None = None,
    seed: int = 0,
    progress: Progress = SILENT,
    keeper: Keeper = IN_MEMORY,
) -> Diagnosis:
    """Compare each photograph with what the others foretell of it, and say what is to be done with it.

    Args:
        capture: whose frames ``rendering`` is of.
        centre: [3] of the object, which a pose may be turned about.

    Warns:
        CaptureWarning: for each photograph that cannot be right, with what is done with it.
    """
    options, frames = options or FrameOptions(), capture.frames

    def judge() -> Diagnosis:
        with progress.stage("Comparing photographs"):
            return _judged(rendering, basis, frames, centre, options, seed)

    found = Diagnosis.of(keeper.kept("frames", lambda: judge().arrays()))
    for words in found.in_words():
        warnings.warn(CaptureWarning(f"{capture.file}: {words}"), stacklevel=3)
    return found


def _judged(
    rendering: Rendering,
    basis: GenericBasis,
    frames: Sequence[Frame],
    centre: F64,
    options: FrameOptions,
    seed: int,
) -> Diagnosis:
    court = Court(rendering, basis, frames, centre, seed)
    names = [frame.name for frame in frames]
    if len(court.foretold.texels) < FEWEST:
        return Diagnosis(tuple(Evidence(name) for name in names), options)
    trusted: Bool = np.ones(len(frames), dtype=bool)
    found: dict[int, Evidence] = {}
    model = court.foretold.fit(trusted, court.plain)
    while len(found) < max(1, len(frames) // LEFT_OUT):
        verdicts = []
        for frame in _candidates(court, model, trusted):
            others = trusted.copy()
            others[frame] = False
            without = court.foretold.fit(others, court.plain, model.fitted)
            evidence = _evidence(court, without, frame, closely=True)
            if evidence.kind:
                left = _raw(court.each(without))[others]
                verdicts.append((float(np.nanmean(left)), frame, evidence, without))
        if not verdicts:
            break
        _, frame, evidence, model = min(verdicts, key=lambda verdict: verdict[:2])
        found[frame], trusted[frame] = evidence, False
    plain = [_evidence(court, model, frame) for frame in range(len(frames))]
    # Measured anew: a model without all suspects knows better than the first ones did.
    evidence_of = [
        replace(found[i], scale=e.scale, scale_error=e.scale_error, channels=e.channels) if i in found else e
        for i, e in enumerate(plain)
    ]
    if options.scale == "all":
        evidence_of = _all_scales(court, model, trusted, evidence_of)
    return Diagnosis(tuple(evidence_of), options)


def _raw(each: list[Displacements]) -> F64:
    """Each frame's misfit [k] with its exposure's part in it; NaN where too little is known."""
    return np.array([misfit(d.difference, middle=0.0) for d in each])


def _candidates(court: Court, model: Model, trusted: Bool) -> list[int]:
    """Frames that are worth a model without them, the worst first."""
    each = court.each(model)
    raw = np.where(trusted, _raw(each), np.nan)
    if not np.isfinite(raw).any():
        return []
    # What is displaced fits worse than the typical photograph: the better half is not probed.
    middle = float(np.nanmedian(raw))
    chosen: list[int] = []
    for frame in map(int, np.argsort(-np.nan_to_num(raw, nan=-1.0))):
        if len(chosen) == CANDIDATES or not np.isfinite(raw[frame]):
            break
        odd = raw[frame] > ODD or abs(float(np.median(each[frame].difference))) > OFF
        if odd or (raw[frame] > middle and each[frame].probed(court.axis(frame)) > PROBED):
            chosen.append(frame)
    return chosen


def _evidence(court: Court, model: Model, frame: int, closely: bool = False) -> Evidence:
    """What a model says of a frame; ``closely``, also what would explain it, the model being without it."""
    d = court.displacements(model, frame)
    name = court.frames[frame].name
    if len(d.exposure) < FEWEST:
        return Evidence(name)
    middle = float(np.median(d.exposure))
    spread = 1.4826 * float(np.median(np.abs(d.exposure - middle)))
    error = 1.2533 * spread / np.sqrt(len(d.exposure) / CORRELATED)
    r, g, b = (float(c) for c in np.exp(np.median(d.channels, axis=0)))
    plain = Evidence(
        name, len(d.difference), float(np.exp(middle)), float(error), (r, g, b), misfit(d.difference)
    )
    if not closely:
        return plain
    others = [i for i in range(len(court.frames)) if model.trusted[i]]
    each = [court.displacements(model, i) for i in others]
    medians = np.array([np.median(e.exposure) for e in each if len(e.exposure) >= FEWEST])
    misfits = np.array([misfit(e.difference) for e in each])
    # Where the others tell nothing of one another, nothing stands out.
    usual = float(np.nanmedian(misfits)) if np.isfinite(misfits).any() else np.inf
    tried: list[tuple[Kind, str, Displaced]] = [
        ("pose", "object", d.pose("object")),
        ("pose", "camera", d.pose("camera")),
        ("light", "", d.light(court.axis(frame))),
    ]
    kind, about, best = min(tried, key=lambda t: t[2].misfit)
    spoilt = float(np.median([e.spoilt for e in each if len(e.difference) >= FEWEST] or [0.0]))
    explained = best.without - best.misfit
    explains = explained > EXPLAINED * (best.without - spoilt) and explained > EXPLAINED_MISFIT
    if explains and best.degrees >= FEWEST_DEGREES[kind]:
        return replace(plain, kind=kind, about=about, degrees=best.degrees, explained=best.misfit)
    sure = SURE * max(error, 1.4826 * float(np.median(np.abs(medians))) if len(medians) else np.inf)
    if abs(middle) > max(SLIPPED, sure):
        return replace(plain, kind="exposure")
    judged = plain.points >= MANY or court.overlap[frame] < OVERLAP
    if judged and plain.misfit > max(ALIEN, ALIEN_TIMES * usual):
        return replace(plain, kind="disagrees")
    return plain


def _all_scales(court: Court, model: Model, trusted: Bool, evidence: list[Evidence]) -> list[Evidence]:
    """Every frame's scale against all others', with a mean logarithm of 0 over the trusted ones.

    A frame that could not be compared keeps its exposure, and has no say in the mean.
    """
    scale = np.zeros(len(evidence))
    for _ in range(ROUNDS_OF_ALL):
        each = court.each(model)
        known = np.array([len(d.exposure) >= FEWEST for d in each])
        # What is foretold knows the scales so far, what is shown does not.
        scale = np.array([np.median(d.exposure) if k else 0.0 for d, k in zip(each, known, strict=True)])
        if (known & trusted).any():
            scale[known] -= scale[known & trusted].mean()
        model = court.foretold.fit(trusted, np.exp(scale), model.fitted)
    return [replace(e, scale=float(np.exp(s))) for e, s in zip(evidence, scale, strict=True)]

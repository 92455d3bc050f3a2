# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a reconstruction found and cost, in plain numbers and in words."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from os import PathLike
from typing import Any

import numpy as np

from ..capture import Capture
from ..interreflection import IndirectShare
from ..reconstruct import Reconstruction
from .costs import StageCost


@dataclass(frozen=True)
class ReconstructSummary:
    """What a reconstruction found and cost, in plain numbers."""

    capture: str
    output: str
    basis: str
    views: int
    """Photographs that the material rests on."""
    views_left_out: int
    """Further ones, with something wrong."""
    suspects: tuple[dict[str, Any], ...]
    """Photographs that the others do not agree with: what was found, and what was done."""
    doubt: str
    """Why there may be more of them, in words; empty where nothing speaks for that."""
    resolution: int
    texels: int
    unseen: int
    n: int
    N: int
    status: str
    misfit: float
    """Root mean square over texels of the relative error |s_hat - s| / |s_hat|; undecided ones do not count,
    unless all are."""
    lambda0: float
    lambda1: float
    left_out: float
    """Share of the measurements that were left out as outliers; 0 where none were found."""
    undecided: int
    """Texels in photographs of which no two agree there, or in one alone, where there are outliers: they have
    the nearest decided texel's blend."""
    interreflections: int
    """Rounds under the light that the object sends to itself."""
    indirect: IndirectShare | None
    """How much of the light that was; None where it was ignored."""
    seconds: float
    peak_mb: float
    resumed: bool
    """Whether it went on from an interrupted run, so that `seconds` and `stages` are the rest's."""
    stages: tuple[StageCost, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """Two lines for a person, three with interreflections."""
        unseen = f", {100 * self.unseen / self.texels:.1f} % of them in no photograph" if self.unseen else ""
        out = (
            f" {100 * self.left_out:.0f} % of the measurements left out as outliers." if self.left_out else ""
        )
        if self.undecided:
            unseen += f", {100 * self.undecided / self.texels:.1f} % undecided"
        rest = " (gone on from an interrupted run)" if self.resumed else ""
        bounced = f"{_sentence(self.indirect.in_words())}\n" if self.indirect else ""
        return (
            f"{self.N} materials, {self.n} blended at a point ({self.status}); relative misfit "
            f"{100 * self.misfit:.1f} % at {self.texels:,} surface points{unseen}.{out}\n{bounced}"
            f"{self.photographs}, {self.seconds:.1f} s{rest}, peak {self.peak_mb:.0f} MB. "
            f"Material in {self.output}"
        )

    @property
    def photographs(self) -> str:
        """How many were used, left out and scaled, and whether they could be judged."""
        scaled = sum(suspect["done"] == "scaled" for suspect in self.suspects)
        words = f"{self.views} photographs"
        words += f", {self.views_left_out} more left out" if self.views_left_out else ""
        words += f", {scaled} of them scaled" if scaled else ""
        return words + (f", {self.doubt}" if self.doubt else "")


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


def summarise(
    found: Reconstruction,
    capture: Capture,
    output: str | PathLike[str],
    start: float,
    interreflections: int,
    indirect: IndirectShare | None,
    costs: list[StageCost],
    resumed: bool,
) -> ReconstructSummary:
    """The plain numbers of a reconstruction begun at ``start`` (seconds of ``time.perf_counter``)."""
    atlas, seen = found.observations.atlas, found.observations.seen
    decided = np.setdiff1d(seen, found.blend.undecided, assume_unique=True)
    residual = found.blend.residual.ravel()[atlas.pixel[decided if len(decided) else seen]]
    return ReconstructSummary(
        capture=str(capture.file),
        output=str(output),
        basis=found.basis.name,
        views=len(capture.frames) - int(found.frames.left_out.sum()),
        views_left_out=int(found.frames.left_out.sum()),
        suspects=tuple(frame for frame in found.frames.as_dict()["frames"] if frame["kind"]),
        doubt=found.frames.doubt,
        resolution=atlas.resolution,
        texels=len(atlas),
        unseen=len(atlas) - len(seen),
        n=found.solution.n,
        N=len(found.solution.representatives),
        status=found.solution.status,
        misfit=float(np.sqrt(np.mean(np.square(residual), dtype=np.float64))),
        lambda0=float(found.solution.lambda0),
        lambda1=float(found.solution.lambda1),
        left_out=found.blend.left_out,
        undecided=len(found.blend.undecided),
        interreflections=interreflections,
        indirect=indirect,
        seconds=time.perf_counter() - start,
        peak_mb=max((cost.peak_mb for cost in costs), default=0.0),
        resumed=resumed,
        stages=tuple(costs),
    )

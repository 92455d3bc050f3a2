# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What each photograph should show of some texels, foretold from the others.

A rough model of fixed n and N is fitted to the trusted photographs, to those measurements that agree: what
stands before the object, or glints, in every photograph would else hide one that is wrong. For each
photograph every texel is blended anew without it, and the blend is rendered for it: where its camera and its
light are said to be, or elsewhere. A trusted photograph still has its share in the representatives.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays import F32, F64, I64, Bool, dot, unit
from ..observe import Lights, Rendering, stratified
from ..reflectance import GenericBasis
from ..response import representative_responses
from ..solve import (
    Alternation,
    Problem,
    SolveOptions,
    blend,
    quick,
    robust_start,
    settled_blend,
    trimmed_blend,
)

TEXELS = 600
"""That the photographs are compared at."""
FEWEST_VIEWS = 3
"""Photographs that must show a texel: two others foretell what one shows."""
BLENDED, MATERIALS = 2, 4
"""n and N of the rough model."""
VOTES = 2
"""On the measurements that agree, each by the model of those before."""
AGREEING = 100
"""Texels whose views must agree for a model of them alone."""


class Foretold:
    """Pairs of some texels that at least three photographs show, and what the other photographs say of each.

    ``texels`` I64[T]; ``frame`` [P] and ``radiance`` F32[P, 3] of the pairs; ``position`` F64[P, 3].
    """

    def __init__(self, rendering: Rendering, basis: GenericBasis, seed: int = 0) -> None:
        observations = rendering.observations
        chosen = stratified(observations, 4 * TEXELS, seed)
        chosen = chosen[observations.coverage[chosen] >= FEWEST_VIEWS]
        self.texels: I64 = chosen[:: max(1, len(chosen) // TEXELS)]
        self.rendering, self.basis = rendering, basis
        self.frames = len(observations.samples)
        if not len(self.texels):
            return
        pairs = rendering.pairs(self.texels)
        self.seen, self._weight, self._weighted = pairs.seen, pairs.weight, pairs.radiance
        self.frame, self.radiance = pairs.seen.frame, pairs.seen.radiance
        self.place: I64 = np.repeat(np.arange(len(self.texels)), np.diff(pairs.offsets))
        self.position = observations.atlas.position(self.texels)[self.place]
        self._generic = rendering.generic(basis, pairs)

    def fit(self, trusted: Bool, scale: F64, previous: Alternation | None = None) -> Model:
        """The rough model of the trusted frames [k], each over its scale [k]."""
        radiance = (self._weighted / scale[self.frame][:, None]).astype(np.float32)
        rows = trusted[self.frame]
        counts = np.bincount(self.place[rows], minlength=len(self.texels))
        told = np.flatnonzero(counts)
        offsets = np.concatenate([[0], np.cumsum(counts[told])])
        problem = Problem(self._generic[rows], radiance[rows], offsets)
        return Model(self, *_fitted(problem, previous), trusted, radiance)


def _fitted(problem: Problem, previous: Alternation | None) -> tuple[Alternation, float | None]:
    """A rough model of the measurements that agree, from ``previous`` on, and the scale of what it leaves.

    Without a scale where too few texels have views that agree: then of all measurements.
    """
    start, options = previous, SolveOptions(n=BLENDED, N=MATERIALS)
    representatives = robust_start(problem, options)[0] if start is None else start.representatives
    for _ in range(VOTES):
        of = problem.fold(representatives), problem.radiance, problem.offsets
        trimmed = settled_blend(*of, BLENDED)
        if np.count_nonzero(trimmed.agreed) < AGREEING:
            return quick(problem, BLENDED, MATERIALS, start and _blended(problem, start)), None
        part = problem.part(trimmed.kept, trimmed.agreed)
        fitted = quick(part, BLENDED, MATERIALS, _blended(part, _of(representatives)))
        representatives = fitted.representatives
    return fitted, trimmed.settled


def _of(representatives: F64) -> Alternation:
    """Representatives as a model that knows no texels yet."""
    nowhere = np.zeros((0, len(representatives)))
    return Alternation(representatives, nowhere, np.zeros(0), np.inf, 0, False)


def _blended(problem: Problem, model: Alternation) -> Alternation:
    """A model of other measurements, blended for those of ``problem``."""
    found = blend(problem.fold(model.representatives), problem.radiance, problem.offsets, BLENDED)
    return replace(model, weights=found.weights)


class Model:
    """A rough model with each photograph's pairs foretold by the trusted others.

    ``rows`` says which pairs of each frame could be foretold; ``weights`` F64[R, N] are their blends, of the
    other photographs' measurements that agree by ``scale`` (of all of them where it is None).
    """

    def __init__(
        self, of: Foretold, fitted: Alternation, scale: float | None, trusted: Bool, radiance: F32
    ) -> None:
        self.of, self.fitted, self.scale, self.trusted = of, fitted, scale, trusted
        representatives = fitted.representatives
        self._responses: F32 = np.einsum("pjc,njc->pnc", of._generic, representatives, optimize=True).astype(
            np.float32
        )
        found = [self._without(frame, radiance) for frame in range(of.frames)]
        self.rows: list[I64] = [rows for rows, _ in found]
        self.weights: list[F64] = [weights for _, weights in found]

    def _without(self, frame: int, radiance: F32) -> tuple[I64, F64]:
        of = self.of
        mine = np.flatnonzero(of.frame == frame)
        others = self.trusted[of.frame] & (of.frame != frame)
        counts = np.bincount(of.place[others], minlength=len(of.texels))
        mine = mine[counts[of.place[mine]] >= FEWEST_VIEWS - 1]
        wanted = np.zeros(len(of.texels), dtype=bool)
        wanted[of.place[mine]] = True
        used = np.flatnonzero(others & wanted[of.place])
        if not len(mine):
            return mine, np.zeros((0, self.fitted.N))
        offsets = np.concatenate([[0], np.cumsum(counts[wanted])])
        given = self._responses[used], radiance[used], offsets, BLENDED
        # A texel's pairs of one frame are one: `mine` rises by texel, as the wanted do.
        if self.scale is None:
            return mine, blend(*given).weights
        return mine, trimmed_blend(*given, self.scale).blend.dense(self.fitted.N)

    def radiance(self, frame: int) -> F64:
        """What the frame should show [R, 3]."""
        rows = self.rows[frame]
        made = np.einsum("rnc,rn->rc", self._responses[rows], self.weights[frame], optimize=True)
        return np.asarray(made / np.maximum(self.of._weight[rows], 1e-6)[:, None], dtype=np.float64)

    def elsewhere(self, frame: int, viewer: F64 | None = None, turn: F64 | None = None) -> F64:
        """What the frame should show [R, 3] from another place, or with its light turned by a rotation."""
        of, rows = self.of, self.rows[frame]
        lights: Lights = of.rendering.lights
        if turn is not None:
            turns = lights.turn.copy()
            turns[frame] = turn @ turns[frame]
            lights = Lights(lights.environments, lights.of_frame, turns)
        to_viewer = of.seen.to_viewer[rows]
        if viewer is not None:
            to_viewer = unit(viewer - of.position[rows]).astype(np.float32)

        def responses(*given: Any) -> F32:
            return representative_responses(of.basis, self.fitted.representatives, *given)

        found = lights.each(
            of.seen.frame[rows],
            of.seen.normal[rows],
            to_viewer,
            of.rendering.sky,
            of.seen.texel[rows],
            self.fitted.N,
            responses,
        )
        return np.asarray(np.einsum("rnc,rn->rc", found, self.weights[frame], optimize=True), np.float64)

    def cosine(self, frame: int) -> F64:
        """n.o of the frame's pairs [R]."""
        rows = self.rows[frame]
        return dot(self.of.seen.to_viewer[rows], self.of.seen.normal[rows])

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Blends from those of a texel's views that agree, and which measurements those are.

Least squares over all views hides an outlier: the blend leans towards it, and every residual is large. So
blends are fitted to pairs of views (random sample consensus, Fischler and Bolles 1981, nearly exhaustive, for
a texel has few views), the one that the most views agree with is taken, and fitted again to those.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..arrays import F32, F64, I64, U8, U32, Bool
from .blending import Search, SparseBlend, sparse_blend

BOUND = 6.0
"""Times the scale beyond which a measurement is left out. Texels in creases and at rims leave tails: in fits
of clean captures 2 to 5 % of the measurements are beyond 6, of Gaussian noise none."""
MEDIAN = 1.538
"""Median length of a vector of three standard normal numbers."""
VOTES = 3
"""Views that have to agree for a texel to speak for the materials. Two spikes agree on a bright white one: by
a majority of two that was found, and glared under the novel light (30 % NRMS for 4 %)."""
HYPOTHESES = 15
"""Pairs of views that are tried: all of six views."""
LEAST_SCALE = 0.01
"""A fit may be far better, noise-free or with few texels, but a measurement a few per cent off is then
one that straddles an edge or a highlight, and no outlier."""
REFITS = 3
ROUNDS = 4
"""In which scale and blends settle."""
STANDS = 0.02
"""Relative change of the scale that is none."""
ROWS_AT_ONCE = 1 << 16
"""Measured rows of hypotheses at once; a row of N responses takes 12 N bytes."""


@dataclass(frozen=True)
class Trimmed:
    """Blends of M texels and the measurements they rest on."""

    blend: SparseBlend
    kept: Bool
    """[P] whether a measurement was used."""
    deviation: F64
    """[P] lengths of the residuals over what `expected` gives."""
    agreed: Bool
    """[M] whether more than half of a texel's views, and VOTES at least, agree."""
    scale: float
    """By which that was decided."""

    @property
    def bound(self) -> float:
        """The largest deviation that is kept."""
        return BOUND * self.scale

    @property
    def settled(self) -> float:
        """The scale of what was kept."""
        return spread(self.deviation[self.kept])


def expected(radiance: F32, offsets: I64, usual: float | None = None) -> F64:
    """Radiance [P] that a measurement's residual is compared to, from measured radiance [P, 3] alone.

    What a fit leaves is about a share of the radiance there (noise, misfit of the basis) and about one of the
    texel's typical radiance (resampling, blends): halves of both have the lightest tails on clean captures.
    An outlier cannot raise it much: the texel's is the median of its views, and what a view counts by itself
    ends at four times that in energy. Black ones are held to a hundredth of the ``usual`` energy's root, by
    default of the median here: who looks at some texels of many gives that of all.
    """
    energy = (radiance.astype(np.float64) ** 2).sum(axis=1)
    typical = np.repeat(medians(energy, offsets), np.diff(offsets))
    floor = 1e-4 * (float(np.median(energy)) if usual is None else usual) + 1e-30
    counted = 0.5 * np.minimum(energy, 4 * typical) + 0.5 * typical
    return np.asarray(np.sqrt(np.maximum(counted, floor)))


def medians(values: F64, offsets: I64) -> F64:
    """The lower median [M] of each texel's values [P]."""
    order = np.lexsort((values, np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))))
    return np.asarray(values[order][offsets[:-1] + (np.diff(offsets) - 1) // 2])


def blended(responses: F32, index: U8 | U32 | I64, weight: F32) -> F64:
    """What blends [P, n] of representatives give [P, 3], from the responses [P, N, 3] of all."""
    fitted, row = np.zeros((len(responses), 3)), np.arange(len(responses))
    for slot in range(index.shape[1]):
        fitted += weight[:, slot, None].astype(np.float64) * responses[row, index[:, slot]]
    return fitted


def deviations(fitted: F64, radiance: F32, scale: F64) -> F64:
    """Lengths [P] of residuals over what is expected [P]."""
    return np.asarray(np.sqrt(((fitted - radiance) ** 2).sum(axis=1)) / scale)


def spread(deviation: F64) -> float:
    """The scale of deviations [P]: of normal ones, their standard deviation in each channel."""
    return max(float(np.median(deviation)) / MEDIAN, LEAST_SCALE)


def trimmed_blend(
    responses: F32,
    radiance: F32,
    offsets: I64,
    n: int,
    scale: float,
    *,
    search: Search = "exact",
    seed: int = 0,
    usual: float | None = None,
) -> Trimmed:
    """Blends [M] of at most n representatives from the measurements within BOUND times ``scale``.

    A texel of two views is tried by each of them; of one there is nothing to compare. No texel's answer
    depends on the others, given ``usual`` and with the exact search.

    Args:
        responses: [P, N, 3] of the representatives; ``radiance`` [P, 3]; ``offsets`` [M + 1].
        scale: as `spread` gives it.
        usual: as `expected` takes it.
    """
    size = expected(radiance, offsets, usual)
    kept = np.ones(len(radiance), dtype=bool)
    views = np.diff(offsets)
    rng = np.random.default_rng([seed, 9])
    # Those of counts of views that no texel here has are drawn too: elsewhere some may have them.
    for k in range(2, int(views.max()) + 1):
        subsets = _subsets(k, rng)
        step = max(1, ROWS_AT_ONCE // (len(subsets) * k))
        for texels in _runs(np.flatnonzero(views == k), step):
            rows = offsets[texels][:, None] + np.arange(k)
            part = responses[rows], radiance[rows], size[rows]
            kept[rows] = _consensus(*part, subsets, n, scale, search)
    for _ in range(REFITS):
        blend, deviation = _refitted(responses, radiance, offsets, size, kept, n, search, seed)
        within = deviation <= BOUND * scale
        # A texel of which nothing agrees keeps all: no view is better than another there.
        within |= np.repeat(np.add.reduceat(within, offsets[:-1]) == 0, views)
        if (within == kept).all():
            break
        kept = within
    agreeing = np.add.reduceat(deviation <= BOUND * scale, offsets[:-1], dtype=np.int64)
    return Trimmed(blend, kept, deviation, (2 * agreeing > views) & (agreeing >= VOTES), scale)


def settled_blend(
    responses: F32,
    radiance: F32,
    offsets: I64,
    n: int,
    scale: float | None = None,
    *,
    search: Search = "exact",
    seed: int = 0,
) -> Trimmed:
    """As ``trimmed_blend``, by the scale of what it keeps itself.

    Args:
        scale: to begin with, and fall from; that of the plain blends by default.
    """
    if scale is None:
        every = np.ones(len(radiance), dtype=bool)
        size = expected(radiance, offsets)
        scale = spread(_refitted(responses, radiance, offsets, size, every, n, search, seed)[1])
    for _ in range(ROUNDS):
        found = trimmed_blend(responses, radiance, offsets, n, scale, search=search, seed=seed)
        before, scale = scale, found.settled
        if abs(scale - before) <= STANDS * before:
            break
    return found


def _subsets(k: int, rng: np.random.Generator) -> I64:
    """[H, 2] views of each hypothesis; of two views each alone (twice)."""
    if k == 2:
        return np.array([[0, 0], [1, 1]])
    every = np.array(list(combinations(range(k), 2)))
    if len(every) <= HYPOTHESES:
        return every
    return every[np.sort(rng.choice(len(every), HYPOTHESES, replace=False))]


def _runs(texels: I64, step: int) -> Iterator[I64]:
    for start in range(0, len(texels), step):
        yield texels[start : start + step]


def _consensus(
    responses: F32, radiance: F32, size: F64, subsets: I64, n: int, scale: float, search: Search
) -> Bool:
    """Which views [T, k] agree with the best hypothesis: the least sum of squares cut off at the bound."""
    T, _, N, _ = responses.shape
    H = len(subsets)
    offsets = np.arange(T * H + 1, dtype=np.int64) * subsets.shape[1]
    found = sparse_blend(
        responses[:, subsets].reshape(-1, N, 3),
        radiance[:, subsets].reshape(-1, 3),
        offsets,
        n,
        search=search,
    )
    weights = found.dense(N).reshape(T, H, N)
    fitted = np.einsum("thn,tknc->thkc", weights, responses, optimize=True)
    squared = ((fitted - radiance[:, None]) ** 2).sum(axis=-1) / (scale * size[:, None]) ** 2
    best = np.minimum(squared, BOUND**2).sum(axis=-1).argmin(axis=1)
    return np.asarray(squared[np.arange(T), best] <= BOUND**2)


def _refitted(
    responses: F32, radiance: F32, offsets: I64, size: F64, kept: Bool, n: int, search: Search, seed: int
) -> tuple[SparseBlend, F64]:
    """Blends of the kept measurements, and the deviations [P] of all."""
    on = kept.astype(np.float32)
    found = sparse_blend(
        responses * on[:, None, None], radiance * on[:, None], offsets, n, search=search, seed=seed
    )
    texel = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    return found, deviations(blended(responses, found.index[texel], found.weight[texel]), radiance, size)

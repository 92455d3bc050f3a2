# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where a result is to be trusted: errors in held-out views, and the spread of each representative."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import DARK, F32, F64, I64
from ..material import LEAST, ErrorModel, dense, features, neighbourhood_of_windows
from ..observe import Pairs, Rendering, stratified
from ..reflectance import GenericBasis
from ..solve import Solution, sparse_blend
from ..streaming import TexelBlend, agreement, only

HELD_OUT_TEXELS = 6000
ROUNDS = 2
"""Views left out of each texel, one at a time."""
SPREAD_TEXELS = 1500
RIDGE = 1e-3
PAIRS_AT_ONCE = 1 << 16


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Texels blended anew without one of their views."""

    texel: I64
    """[T]"""
    weights: F64
    """[T, N] from the other views."""
    residual: F64
    """[T] relative error in those."""
    views: I64
    """[T] how many those are."""
    error: F64
    """[T] relative error in the view left out."""


def fit_error_model(
    rendering: Rendering, basis: GenericBasis, solution: Solution, blend: TexelBlend, seed: int = 0
) -> ErrorModel | None:
    """Learn what error to expect (material/trust.py) from texels that are blended without one of their views.

    The representatives stay: they come from thousands of texels, and one view of one of them hardly moves
    them. None where no texel has two views, or too few have, for then nothing can be held out.
    """
    observations, N = rendering.observations, len(solution.representatives)
    atlas = observations.atlas
    sample = stratified(observations, HELD_OUT_TEXELS, seed)
    sample = sample[observations.coverage[sample] >= 2]
    if len(sample) < 10 * (6 + N):
        return None
    rng = np.random.default_rng([seed, 8])
    parts: list[HeldOut] = []
    gram = np.zeros((N, N))
    pairs_seen = 0
    for tile in rendering.tiles(sample, PAIRS_AT_ONCE):
        pairs, responses = _told(rendering, basis, solution, tile, seed)
        if not len(pairs.seen):
            continue
        gram += np.einsum("pnc,pmc->nm", responses, responses, optimize=True, dtype=np.float64)
        pairs_seen += len(responses)
        floor = DARK**2 * observations.typical
        for _ in range(ROUNDS):
            parts.append(
                _without_one(
                    pairs.seen.texels, responses, pairs.radiance, pairs.offsets, solution.n, floor, rng
                )
            )
    appearance = _root(gram / max(pairs_seen, 1))
    size = atlas.resolution
    coverage = np.full(size * size, -1, np.int32)
    coverage[atlas.pixel] = observations.coverage
    image = coverage.reshape(size, size)
    found = [_features(p, appearance, blend, image, atlas.pixel[p.texel], solution.n) for p in parts]
    if sum(len(part.texel) for part in parts) < ROUNDS * 10 * (6 + N):
        return None
    x, error = np.concatenate(found), np.concatenate([part.error for part in parts])
    return _fitted(x, error, appearance)


def spread_of_representatives(
    rendering: Rendering, basis: GenericBasis, solution: Solution, blend: TexelBlend, seed: int = 0
) -> F64:
    """Relative standard deviation [N] of each representative's response to the capture's light.

    From the representative optimisation matrix (section 5) of the kernels a representative has, each texel
    weighted as in Eq. 5 and by its blend weight, with the residuals as noise, for as many texels as the
    representatives were found from. The others, and the blends, count as known. Outliers, and texels whose
    views do not agree, tell nothing.
    """
    observations, N = rendering.observations, len(solution.representatives)
    atlas, J = observations.atlas, basis.kernels
    sample = stratified(observations, SPREAD_TEXELS, seed)
    gram, whole = np.zeros((N, 3, J, J)), np.zeros((3, J, J))
    noise, counted, total = np.zeros(N), np.zeros(N), 0
    index = blend.index.reshape(atlas.resolution**2, -1)
    weight = blend.weight.reshape(atlas.resolution**2, -1)
    for tile in rendering.tiles(sample, PAIRS_AT_ONCE // 4):
        pairs = _heeded(rendering, basis, solution, tile, seed)
        if not len(pairs.seen):
            continue
        responses = rendering.generic(basis, pairs).transpose(2, 0, 1)
        pixel, views = atlas.pixel[pairs.seen.texels], np.diff(pairs.offsets)
        weights = dense(index[pixel], weight[pixel], N).astype(np.float64)
        energy = np.add.reduceat((pairs.radiance.astype(np.float64) ** 2).sum(axis=1), pairs.offsets[:-1])
        energy = np.maximum(energy, DARK**2 * observations.typical * views)
        # A measurement's variance, in the unit in which its texel's energy is 1.
        free = np.maximum(3 * views - (solution.n - 1), 1)
        variance = blend.residual.ravel()[pixel].astype(np.float64) ** 2 / free
        whole += responses.transpose(0, 2, 1) @ responses
        total += len(pairs.radiance)
        noise += weights.T @ variance
        counted += weights.sum(axis=0)
        for i in range(N):
            used = np.flatnonzero(np.repeat(weights[:, i] > 0, views))
            factor = np.repeat(weights[:, i] / np.sqrt(energy), views)[used].astype(np.float32)
            rows = responses[:, used] * factor[:, None]
            gram[i] += rows.transpose(0, 2, 1) @ rows
    whole /= max(total, 1)
    gram *= len(solution.weights) / max(len(sample), 1)
    found = np.zeros(N)
    for i in range(N):
        squared = size = 0.0
        for c in range(3):
            kernels = solution.representatives[i, :, c]
            used = np.flatnonzero(kernels > 0)
            # Kernels that no measurement tells apart leave their sum known, which is all that shows.
            inverse = np.linalg.pinv(gram[i, c][np.ix_(used, used)], rcond=1e-7, hermitian=True)
            of_used = whole[c][np.ix_(used, used)]
            squared += noise[i] / max(counted[i], 1e-12) * float((inverse * of_used).sum())
            size += float(kernels[used] @ of_used @ kernels[used])
        found[i] = np.sqrt(squared / size) if size > 0 else 0.0
    return found


def _told(
    rendering: Rendering, basis: GenericBasis, solution: Solution, tile: I64, seed: int
) -> tuple[Pairs, F32]:
    """The pairs of texels with two views or more, outliers aside, and their responses."""
    if solution.outliers is None:
        pairs = rendering.pairs(tile)
        return pairs, rendering.representatives(basis, solution.representatives, pairs)
    found = agreement(rendering, basis, solution, tile, "exact", seed)
    views = np.add.reduceat(found.trimmed.kept, found.pairs.offsets[:-1], dtype=np.int64)
    kept = found.trimmed.kept & np.repeat(found.decided & (views >= 2), np.diff(found.pairs.offsets))
    return only(found.pairs, kept), found.responses[kept]


def _heeded(rendering: Rendering, basis: GenericBasis, solution: Solution, tile: I64, seed: int) -> Pairs:
    """The pairs of texels, without outliers and texels that are not decided."""
    if solution.outliers is None:
        return rendering.pairs(tile)
    found = agreement(rendering, basis, solution, tile, "exact", seed)
    return only(found.pairs, found.trimmed.kept & np.repeat(found.decided, np.diff(found.pairs.offsets)))


def _without_one(
    texel: I64,
    responses: F32,
    radiance: F32,
    offsets: I64,
    n: int,
    floor: float,
    rng: np.random.Generator,
) -> HeldOut:
    """Leave a random view out of each texel."""
    views = np.diff(offsets)
    out = offsets[:-1] + (rng.random(len(views)) * views).astype(np.int64)
    kept = np.ones(len(responses), bool)
    kept[out] = False
    starts = np.concatenate([[0], np.cumsum(views - 1)])
    found = sparse_blend(responses[kept], radiance[kept], starts, n)
    weights = dense(found.index, found.weight, responses.shape[1]).astype(np.float64)
    energy = np.add.reduceat((radiance[kept].astype(np.float64) ** 2).sum(axis=1), starts[:-1])
    residual = np.sqrt(found.squared_error / np.maximum(energy, floor * (views - 1)))
    made = np.einsum("tnc,tn->tc", responses[out], weights, optimize=True)
    measured = radiance[out].astype(np.float64)
    own = np.maximum((measured**2).sum(axis=1), floor)
    error = np.sqrt(((made - measured) ** 2).sum(axis=1) / own)
    return HeldOut(texel, weights, residual, views - 1, error)


def _features(
    part: HeldOut, appearance: F64, blend: TexelBlend, coverage: np.ndarray, pixel: np.ndarray, n: int
) -> F64:
    """Features of texels as if the view left out had never been taken; their neighbours keep theirs."""
    size = coverage.shape[0]
    N = len(appearance)
    row, column = np.divmod(pixel.astype(np.int64), size)
    # A window of 3 x 3 pixels for each, its centre replaced.
    offset = np.arange(-1, 2)
    rows = np.clip(row[:, None, None] + offset[:, None], 0, size - 1)
    columns = np.clip(column[:, None, None] + offset, 0, size - 1)
    window = coverage[rows, columns].copy()
    look = dense(blend.index[rows, columns], blend.weight[rows, columns], N) @ appearance
    residual = blend.residual[rows, columns].astype(np.float64)
    look[:, 1, 1], residual[:, 1, 1], window[:, 1, 1] = part.weights @ appearance, part.residual, part.views
    around, change = neighbourhood_of_windows(look, residual, window)
    strength = ((part.weights @ appearance) ** 2).sum(axis=1)
    return features(part.residual, around, change, strength, part.views, part.weights, n)


def _fitted(x: F64, error: F64, appearance: F64) -> ErrorModel:
    """Ridge regression of log errors, scaled so that the squares of what is expected add up to those met."""
    target = np.log(np.maximum(error, LEAST))
    mean, spread = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-6)
    a = np.concatenate([(x - mean) / spread, np.ones((len(x), 1))], axis=1)
    ridge = RIDGE * len(x) * np.eye(a.shape[1])
    ridge[-1, -1] = 0
    coefficients = np.linalg.solve(a.T @ a + ridge, a.T @ target)
    # Without the hundredth that is largest: highlights that one view has and the others lack.
    few = error <= np.quantile(error, 0.99)
    expected = np.exp(a @ coefficients)
    met = max(float((error[few] ** 2).sum()), LEAST**2 * len(x))
    coefficients[-1] += 0.5 * np.log(met / (expected[few] ** 2).sum())
    return ErrorModel(appearance, mean, spread, coefficients, len(x))


def _root(gram: F64) -> F64:
    """A [N, N] with A A^T = gram, over its trace's mean, so that a typical blend has strength 1."""
    values, vectors = np.linalg.eigh(gram / max(float(np.trace(gram)) / len(gram), 1e-30))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0)))

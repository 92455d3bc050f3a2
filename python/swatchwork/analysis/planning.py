# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Next best views: where to stand so that photographs say most about the reflectance of every point.

The weights of a point's J generic kernels are given independent Gaussian priors of one variance, so that its
responses in the candidate views are Gaussian with covariance s*_x s*_x^T, s*_x its blend optimisation matrix
(section 5). Each response counts relative to its own spread, so K_x holds their correlations: else the few
views in which a mirror would show a lamp are all that matters. A photograph from view v measures the
response with variance sigma^2 / n.o (slanted surface covers few pixels) and leaves

    K' = K - K_:v K_v: / (K_vv + sigma^2 / n.o).

A-optimal: the view that lowers most the variance left, over all points and the views that see them, each
by its n.o. D-optimal: the one that lowers log det most, which gains log(1 + K_vv n.o / sigma^2). Both are
greedy; the gain of D is submodular, so that greedy choice reaches 63 % of the best possible (Nemhauser et
al. 1978).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import F32, F64, I64, Bool
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from .conditioning import Views, blend_spectra, condition_numbers

Criterion = Literal["A", "D"]
SIGMAS: dict[Criterion, float] = {"A": 1.0, "D": 0.1}
"""Of a measurement, relative to a response's own spread, by criterion. Of 0.1, 0.3 and 1 on seeds 0 and 1 of
scripts/measure/planning.py, whose own seeds are others: D at 0.1 had the least mean error, and A at 1 the
least median but now and then three times as much."""
ENOUGH = 0.1
"""Weight of points whose condition number is low enough, where there is one to reach."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before the first photograph: responses of M points in V candidate views."""

    correlation: F32
    """[M, V, V]; rows and columns of views that do not see the point are 0."""
    seen: Bool
    """[M, V]"""
    cosine: F32
    """[M, V] n.o where a view sees a point, else 0."""
    spread: F32
    """[M, V] root of each response's variance, in the light's unit."""
    kernels: int


def prior_of(views: Views, basis: GenericBasis, progress: Progress = SILENT) -> Prior:
    """Correlations of all points and candidate views."""
    count, V = views.seen.shape
    correlation = np.zeros((count, V, V), np.float32)
    cosine, spread = np.zeros((count, V), np.float32), np.zeros((count, V), np.float32)
    step = max(1, (1 << 15) // max(1, int(np.ceil(views.seen.mean() * V))))
    with progress.stage("Responses of the candidate views", count) as task:
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            point, view = views.pairs(part)
            responses = views.responses(basis, point, view)
            cosine[point, view] = views.cosine(point, view)
            spread[point, view] = size = np.maximum(np.linalg.norm(responses, axis=1), 1e-30)
            rows = np.zeros((part.stop - start, V, basis.kernels), np.float32)
            rows[point - start, view] = responses / size[:, None]
            correlation[part] = rows @ rows.transpose(0, 2, 1)
            task.advance(part.stop - start)
    return Prior(correlation, views.seen, cosine, spread, basis.kernels)


@dataclass(frozen=True, eq=False)
class Plan:
    """Views in the order to take them."""

    chosen: tuple[int, ...]
    left: F64
    """[len(chosen) + 1] share of the variance left, before the first and after each view."""
    condition: F64
    """[len(chosen) + 1] condition number that ``quantile`` of the points that can be seen stay below."""
    coverage: F64
    """[len(chosen) + 1] share of the points that can be seen, that some view sees."""
    unknown_before: F64
    """[M] share of each point's variance left before the first of them, 1 where no view can see it."""
    unknown_after: F64
    """[M] and after the last."""


def next_best_views(
    prior: Prior,
    most: int,
    *,
    candidates: Sequence[int] | None = None,
    have: Sequence[int] = (),
    criterion: Criterion = "D",
    sigma: float | None = None,
    blended: int = 4,
    quantile: float = 0.95,
    enough: float | None = None,
    trace: bool = False,
    progress: Progress = SILENT,
) -> Plan:
    """Choose views one by one, at most ``most`` beyond those at hand.

    Args:
        candidates: views to choose from; all by default.
        have: views already taken.
        sigma: noise of a measurement, relative to the spread of its response; SIGMAS by default.
        blended: n, whose (n - 1)th singular value gives the condition number.
        quantile: of the points' condition numbers, for ``enough``.
        enough: condition number to stop at.
        trace: give ``left`` and the like for each of ``have`` too, beginning before the first.
    """
    # In double: what is left after many views is small beside what was there.
    covariance = prior.correlation.astype(np.float64)
    free = np.zeros(prior.seen.shape[1], bool)
    free[list(range(prior.seen.shape[1]) if candidates is None else candidates)] = True
    can_be_seen: Bool = np.asarray(prior.seen.any(axis=1))
    spread = SIGMAS[criterion] if sigma is None else sigma
    noise = np.where(prior.seen, spread**2 / np.maximum(prior.cosine, 1e-3), np.inf)

    def remaining() -> float:
        return float(np.einsum("mvv,mv->", covariance, prior.cosine))

    whole = remaining() or 1.0
    taken: list[int] = []
    left, condition, coverage = [], [], []

    def take(v: int) -> None:
        column = covariance[:, :, v].copy()
        np.subtract(
            covariance,
            column[:, :, None] * (column / (column[:, v] + noise[:, v])[:, None])[:, None, :],
            out=covariance,
        )
        taken.append(v)
        free[v] = False

    def unknown() -> F64:
        mine = np.einsum("mvv,mv->m", covariance, prior.cosine)
        total = prior.cosine.sum(axis=1)
        return np.where(total > 0, mine / np.maximum(total, 1e-9), 1.0).astype(np.float64)

    def note() -> None:
        left.append(remaining() / whole)
        of_seen = _conditions(prior, taken, blended)[can_be_seen]
        known = float(np.quantile(of_seen, quantile, method="higher")) if len(of_seen) else np.inf
        condition.append(known)
        seen = prior.seen[can_be_seen][:, taken]
        coverage.append(float(seen.any(axis=1).mean()) if len(seen) else 0.0)

    for v in have:
        if trace:
            note()
        take(v)
    note()
    unknown_before = unknown()
    with progress.stage("Next best views", most) as task:
        for _ in range(most):
            if not free.any() or (enough is not None and condition[-1] <= enough):
                break
            variance = np.maximum(np.einsum("mvv->mv", covariance), 0)
            if criterion == "D":
                each = np.log1p(variance / noise)
            else:
                lowered = np.einsum("muv,muv,mu->mv", covariance, covariance, prior.cosine, optimize=True)
                each = lowered / (variance + noise)
            if enough is not None:
                each[_conditions(prior, taken, blended) <= enough] *= ENOUGH
            gain = each.sum(axis=0)
            take(int(np.argmax(np.where(free, gain, -np.inf))))
            note()
            task.advance()
    new = tuple(taken[len(have) :])
    return Plan(new, np.array(left), np.array(condition), np.array(coverage), unknown_before, unknown())


def _conditions(prior: Prior, taken: list[int], blended: int) -> F64:
    """Condition numbers [M] with the views taken."""
    if not taken:
        return np.full(len(prior.seen), np.inf)
    spread = prior.spread[:, taken].astype(np.float64)
    grams = prior.correlation[:, taken][:, :, taken] * spread[:, :, None] * spread[:, None, :]
    return condition_numbers(blend_spectra(grams, [len(taken)], prior.kernels)[0], blended)


def uniform_views(directions: F64, count: int, first: int = 0) -> I64:
    """``count`` of the directions [V, 3], each the one farthest from those before it."""
    chosen = [first]
    nearest = directions @ directions[first]
    while len(chosen) < min(count, len(directions)):
        chosen.append(int(np.argmin(nearest)))
        nearest = np.maximum(nearest, directions @ directions[chosen[-1]])
    return np.array(chosen)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How well views determine blends and representatives: ranks and condition numbers (paper, section 5).

Blend optimisation matrix s*_x [k, J] of a point: the responses of the J generic kernels in the k views that
see it. n - 1 blend weights are free, so its rank must be n - 1 at least, and the condition number is the
largest singular value over the (n - 1)th. Representative optimisation matrix s* [kM, J] of all points: its
rank must be J.

Responses are those to the light's mean over the channels. A white light has three equal channels, whose
blocks side by side would triple every singular value and hide that one view determines one weight.

Singular values are roots of the eigenvalues of Gram matrices, [k, k] a point and [J, J] in all, which a
stream of tiles adds up; so those below 1e-7 of the largest are rounding. Least squares from K rows with
noise of a share p of their root mean square, sigma_1 / sqrt(K) for the largest singular value, leaves weights
with a standard deviation of p sigma_1 / (sqrt(K) sigma_i) along the i-th direction: where that is above 1,
more than a whole weight, the direction counts as not determined. A view lowers a rank only where it is
brighter than those before it, for the noise is a share of what is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import F32, F64, I32, I64, Bool, unit
from ..capture import Camera
from ..light import Environment
from ..observe import Lights
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..response import generic_responses
from ..surface import RayScene, SkyMasks, SurfacePoints, points_in_sight, sky_of_points
from .directions import Directions

NOISE = 0.01
"""Relative noise of a good linear photograph, the default."""
BLENDED = 4
"""n that the paper's analysis assumes."""
PAIRS_AT_ONCE = 1 << 15


@dataclass(frozen=True, eq=False)
class Conditioning:
    """What a set of views determines, for the first k of them by each of ``counts``."""

    counts: tuple[int, ...]
    noise: float
    """Relative, of a measurement."""
    blended: int
    """n."""
    blend: F64
    """[len(counts), M, S] singular values of each point's blend matrix, falling, 0 beyond its views."""
    representative: F64
    """[len(counts), J] singular values of the representative matrix, falling, over root kM."""
    views: I32
    """[len(counts), M] views of each point."""

    @cached_property
    def ranks(self) -> I32:
        """[len(counts), M] rank of each point's blend matrix above the noise."""
        return self._rank(self.blend, self.views)

    @cached_property
    def conditions(self) -> F64:
        """[len(counts), M] condition number at the (n - 1)th singular value; infinite below that rank."""
        return condition_numbers(self.blend, self.blended)

    @cached_property
    def representative_ranks(self) -> I32:
        """[len(counts)] rank of the representative matrix above the noise."""
        return self._rank(self.representative, self.views.sum(axis=1))

    @cached_property
    def weight_errors(self) -> F64:
        """[len(counts), M] standard deviation of blend weights along the (n - 1)th direction, from noise."""
        return self.noise * self.conditions / np.sqrt(np.maximum(self.views, 1))

    def _rank(self, singular: F64, rows: I32) -> I32:
        least = self.noise * singular[..., 0] / np.sqrt(np.maximum(rows, 1))
        return np.asarray(np.count_nonzero(singular > least[..., None], axis=-1), dtype=np.int32)


@dataclass(frozen=True, eq=False)
class Views:
    """Which of k views see which of M points, under what light."""

    points: SurfacePoints
    sky: SkyMasks
    seen: Bool
    """[M, k]"""
    viewer: F64
    """[k, 3] camera positions, world."""
    lights: Lights | Directions
    """Of the k views."""

    @classmethod
    def of(
        cls,
        scene: RayScene,
        points: SurfacePoints,
        cameras: Sequence[Camera],
        lights: Lights | Directions | Environment,
        sky: SkyMasks | None = None,
    ) -> Views:
        """Trace what cameras see of a scene's points; an environment lights all of them alike."""
        seen = np.stack([points_in_sight(scene, points, camera) for camera in cameras], axis=1)
        if isinstance(lights, Environment):
            k = len(cameras)
            still = np.broadcast_to(np.eye(3), (k, 3, 3)).copy()
            lights = Lights((lights,), np.zeros(k, np.int32), still)
        viewer = np.stack([camera.position for camera in cameras])
        return cls(points, sky_of_points(scene, points) if sky is None else sky, seen, viewer, lights)

    def pairs(self, part: slice) -> tuple[I64, I64]:
        """Point [P] and view [P] of what is seen of some points, in order."""
        point, view = np.nonzero(self.seen[part])
        return point + part.start, view

    def to_viewer(self, point: I64, view: I64) -> F64:
        """Unit directions [P, 3] to the camera."""
        return unit(self.viewer[view] - self.points.position[point])

    def cosine(self, point: I64, view: I64) -> F64:
        """n.o [P]."""
        return np.asarray(np.einsum("px,px->p", self.to_viewer(point, view), self.points.normal[point]))

    def responses(self, basis: GenericBasis, point: I64, view: I64) -> F32:
        """Responses [P, J] of the generic kernels to the light's mean over the channels (Eq. 13)."""
        normal, to_viewer = self.points.normal[point], self.to_viewer(point, view)
        if isinstance(self.lights, Directions):
            return self.lights.responses(basis, normal, to_viewer, view, self.sky, point)
        found = self.lights.each(
            view.astype(np.int32),
            normal,
            to_viewer.astype(np.float32),
            self.sky,
            point,
            basis.kernels,
            lambda *a: generic_responses(basis, *a),
        )
        return np.asarray(found.mean(axis=2))


def conditioning(
    views: Views,
    basis: GenericBasis,
    counts: Sequence[int] | None = None,
    noise: float = NOISE,
    blended: int = BLENDED,
    progress: Progress = SILENT,
) -> Conditioning:
    """Ranks and spectra for the first k views, for each k of ``counts`` (all, by default).

    Points that none of the views sees are left out of ranks and conditions by having no singular values.
    """
    count, most = views.seen.shape
    counts = tuple(counts or range(1, most + 1))
    found = np.zeros((len(counts), count, min(most, basis.kernels)))
    total = np.zeros((most, basis.kernels, basis.kernels))
    step = max(1, PAIRS_AT_ONCE // max(1, int(np.ceil(views.seen.mean() * most))))
    with progress.stage("Conditioning", count) as task:
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            point, view = views.pairs(part)
            responses = views.responses(basis, point, view).astype(np.float64)
            found[:, part] = _blend_spectra(responses, point - start, view, part.stop - start, most, counts)
            for v in np.unique(view):
                rows = responses[view == v]
                total[v] += rows.T @ rows
            task.advance(part.stop - start)
    cumulated, grams = np.cumsum(views.seen, axis=1), np.cumsum(total, axis=0)
    representative = np.stack(
        [singular_values(grams[k - 1]) / np.sqrt(max(cumulated[:, k - 1].sum(), 1)) for k in counts]
    )
    seen_by = np.stack([cumulated[:, k - 1] for k in counts]).astype(np.int32)
    return Conditioning(counts, noise, blended, found, representative, seen_by)


def _blend_spectra(
    responses: F64, point: I64, view: I64, points: int, most: int, counts: Sequence[int]
) -> F64:
    """Singular values [len(counts), points, S] from the responses [P, J] of pairs."""
    rows = np.zeros((points, most, responses.shape[1]))
    rows[point, view] = responses
    return blend_spectra(np.einsum("xij,xkj->xik", rows, rows, optimize=True), counts, responses.shape[1])


def blend_spectra(grams: F64, counts: Sequence[int], kernels: int) -> F64:
    """Singular values [len(counts), points, S] of blend matrices with Gram matrices [points, k, k].

    The first views' Gram matrix is the leading block; a view that does not see the point is a row of zeros.
    """
    most = grams.shape[-1]
    found = np.zeros((len(counts), len(grams), min(most, kernels)))
    for c, k in enumerate(counts):
        singular = singular_values(grams[:, :k, :k])[:, : found.shape[2]]
        found[c, :, : singular.shape[1]] = singular
    return found


def condition_numbers(singular: F64, blended: int) -> F64:
    """Of singular values [..., S], falling: the first over the (n - 1)th; infinite below that rank."""
    wanted = max(blended - 1, 1)
    if singular.shape[-1] < wanted:
        return np.full(singular.shape[:-1], np.inf)
    first, last = singular[..., 0], singular[..., wanted - 1]
    # Below the rounding of Gram matrices nothing is known.
    known = last > 1e-7 * first
    return np.where(known, first / np.where(known, last, 1.0), np.inf)


def singular_values(grams: F64) -> F64:
    """Singular values, falling, from Gram matrices [..., D, D]."""
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(grams)[..., ::-1], 0.0)))

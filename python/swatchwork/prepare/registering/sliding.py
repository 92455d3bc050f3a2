# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Poses and points that slide on a mesh: their objective, its normal equations, and steps down it.

With W the coupling of points and poses and V = L L^T the points' own blocks (2x2, or 3x3 with an error of
the scan), a step of the poses solves (U - Y^T Y) step = -slope + Y^T L^-1 slope_x, where Y = L^-1 W: the
points are eliminated exactly, and their steps follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError, solve
from scipy.sparse import csr_matrix

from swatchwork.arrays import F64, dot, norm
from swatchwork.capture import Camera
from swatchwork.prepare.registering.lifting import dropped, finite
from swatchwork.prepare.registering.motion import moved, projected
from swatchwork.prepare.registering.sighting import Sightings, tangents
from swatchwork.surface import RayScene

LOST_PX = 1e3
"""What a point that the camera cannot see at all counts as, along each axis."""

Extra = Callable[[str, Camera], tuple[F64, F64]]
"""A frame's further residuals F64[R], in standard deviations, and their derivatives F64[R, 6] by its step."""


@dataclass(frozen=True, eq=False)
class State:
    """Where everything is: k cameras, T points.

    Attributes:
        cameras: k of them.
        on_mesh: F64[T, 3]; ``normal`` F64[T, 3], unit, of the mesh there.
        offset: F64[T], of the points from the mesh along the normal; zero without an error of the scan.
    """

    cameras: list[Camera]
    on_mesh: F64
    normal: F64
    offset: F64

    @property
    def x(self) -> F64:
        """The points, F64[T, 3]."""
        return self.on_mesh + self.offset[:, None] * self.normal


@dataclass(frozen=True, eq=False)
class System:
    """The normal equations of one linearisation, d = 2 or 3 numbers a point.

    Attributes:
        pose, slope: F64[k, 6, 6] and F64[k, 6].
        point, point_slope: F64[T, d, d] and F64[T, d].
        across: F64[O, d, 6], of each sighting's point and pose.
        axes: F64[T, 3, d], the directions that points move along.
    """

    pose: F64
    slope: F64
    point: F64
    point_slope: F64
    across: F64
    axes: F64


@dataclass(frozen=True, eq=False)
class Problem:
    """What is minimised (see `bundle`): sightings in frames ``names``, of `coarseness` [k]; and options."""

    scene: RayScene
    names: list[str]
    seen: Sightings
    extra_terms: tuple[Extra, ...]
    scan_error: float
    held: frozenset[str]
    robust_px: float
    coarse: F64

    @cached_property
    def turn_px(self) -> F64:
        """Where each sighting's loss turns, F64[O]."""
        return self.robust_px * self.coarse[self.seen.frame]

    def errors(self, state: State) -> F64:
        """Residuals F64[O, 2] of the sightings in pixels."""
        uv = np.empty((len(self.seen), 2))
        x = state.x
        for camera, rows in zip(state.cameras, self.seen.rows, strict=True):
            uv[rows] = camera.project(x[self.seen.track[rows]])[0]
        return np.where(np.isfinite(uv), uv - self.seen.uv_px, LOST_PX)

    def objective(self, state: State) -> float:
        """In variances: a sum of squares of standard deviations, where no residual is large."""
        total = float(self.losses_of_tracks(state).sum())
        for name, camera in zip(self.names, state.cameras, strict=True):
            total += sum(float((term(name, camera)[0] ** 2).sum()) for term in self.extra_terms)
        return total

    def losses(self, state: State) -> F64:
        """Each sighting's part of the objective, F64[O]."""
        turn = self.turn_px**2
        squares = (self.errors(state) ** 2).sum(axis=1)
        return np.asarray(turn * np.log1p(squares / turn) / self.seen.deviation_px**2)

    def losses_of_tracks(self, state: State) -> F64:
        """Each track's part of the objective, F64[T]."""
        total = np.zeros(len(state.offset))
        np.add.at(total, self.seen.track, self.losses(state))
        return total + (state.offset / self.scan_error) ** 2 if self.scan_error > 0 else total

    def linearised(self, state: State) -> System:
        """The normal equations at a state, the robust loss as weights."""
        seen, k, count = self.seen, len(self.names), len(state.offset)
        d = 3 if self.scan_error > 0 else 2
        x, axes = state.x, tangents(state.normal)[:, :, :d]
        error, by_pose, by_point = (
            np.zeros((len(seen), 2)),
            np.zeros((len(seen), 2, 6)),
            np.zeros((len(seen), 2, d)),
        )
        for f, rows in enumerate(seen.rows):
            at = seen.track[rows]
            uv, by_step, by_x = projected(state.cameras[f], x[at])
            fine = finite(uv)
            error[rows] = np.where(fine[:, None], uv - seen.uv_px[rows], LOST_PX)
            by_point[rows] = np.where(fine[:, None, None], by_x, 0) @ axes[at]
            if self.names[f] not in self.held:
                by_pose[rows] = np.where(fine[:, None, None], by_step, 0)
        weight = 1 / (1 + (error**2).sum(axis=1) / self.turn_px**2) / seen.deviation_px**2
        weighted = by_pose * weight[:, None, None]
        pose, slope = np.zeros((k, 6, 6)), np.zeros((k, 6))
        for f, rows in enumerate(seen.rows):
            pose[f] = np.einsum("oai,oaj->ij", weighted[rows], by_pose[rows])
            slope[f] = np.einsum("oai,oa->i", weighted[rows], error[rows])
        point, point_slope = np.zeros((count, d, d)), np.zeros((count, d))
        np.add.at(point, seen.track, np.einsum("oia,oib,o->oab", by_point, by_point, weight))
        np.add.at(point_slope, seen.track, np.einsum("oia,oi,o->oa", by_point, error, weight))
        if self.scan_error > 0:
            point[:, 2, 2] += 1 / self.scan_error**2
            point_slope[:, 2] += state.offset / self.scan_error**2
        for f, (name, camera) in enumerate(zip(self.names, state.cameras, strict=True)):
            for term in self.extra_terms if name not in self.held else ():
                r, by_step = term(name, camera)
                pose[f] += by_step.T @ by_step
                slope[f] += by_step.T @ r
        across = np.einsum("oia,oij->oaj", by_point, weighted)
        return System(pose, slope, point, point_slope, across, axes)

    def reduced(self, system: System, damping: float) -> tuple[F64, F64, F64, csr_matrix]:
        """The poses' own equations: matrix F64[6k, 6k], right side F64[6k]; and L F64[T, d, d] and Y."""
        k, (count, d) = len(self.names), system.point_slope.shape
        lower = np.asarray(np.linalg.cholesky(damped(system.point, damping)), dtype=np.float64)
        block = np.linalg.solve(lower[self.seen.track], system.across)
        row = self.seen.track[:, None, None] * d + np.arange(d)[:, None]
        column = self.seen.frame[:, None, None] * 6 + np.arange(6)
        row, column = np.broadcast_arrays(row, column)
        y = csr_matrix((block.ravel(), (row.ravel(), column.ravel())), shape=(count * d, 6 * k))
        matrix = -np.asarray((y.T @ y).toarray(), dtype=np.float64)
        for f, own in enumerate(damped(system.pose, damping)):
            matrix[6 * f : 6 * f + 6, 6 * f : 6 * f + 6] += own
        half = np.linalg.solve(lower, system.point_slope[:, :, None]).ravel()
        return matrix, np.asarray(y.T @ half - system.slope.ravel()), lower, y

    def stepped(self, state: State, system: System, damping: float) -> tuple[State, float]:
        """The state after one damped step, its points on the mesh; and how far images move at most, px."""
        matrix, right, lower, y = self.reduced(system, damping)
        try:
            step = np.asarray(solve(matrix, right, assume_a="pos"))
        except (LinAlgError, ValueError):
            step = np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)
        half = np.linalg.solve(lower, system.point_slope[:, :, None])
        rest = -half - (y @ step).reshape(*half.shape)
        slide = np.linalg.solve(lower.transpose(0, 2, 1), rest)[:, :, 0]
        target = state.on_mesh + np.einsum("txa,ta->tx", system.axes[:, :, :2], slide[:, :2])
        on_mesh, normal, found = dropped(self.scene, target, state.normal)
        # Where there is no mesh below, or only another part of it, the point stays.
        near = norm(target - state.on_mesh) + self.scene.epsilon
        found &= np.abs(dot(on_mesh - target, state.normal)) <= near
        by_frame = step.reshape(-1, 6)
        cameras, length_px = [], 0.0
        for name, camera, one in zip(self.names, state.cameras, by_frame, strict=True):
            away = float(norm(camera.position - self.scene.centre))
            length_px = max(length_px, camera.fx * float(norm(one[:3]) + norm(one[3:]) / max(away, 1e-300)))
            cameras.append(camera if name in self.held else moved(camera, one))
        reached = State(
            cameras,
            np.where(found[:, None], on_mesh, state.on_mesh),
            np.where(found[:, None], normal, state.normal),
            state.offset + slide[:, 2] if slide.shape[1] == 3 else state.offset,
        )
        return reached, length_px

    def deviation(self, state: State) -> F64:
        """Standard deviations F64[k, 6] of the poses' steps, points and the other poses being free."""
        deviation = np.zeros(6 * len(self.names))
        system = self.linearised(state)
        free = np.repeat(np.array([name not in self.held for name in self.names], dtype=bool), 6)
        diagonal = system.pose[:, np.arange(6), np.arange(6)].ravel()
        # A direction of a pose that no residual feels has nothing but the floor under it.
        felt = diagonal > 1e-10 * diagonal.max(initial=0.0)
        deviation[free & ~felt] = np.inf
        free = np.flatnonzero(free & felt)
        if not len(free):
            return deviation.reshape(-1, 6)
        matrix = self.reduced(system, 0.0)[0][np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        values, vectors = np.linalg.eigh(matrix / scale[:, None] / scale)
        inverse = np.where(values > 1e-12, 1 / np.maximum(values, 1e-12), np.inf)
        # What a direction without a hold does not move is not loose by it.
        share = np.where(np.abs(vectors) > 1e-9, vectors**2, 0.0)
        with np.errstate(invalid="ignore"):
            deviation[free] = np.sqrt(np.where(share > 0, share * inverse, 0.0).sum(axis=1)) / scale
        return deviation.reshape(-1, 6)


def damped(blocks: F64, damping: float) -> F64:
    """Blocks [n, d, d] with Marquardt's share of their diagonals added, and no zero left there."""
    out = blocks.copy()
    index = np.arange(blocks.shape[1])
    diagonal = blocks[:, index, index]
    out[:, index, index] += damping * diagonal + 1e-12 * max(float(diagonal.max(initial=0.0)), 1e-280)
    return out

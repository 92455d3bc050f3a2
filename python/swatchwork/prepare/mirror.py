# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A mirror ball in a photograph: which direction each pixel shows, and where each direction is seen.

Everything here is in the camera's axes (x right, y up, looking along -z), and the ball's radius is the unit.
Seen from the ball, let `gamma` be the angle between the reflected direction and the direction of the camera,
and `beta` that between the normal and the camera. In the plane of the two, with the camera D radii away,

    gamma = 2 beta + atan2(sin beta, D - cos beta),        beta from 0 to arccos(1 / D),

which grows with beta: every direction is seen once, but for a cone behind the ball of half angle arcsin(1/D).
An orthographic camera is D = infinity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from swatchwork.arrays import F64, Float, dot, norm, unit
from swatchwork.capture import Camera

TABLE = 4096
"""Steps of beta from which Newton's method starts: it is then at rounding after two steps."""


class Ball(Protocol):
    """What the resampling asks of a ball."""

    @property
    def model(self) -> str:
        """ "perspective" or "orthographic"."""

    @property
    def towards_camera(self) -> F64:
        """Unit direction F64[3] from the ball to the camera."""

    @property
    def blind_rad(self) -> float:
        """Half angle of the cone behind the ball that it does not show."""

    def outline(self, count: int = 720) -> F64:
        """Image points F64[count, 2] of the ball's outline."""

    def residual_px(self, uv_px: Float) -> F64:
        """Signed distances F64[P] of image points from the outline, positive outside."""

    def reflect(self, uv_px: Float) -> tuple[F64, F64]:
        """Directions F64[P, 3] that image points [P, 2] show, and cosines F64[P] of normal and viewer.

        NaN beside the ball.
        """

    def seen_at(self, d: Float) -> tuple[F64, F64]:
        """Image points F64[P, 2] where directions [P, 3] are seen, and the cosines; NaN in the blind cone."""


@dataclass(frozen=True, eq=False)
class PerspectiveBall:
    """A ball before a known camera.

    Attributes:
        camera: the lens; its pose is the identity.
        centre: F64[3], the ball's centre in the camera's axes, in radii.
    """

    camera: Camera
    centre: F64
    model: str = "perspective"

    @classmethod
    def fit(cls, camera: Camera, uv_px: Float) -> PerspectiveBall | None:
        """The ball whose outline is nearest to image points [P, 2], or None where no ball has such a one.

        The rays q that touch a ball make a circular cone, q . w = 1 with w = axis / cos(half angle), which is
        linear in w and exact off the axis, where the outline is an ellipse.
        """
        rays = camera.rays(uv_px)
        rays = rays[np.isfinite(rays).all(axis=1)]
        if len(rays) < 3:
            return None
        w, _, rank, _ = np.linalg.lstsq(rays, np.ones(len(rays)), rcond=None)
        length = float(np.linalg.norm(w))
        if rank < 3 or not 1 + 1e-9 < length < 1e3:
            return None
        # cos(half angle) = 1 / |w| and sin(half angle) = 1 / D.
        return cls(camera, w / length / np.sqrt(1 - 1 / length**2))

    @property
    def distance(self) -> float:
        """Of the ball's centre from the camera, in radii."""
        return float(np.linalg.norm(self.centre))

    @property
    def towards_camera(self) -> F64:
        return -self.centre / self.distance

    @property
    def blind_rad(self) -> float:
        return float(np.arcsin(1 / self.distance))

    def outline(self, count: int = 720) -> F64:
        axis = -self.towards_camera
        across, up = _across(axis)
        t = np.linspace(0, 2 * np.pi, count, endpoint=False)[:, None]
        around = np.cos(t) * across + np.sin(t) * up
        uv_px, _ = self.camera.project(np.cos(self.blind_rad) * axis + np.sin(self.blind_rad) * around)
        return uv_px

    def residual_px(self, uv_px: Float) -> F64:
        rays = self.camera.rays(uv_px)
        angle = np.arccos(np.clip(rays @ -self.towards_camera, -1, 1)) - self.blind_rad
        # A pixel's angle shrinks as the squared cosine off the axis along the radius, its root across it.
        return np.asarray(angle * np.sqrt(self.camera.fx * self.camera.fy) / np.abs(rays[:, 2]) ** 1.5)

    def reflect(self, uv_px: Float) -> tuple[F64, F64]:
        q = self.camera.rays(uv_px)
        along = q @ self.centre
        inside = along**2 - (self.distance**2 - 1)
        hit = (inside >= 0) & (along > 0)
        t = np.where(hit, along - np.sqrt(np.where(hit, inside, 0)), np.nan)
        n = t[:, None] * q - self.centre
        cosine = -dot(q, n)
        return q + 2 * cosine[:, None] * n, cosine

    def seen_at(self, d: Float) -> tuple[F64, F64]:
        beta, n = _normals(np.asarray(d, dtype=np.float64), self.towards_camera, self.distance)
        point = self.centre + n
        uv_px, _ = self.camera.project(point)
        cosine = -dot(n, unit(point))
        blind = ~np.isfinite(beta)
        return np.where(blind[:, None], np.nan, uv_px), np.where(blind, np.nan, cosine)


@dataclass(frozen=True, eq=False)
class OrthographicBall:
    """A ball so far away that all rays to it are parallel to the optical axis.

    Attributes:
        centre_px: F64[2].
        radius_px: of its outline, a circle.
    """

    centre_px: F64
    radius_px: float
    model: str = "orthographic"

    @classmethod
    def fit(cls, uv_px: Float) -> OrthographicBall | None:
        """The circle nearest to image points [P, 2] (algebraic least squares); None: there is none."""
        uv_px = np.asarray(uv_px, dtype=np.float64)
        if len(uv_px) < 3:
            return None
        middle = uv_px.mean(axis=0)
        x = uv_px - middle
        system = np.column_stack([2 * x, np.ones(len(x))])
        (a, b, c), _, rank, _ = np.linalg.lstsq(system, (x**2).sum(axis=1), rcond=None)
        square = c + a * a + b * b
        if rank < 3 or not square > 0:
            return None
        return cls(middle + np.array([a, b]), float(np.sqrt(square)))

    @property
    def towards_camera(self) -> F64:
        return np.array([0.0, 0.0, 1.0])

    @property
    def blind_rad(self) -> float:
        return 0.0

    def outline(self, count: int = 720) -> F64:
        t = np.linspace(0, 2 * np.pi, count, endpoint=False)
        return self.centre_px + self.radius_px * np.column_stack([np.cos(t), np.sin(t)])

    def residual_px(self, uv_px: Float) -> F64:
        off = np.asarray(uv_px, dtype=np.float64) - self.centre_px
        return np.asarray(np.hypot(off[:, 0], off[:, 1]) - self.radius_px)

    def reflect(self, uv_px: Float) -> tuple[F64, F64]:
        xy = (np.asarray(uv_px, dtype=np.float64) - self.centre_px) / self.radius_px * [1, -1]
        square = (xy**2).sum(axis=1)
        cosine = np.where(square <= 1, np.sqrt(np.maximum(1 - square, 0)), np.nan)
        n = np.column_stack([xy, cosine])
        return 2 * cosine[:, None] * n - self.towards_camera, cosine

    def seen_at(self, d: Float) -> tuple[F64, F64]:
        _, n = _normals(np.asarray(d, dtype=np.float64), self.towards_camera, np.inf)
        return self.centre_px + self.radius_px * n[:, :2] * [1, -1], n[:, 2].copy()


def _normals(d: F64, towards: F64, distance: float) -> tuple[F64, F64]:
    """beta F64[P] and normals F64[P, 3] that reflect the camera's rays to directions [P, 3]; NaN: none."""
    ahead = d @ towards
    aside = d - ahead[:, None] * towards
    across = norm(aside)
    gamma = np.arctan2(across, ahead)
    if np.isinf(distance):
        beta = gamma / 2
    else:
        largest = np.arccos(1 / distance)
        table = np.linspace(0, largest, TABLE)
        beta = np.interp(gamma, _gamma(table, distance), table)
        for _ in range(2):
            cosine = np.cos(beta)
            slope = 2 + (distance * cosine - 1) / (1 + distance**2 - 2 * distance * cosine)
            beta = np.clip(beta - (_gamma(beta, distance) - gamma) / slope, 0, largest)
        beta = np.where(gamma < largest + np.pi / 2, beta, np.nan)
    e = aside / np.where(across > 0, across, 1.0)[:, None]
    return beta, np.cos(beta)[:, None] * towards + np.sin(beta)[:, None] * e


def _gamma(beta: F64, distance: float) -> F64:
    return np.asarray(2 * beta + np.arctan2(np.sin(beta), distance - np.cos(beta)))


def _across(axis: F64) -> tuple[F64, F64]:
    """Two unit vectors at right angles to ``axis`` and to each other."""
    helper = np.eye(3)[int(np.abs(axis).argmin())]
    across = unit(np.cross(axis, helper))
    return across, np.cross(axis, across)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A calibrated camera: OpenCV's radial-tangential lens, OpenGL axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F64, Bool, Float, unit
from swatchwork.capture.guarding import MOST_PIXELS
from swatchwork.errors import InputError

FARTHEST = 1e12
"""World units from the origin at most, of cameras and meshes: squares and volumes stay finite in 32 bits."""

LARGEST = 1e9
"""Of intrinsics: beyond it, no lens, and the distortion's polynomials would overflow."""

RIGID_TOLERANCE = 1e-3
"""Largest entry of R^T R - I that still counts as rounding in a written pose (four decimals give 2e-4)."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics in pixels, with pixel centres at +0.5, and a pose.

    Attributes:
        width, height: image size in pixels.
        fx, fy, cx, cy: focal lengths and principal point in pixels.
        k1, k2, p1, p2: OpenCV's radial and tangential distortion (of x right, y down).
        world_from_camera: F64[4, 4], rigid; camera axes x right, y up, looking along -z.

    Raises:
        InputError: a size or focal length is not positive, a number is not finite, or the pose is not
            a rotation and a translation.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    world_from_camera: F64
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} {getattr(self, name)}", expected="a positive number of pixels")
        if self.width * self.height > MOST_PIXELS:
            raise InputError(
                f"the size is {self.width} x {self.height}", expected=f"{MOST_PIXELS} pixels in all at most"
            )
        for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"):
            value = getattr(self, name)
            if not np.isfinite(value):
                raise InputError(f"{name} is {value}", expected="a finite number")
            if name in ("fx", "fy") and value <= 0:
                raise InputError(f"focal length {name} is {value:g}", expected="a positive number of pixels")
            if abs(value) > LARGEST:
                raise InputError(f"{name} is {value:g}", expected=f"at most {LARGEST:g}")
        object.__setattr__(self, "world_from_camera", rigid(self.world_from_camera, "pose"))

    @property
    def position(self) -> F64:
        """Centre of projection in the world, F64[3]."""
        return self.world_from_camera[:3, 3].copy()

    @property
    def _distorts(self) -> bool:
        return any((self.k1, self.k2, self.p1, self.p2))

    def project(self, x_in_world: Float) -> tuple[F64, F64]:
        """Where points appear in the image.

        Args:
            x_in_world: [P, 3].

        Returns:
            uv_px F64[P, 2] in distorted pixels, and depth F64[P] along the optical axis, positive in
            front. A point that no ray of this lens meets (behind the camera, or so far out that the
            distortion polynomial has turned back) has uv_px = NaN: test before rounding to pixels.
        """
        x_in_world = np.asarray(x_in_world, dtype=np.float64).reshape(-1, 3)
        x_in_camera = (x_in_world - self.position) @ self.world_from_camera[:3, :3]
        depth = -x_in_camera[:, 2]
        in_front = depth > 0
        xy = x_in_camera[:, :2] * [1.0, -1.0] / np.where(in_front, depth, 1.0)[:, None]
        visible = in_front
        if self._distorts:
            visible = in_front & self._in_range(xy)
            xy = self._distorted(np.where(visible[:, None], xy, 0.0))
        uv_px = xy * [self.fx, self.fy] + [self.cx, self.cy]
        return np.where(visible[:, None], uv_px, np.nan), depth

    def slopes(self, x_in_world: Float) -> F64:
        """Derivatives F64[P, 2, 3] of `project`'s uv_px by the points' coordinates along the camera axes."""
        x_in_world = np.asarray(x_in_world, dtype=np.float64).reshape(-1, 3)
        x_in_camera = (x_in_world - self.position) @ self.world_from_camera[:3, :3]
        depth = -x_in_camera[:, 2]
        xy = x_in_camera[:, :2] * [1.0, -1.0] / depth[:, None]
        by_camera = np.zeros((len(xy), 2, 3))
        by_camera[:, 0, 0], by_camera[:, 1, 1] = 1 / depth, -1 / depth
        by_camera[:, :, 2] = xy / depth[:, None]
        if self._distorts:
            xx, cross, yy = self._jacobian(xy)
            by_camera = np.stack([[xx, cross], [cross, yy]]).transpose(2, 0, 1) @ by_camera
        return np.asarray(by_camera * [[self.fx], [self.fy]])

    def rays(self, uv_px: Float) -> F64:
        """Unit directions in the world, F64[P, 3], that image points [P, 2] look along from `position`.

        Image points that the lens model does not reach give NaN.
        """
        uv_px = np.asarray(uv_px, dtype=np.float64).reshape(-1, 2)
        xy = (uv_px - [self.cx, self.cy]) / [self.fx, self.fy]
        if self._distorts:
            xy = self._undistorted(xy)
        d_in_camera = np.column_stack([xy[:, 0], -xy[:, 1], -np.ones(len(xy))])
        return unit(d_in_camera) @ self.world_from_camera[:3, :3].T

    def pixel_centres(self) -> F64:
        """Centres of all pixels, F64[H * W, 2], row by row."""
        v, u = np.mgrid[0 : self.height, 0 : self.width] + 0.5
        return np.stack([u, v], axis=-1).reshape(-1, 2)

    def _distorted(self, xy: F64) -> F64:
        x, y = xy[:, 0], xy[:, 1]
        s = x * x + y * y
        radial = 1 + s * (self.k1 + s * self.k2)
        return np.column_stack(
            [
                x * radial + 2 * self.p1 * x * y + self.p2 * (s + 2 * x * x),
                y * radial + self.p1 * (s + 2 * y * y) + 2 * self.p2 * x * y,
            ]
        )

    def _jacobian(self, xy: F64) -> tuple[F64, F64, F64]:
        """Derivatives of `_distorted` (dx'/dx, dx'/dy = dy'/dx, dy'/dy): the matrix is symmetric."""
        x, y = xy[:, 0], xy[:, 1]
        s = x * x + y * y
        radial = 1 + s * (self.k1 + s * self.k2)
        slope = 2 * (self.k1 + 2 * s * self.k2)
        xx = radial + x * x * slope + 2 * self.p1 * y + 6 * self.p2 * x
        xy_ = x * y * slope + 2 * self.p1 * x + 2 * self.p2 * y
        yy = radial + y * y * slope + 6 * self.p1 * y + 2 * self.p2 * x
        return xx, xy_, yy

    @property
    def _largest_s(self) -> float:
        """Squared radius where r (1 + k1 r^2 + k2 r^4) first turns back, or infinity."""
        roots = np.roots([5 * self.k2, 3 * self.k1, 1.0])
        turning = [root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0]
        return min(turning, default=np.inf)

    def _in_range(self, xy: F64) -> Bool:
        """Whether undistorted points lie where the distortion is still one to one."""
        xx, xy_, yy = self._jacobian(xy)
        return np.asarray(((xy**2).sum(axis=1) < self._largest_s) & (xx * yy - xy_**2 > 0))

    def _undistorted(self, target: F64) -> F64:
        """Newton's method; quadratic, so a dozen steps reach rounding wherever a solution exists."""
        limit = np.sqrt(self._largest_s) * (1 - 1e-9)
        xy = target.copy()
        for _ in range(20):
            # Stay inside the range where the map is one to one, so that only its root can be found.
            radius = np.linalg.norm(xy, axis=1, keepdims=True)
            xy = xy * np.minimum(1.0, limit / np.maximum(radius, 1e-300))
            error = self._distorted(xy) - target
            xx, xy_, yy = self._jacobian(xy)
            determinant = xx * yy - xy_**2
            determinant = np.where(np.abs(determinant) < 1e-12, 1e-12, determinant)
            step_x = (yy * error[:, 0] - xy_ * error[:, 1]) / determinant
            step_y = (xx * error[:, 1] - xy_ * error[:, 0]) / determinant
            xy = xy - np.column_stack([step_x, step_y])
            if np.max(np.abs(error), initial=0.0) < 1e-14:
                break
        miss = np.linalg.norm(self._distorted(xy) - target, axis=1)
        # A millionth of a pixel at a focal length of a thousand.
        found = (miss < 1e-9) & self._in_range(xy)
        return np.where(found[:, None], xy, np.nan)


def rigid(matrix: Float, what: str) -> F64:
    """A rigid transform F64[4, 4] from a written one ([4, 4] or [3, 4]), its rounding taken out.

    Raises:
        InputError: wrong shape, not finite, not a rotation and translation, or mirrored.
    """
    m = np.asarray(matrix, dtype=np.float64)
    if m.shape not in ((4, 4), (3, 4)):
        raise InputError(f"{what} of shape {list(m.shape)}", expected="a 4x4 matrix")
    if not np.isfinite(m).all():
        raise InputError(f"{what} contains {m[~np.isfinite(m)][0]}", expected="finite numbers")
    if np.abs(m[:3, 3]).max() > FARTHEST:
        raise InputError(
            f"{what} has the translation {m[:3, 3].tolist()}",
            expected=f"at most {FARTHEST:g} world units from the origin",
        )
    if m.shape == (4, 4) and np.abs(m[3] - [0, 0, 0, 1]).max() > 1e-6:
        raise InputError(f"{what} has the last row {m[3].tolist()}", expected="[0, 0, 0, 1]")
    rotation = m[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(rotation.T @ rotation - np.eye(3)).max()
    # Numbers so large that they cancel to NaN are not rigid either.
    if not off <= RIGID_TOLERANCE:
        with np.errstate(over="ignore"):
            lengths = ", ".join(f"{length:.4g}" for length in np.linalg.norm(rotation, axis=0))
        raise InputError(
            f"{what} is not rigid: its axes have lengths {lengths} and R^T R differs from I by {off:.3g}",
            expected="a rotation and a translation",
            hint="Apply any scale to the mesh and the camera positions instead",
        )
    if np.linalg.det(rotation) < 0:
        raise InputError(
            f"{what} is mirrored (determinant -1)",
            expected="a rotation (determinant +1)",
            hint="Camera axes are OpenGL's: x right, y up, looking along -z",
        )
    result = np.eye(4)
    result[:3] = m[:3]
    if off > 1e-9:
        u, _, vt = np.linalg.svd(rotation)
        result[:3, :3] = u @ vt
    return result

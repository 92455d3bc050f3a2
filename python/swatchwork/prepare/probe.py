# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A light probe from one or more photographs of a mirror ball."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F32, F64, Bool
from swatchwork.errors import InputError
from swatchwork.light import Environment, solid_angles
from swatchwork.prepare.panorama import Mirror, Panorama, View, panorama, pixel_centres
from swatchwork.prepare.turning import CONVENTION, estimate_turn

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
GOOD = 0.1
"""Weight from which on a texel counts in the agreement of two views: n.o above 0.3, and no photographer."""
TURNING_WIDTH = 256
BORDER = 1500
"""Texels at most that an unseen one is filled from."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """A view against the first one, where both see well.

    Attributes:
        nrms: root mean square difference over the first's root mean square; None without an overlap.
        exposure: median ratio of its radiance to the first's.
        overlap: share of the sphere.
        correlation: of the rotation's estimate; None where poses were given.
    """

    nrms: float | None
    exposure: float | None
    overlap: float
    correlation: float | None


@dataclass(frozen=True, eq=False)
class Probe:
    """The light, and what is known of it.

    Attributes:
        environment: the map; its own axes are the world's.
        unseen: F32[H, W], 1 where no view sees and the map was filled in.
        clipped: F32[H, W], share of a texel that is clipped in the views it comes from.
        unseen_sr: solid angle that was filled in.
        clipped_share: share of the sphere's solid angle that is clipped.
        scalar_irradiance: F64[3], integral of radiance over all directions, without a cosine.
        clipped_scalar_irradiance: F64[3], the clipped texels' part of it as read. In truth it is at least
            that where a clipped channel reads no more than its light (RAW through a colour matrix can).
        world_from_cameras: F64[V, 3, 3].
        agreements: of the second view and on with the first.
        rerendered: RMS difference of the map seen on the ball and each photograph, over the photograph's.
    """

    environment: Environment
    unseen: F32
    clipped: F32
    unseen_sr: float
    clipped_share: float
    scalar_irradiance: F64
    clipped_scalar_irradiance: F64
    world_from_cameras: F64
    agreements: tuple[Agreement, ...]
    rerendered: tuple[float, ...]


def default_width(views: Sequence[View]) -> int:
    """The power of two next to what the largest ball resolves: pi radii across at its middle."""
    largest = max(view.outline.radius_px for view in views)
    return int(np.clip(2 ** round(np.log2(np.pi * largest)), 64, 4096))


def probe_of_views(
    views: Sequence[View],
    poses: Sequence[F64 | None],
    *,
    convention: str = "blender",
    width: int | None = None,
    mirror: Mirror | None = None,
) -> Probe:
    """Merge views of a ball to one map in world axes.

    Args:
        poses: F64[3, 3] rotation world_from_camera of each view. None for the first makes its camera's axes
            the world; None for another one has its rotation estimated.
        convention: "blender" or "mitsuba".
        width: of the map; by default `default_width`.
        mirror: the ball's reflectance, which is divided out; by default 1.

    Raises:
        InputError: no view, no such convention or width, no light, or views that do not agree.
    """
    if convention not in ("blender", "mitsuba"):
        raise InputError(f"convention {convention!r}", expected="blender or mitsuba, which are lat-long maps")
    if width is not None and (width < 16 or width > 8192 or width % 2):
        raise InputError(f"--width is {width}", expected="an even number from 16 to 8192")
    mirror = mirror or Mirror(np.ones(3))
    width = width or default_width(views)
    turns, correlations = _rotations(views, poses, mirror)
    maps = [panorama(view, turn, convention, width, mirror) for view, turn in zip(views, turns, strict=True)]
    total = sum(m.weight.astype(np.float64) for m in maps)
    share = np.maximum(total, 1e-300)
    radiance = sum(m.radiance * m.weight[..., None].astype(np.float64) for m in maps) / share[..., None]
    clipped = np.asarray(sum(m.clipped * m.weight for m in maps) / share, dtype=np.float32)
    unseen = np.asarray(total <= 0)
    area = solid_angles(convention, width // 2, width)
    filled = _filled(radiance, unseen, convention)
    environment = Environment(filled.astype(np.float32), convention, name="the probe")
    return Probe(
        environment,
        unseen.astype(np.float32),
        clipped,
        float(area[unseen].sum()),
        float((area * clipped).sum() / (4 * np.pi)),
        np.asarray((area[..., None] * filled).sum(axis=(0, 1))),
        np.asarray(((area * clipped)[..., None] * filled).sum(axis=(0, 1))),
        turns,
        tuple(_agreement(maps[0], m, area, c) for m, c in zip(maps[1:], correlations, strict=True)),
        tuple(
            rerendered_nrms(view, environment, turn, mirror) for view, turn in zip(views, turns, strict=True)
        ),
    )


def rerender(view: View, environment: Environment, world_from_camera: F64, mirror: Mirror) -> F32:
    """The map seen on the ball, F32[H, W, 3] as the view's photograph; 0 beside the ball."""
    height, width = view.radiance.shape[:2]
    d, cosine = view.outline.ball.reflect(pixel_centres(width, height))
    on = np.isfinite(cosine)
    picture = np.zeros((height * width, 3), np.float32)
    picture[on] = environment.lookup(d[on] @ world_from_camera.T) * mirror.reflectance(cosine[on])
    return picture.reshape(height, width, 3)


def rerendered_nrms(view: View, environment: Environment, world_from_camera: F64, mirror: Mirror) -> float:
    """RMS difference of `rerender` and the photograph over the photograph's, 5 % inside the outline."""
    height, width = view.radiance.shape[:2]
    off = view.outline.ball.residual_px(pixel_centres(width, height)).reshape(height, width)
    within = (off < -0.05 * view.outline.radius_px) & ~view.clipped
    if not within.any():
        return 0.0
    found = rerender(view, environment, world_from_camera, mirror)[within]
    truth = view.radiance[within]
    power = float((truth.astype(np.float64) ** 2).sum())
    return float(np.sqrt(((found - truth).astype(np.float64) ** 2).sum() / power)) if power > 0 else 0.0


def _rotations(
    views: Sequence[View], poses: Sequence[F64 | None], mirror: Mirror
) -> tuple[F64, list[float | None]]:
    """world_from_camera F64[V, 3, 3], and the correlations of those estimated, from the second view on."""
    first = poses[0] if poses[0] is not None else np.eye(3)
    turns, correlations = [first], list[float | None]()
    own: Panorama | None = None
    for view, pose in zip(views[1:], poses[1:], strict=True):
        if pose is not None:
            turns.append(pose)
            correlations.append(None)
            continue
        own = own or panorama(views[0], np.eye(3), CONVENTION, TURNING_WIDTH, mirror)
        other = panorama(view, np.eye(3), CONVENTION, TURNING_WIDTH, mirror)
        turn = estimate_turn(own, other, view.name)
        turns.append(first @ turn.first_from_second)
        correlations.append(turn.correlation)
    return np.stack(turns), correlations


def _agreement(first: Panorama, other: Panorama, area: F64, correlation: float | None) -> Agreement:
    both = (first.weight > GOOD) & (other.weight > GOOD)
    share = float(area[both].sum() / (4 * np.pi))
    a, b = first.radiance[both].astype(np.float64), other.radiance[both].astype(np.float64)
    power = float((area[both][:, None] * a**2).sum())
    if power <= 0:
        return Agreement(None, None, share, correlation)
    nrms = float(np.sqrt((area[both][:, None] * (b - a) ** 2).sum() / power))
    bright = a @ LUMINANCE > 0
    ratio = float(np.median((b @ LUMINANCE)[bright] / (a @ LUMINANCE)[bright]))
    return Agreement(nrms, ratio, share, correlation)


def _filled(radiance: F64, unseen: Bool, convention: str) -> F64:
    """The map with unseen texels set to means of the border's, weighted by 1 / angle^2."""
    if not unseen.any():
        return radiance
    if unseen.all():
        raise InputError("no part of the ball can be used", expected="an outline of more than a few pixels")
    height, width = unseen.shape
    d = Environment(np.ones((height, width, 3), np.float32), convention).directions()
    up, down = np.vstack([unseen[:1], unseen[:-1]]), np.vstack([unseen[1:], unseen[-1:]])
    beside = np.roll(unseen, 1, axis=1) | np.roll(unseen, -1, axis=1) | up | down
    rows, columns = np.nonzero(beside & ~unseen)
    # Evenly thinned: nearness counts, not the number of texels.
    keep = np.linspace(0, len(rows) - 1, min(len(rows), BORDER)).astype(int)
    rows, columns = rows[keep], columns[keep]
    border_d, border = d[rows, columns], radiance[rows, columns]
    length = np.sin(np.pi * (rows + 0.5) / height)
    result = radiance.copy()
    at_rows, at_columns = np.nonzero(unseen)
    for start in range(0, len(at_rows), 4096):
        r, c = at_rows[start : start + 4096], at_columns[start : start + 4096]
        # A texel of the border counts by its width, so that the many at a pole do not outvote the rest.
        w = length / np.maximum(1 - d[r, c] @ border_d.T, 1e-8)
        result[r, c] = (w @ border) / w.sum(axis=1, keepdims=True)
    return result

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The outline of a mirror ball: a Hough transform for a start, then edges across it, robustly fitted."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from swatchwork.arrays import F32, F64, U8
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.mirror import Ball, OrthographicBall, PerspectiveBall

SEARCH_PX = 256
"""Longest side of the picture in which the start is looked for."""
CANDIDATES = 8
"""Circles to start from."""
RAYS = 720
SUPPORT = 0.4
"""Share of an outline that must lie on edges: textured pictures without a ball were seen to reach 0.3."""
TRIALS = 300
ALIGNED = 0.93
"""Cosine of the angle, 22 degrees, by which an edge's gradient may be off the outline's normal."""
TONES = (0.8, 0.9)
"""Quantiles of the picture's radiance taken as white."""
CUT = 0.005
"""Share of the outline outside the picture from which on the ball counts as cut."""


@dataclass(frozen=True, eq=False)
class Outline:
    """A ball, and how well its outline is known.

    Attributes:
        ball: the mirror.
        residual_px: root mean square distance of the edges from the outline (of the given shape, where one
            was given, from that of a ball before this camera).
        support: share of the outline within the picture that lies on an edge; 1 where it was given.
        cut: share of the outline outside the picture.
        radius_px: mean radius.
        found: whether it was looked for.
    """

    ball: Ball
    residual_px: float
    support: float
    cut: float
    radius_px: float
    found: bool


def given_outline(
    shape: tuple[float, ...], size: tuple[int, int], camera: Camera | None, name: str, *, allow_cut: bool
) -> Outline:
    """The ball with a given outline.

    Args:
        shape: circle (x, y, radius) or ellipse (x, y, semi-axis, semi-axis, degrees of the first one from
            right to down), in pixels with centres at +0.5.
        size: (width, height) of the photograph.
        camera: the lens; None is an orthographic one.

    Raises:
        InputError: no such shape, not the outline of a ball for this camera, or cut by the frame.
    """
    if len(shape) not in (3, 5) or not np.isfinite(shape).all() or min(shape[2:4]) <= 0:
        raise InputError(
            "the ball's outline is " + ",".join(f"{number:g}" for number in shape),
            file=name,
            expected="X,Y,RADIUS, or X,Y,SEMI-AXIS,SEMI-AXIS,DEGREES, in pixels",
        )
    a, b = shape[2], shape[3] if len(shape) == 5 else shape[2]
    if camera is None and a != b:
        raise InputError(
            "the ball's outline is an ellipse and the focal length is not known",
            file=name,
            expected="a circle, or --focal: without a focal length the camera is taken as orthographic",
        )
    turn = np.deg2rad(shape[4]) if len(shape) == 5 else 0.0
    t = np.linspace(0, 2 * np.pi, RAYS, endpoint=False)
    x, y = a * np.cos(t), b * np.sin(t)
    points = np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)])
    points += shape[:2]
    ball = _fit(points, camera)
    residual = _rms(ball.residual_px(points)) if ball is not None else np.inf
    if ball is None or not residual < 0.03 * max(a, b):
        raise InputError(
            f"the outline given is not that of a ball before this camera (it is {residual:.1f} px off)",
            file=name,
            expected="an ellipse that points to the principal point, or a circle near it",
            hint="Is the focal length in pixels, and of this photograph's size?",
        )
    return _checked(Outline(ball, residual, 1.0, 0.0, (a + b) / 2, False), size, name, allow_cut)


def find_outline(radiance: F32, camera: Camera | None, name: str, *, allow_cut: bool = False) -> Outline:
    """Look for the one ball in a photograph.

    Args:
        radiance: F32[H, W, 3], linear.
        camera: the lens; None is an orthographic one.

    Raises:
        InputError: no outline of a ball stands out, or the ball is cut by the frame.
    """
    tones = [_tone(radiance, quantile) for quantile in TONES]
    best: Outline | None = None
    for tone in tones:
        for start in _distinct(_candidates(tone)):
            ball = _refined(tone, start, camera)
            outline = _judged(tones, ball) if ball is not None else None
            # Reflections make rings within the ball: among outlines as good, the largest is the ball's.
            if outline and (best is None or _score(outline) > _score(best)):
                best = outline
    if best is None or best.support < SUPPORT:
        share = f" (the best circle has {100 * best.support:.0f} % of it on edges)" if best else ""
        raise InputError(
            f"no mirror ball stands out in the photograph{share}",
            file=name,
            expected="one ball, all of it in the picture and sharp",
            hint="Give its outline by --ball X,Y,RADIUS in pixels",
        )
    return _checked(best, (radiance.shape[1], radiance.shape[0]), name, allow_cut)


def ball_through(edges: F64, camera: Camera, tolerance_px: float = 1.5) -> PerspectiveBall | None:
    """The ball whose outline most of the points [E, 2] of an image lie on, fitted to those; or None."""
    if len(edges) < 3:
        return None
    ball = _most_edges(edges, camera, tolerance_px, np.random.default_rng(0))
    for _ in range(3):
        if ball is None:
            return None
        ball = _fit(edges[np.abs(ball.residual_px(edges)) < tolerance_px], camera)
    return ball if isinstance(ball, PerspectiveBall) else None


def _checked(outline: Outline, size: tuple[int, int], name: str, allow_cut: bool) -> Outline:
    """With the cut share; refused where that is too much."""
    points = outline.ball.outline(RAYS)
    inside = ((points >= 0) & (points <= size)).all(axis=1)
    cut = float(1 - inside.mean())
    if cut > CUT and not allow_cut:
        raise InputError(
            f"the ball is cut by the frame: {100 * cut:.0f} % of its outline is outside the picture",
            file=name,
            expected="a ball that is whole",
            hint="--allow-cut uses what is seen of it; a second view can fill in the rest",
        )
    if not inside.any():
        raise InputError(
            "the ball lies outside the picture", file=name, expected=f"within {size[0]} x {size[1]}"
        )
    return Outline(outline.ball, outline.residual_px, outline.support, cut, outline.radius_px, outline.found)


def _tone(radiance: F32, quantile: float) -> F32:
    """Brightness for display, 0 to 255, white from a quantile on: lamps flatten, the rim shows."""
    value = np.nan_to_num(radiance.mean(axis=-1), nan=0.0, posinf=0.0)
    white = float(np.quantile(value, quantile))
    if white <= 0:
        white = float(value.max())
    if white <= 0:
        return np.zeros_like(value)
    return np.asarray(np.clip(value / white, 0, 1) ** (1 / 2.2) * 255, dtype=np.float32)


def _candidates(gray: F32) -> list[tuple[float, float, float]]:
    """Circles (x, y, radius) in pixels to start from, best first."""
    height, width = gray.shape
    scale = min(1.0, SEARCH_PX / max(height, width))
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    # A border, so that a ball that touches the frame or is cut by it can be found too.
    pad = round(0.25 * max(small.shape))
    small = cv2.copyMakeBorder(small, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
    eight: U8 = cv2.GaussianBlur(small, (0, 0), 1.0).astype(np.uint8)
    found: list[tuple[float, float, float]] = []
    smallest, largest = 8, round(0.75 * min(gray.shape) * scale)
    for threshold in (120.0, 60.0):
        for votes in (30.0, 15.0):
            circles = cv2.HoughCircles(
                eight,
                cv2.HOUGH_GRADIENT,
                1.5,
                minDist=4,
                param1=threshold,
                param2=votes,
                minRadius=smallest,
                maxRadius=largest,
            )
            if circles is not None:
                for x, y, r in circles.reshape(-1, circles.shape[-1])[:20, :3]:
                    found.append(((x - pad + 0.5) / scale, (y - pad + 0.5) / scale, r / scale))
    return found


def _distinct(circles: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Circles that are not within a tenth of the radius of an earlier one."""
    kept: list[tuple[float, float, float]] = []
    for circle in circles:
        if all(max(abs(a - b) for a, b in zip(circle, k, strict=True)) > 0.1 * k[2] for k in kept):
            kept.append(circle)
    return kept[:CANDIDATES]


def _refined(gray: F32, start: tuple[float, float, float], camera: Camera | None) -> Ball | None:
    """The outline near a circle: edges along its normals, the fit with most of them, then least squares."""
    x, y, radius = start
    centre = np.array([x, y])
    t = np.linspace(0, 2 * np.pi, RAYS, endpoint=False)
    points = centre + radius * np.column_stack([np.cos(t), np.sin(t)])
    rng = np.random.default_rng(0)
    ball: Ball | None = None
    for reach, tolerance in ((0.25, 2.5), (0.05, 1.5), (0.02, 1.0)):
        outward = points - centre
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
        edges = _edges(gray, points, outward, max(reach * radius, 3.0))
        if len(edges) < RAYS // 8:
            return None
        ball = _most_edges(edges, camera, tolerance, rng)
        for _ in range(3):
            if ball is None:
                return None
            near = np.abs(ball.residual_px(edges)) < tolerance
            ball = _fit(edges[near], camera)
        if ball is None:
            return None
        points = ball.outline(RAYS)
        if not np.isfinite(points).all():
            return None
        centre = points.mean(axis=0)
        new_radius = float(np.linalg.norm(points - centre, axis=1).mean())
        if not 0.7 * radius < new_radius < 1.4 * radius:
            return None
        radius = new_radius
    return ball


def _judged(tones: list[F32], ball: Ball) -> Outline | None:
    """An outline with what lies on it: the mean over the tones, since each shows other parts of a rim."""
    points = ball.outline(RAYS)
    if not np.isfinite(points).all():
        return None
    centre = points.mean(axis=0)
    outward = points - centre
    radius = float(np.linalg.norm(outward, axis=1).mean())
    height, width = tones[0].shape
    inside = ((points > 1) & (points < [width - 1, height - 1])).all(axis=1)
    supports, distances = [], []
    for tone in tones:
        edges = _edges(tone, points, outward / radius, 3.0)
        off = ball.residual_px(edges)
        near = np.abs(off) < 1.0
        # Each direction counts once, however many edges lie along it.
        angle = np.arctan2(*(edges[near] - centre).T[::-1])
        covered = len(np.unique(np.floor((angle + np.pi) / (2 * np.pi) * RAYS / 2)))
        supports.append(min(covered / max(inside.sum() / 2, RAYS / 8), 1.0))
        distances.append(off[near])
    return Outline(ball, _rms(np.concatenate(distances)), float(np.mean(supports)), 0.0, radius, True)


def _score(outline: Outline) -> float:
    return outline.support * outline.radius_px


def _edges(gray: F32, points: F64, outward: F64, reach_px: float) -> F64:
    """Sub-pixel edges [E, 2], up to three along each normal of the outline, in image points."""
    steps = np.arange(-reach_px, reach_px + 0.25, 0.5)
    at = points[:, None] + steps[:, None] * outward[:, None]
    height, width = gray.shape
    inside = ((at > 1) & (at < [width - 1, height - 1])).all(axis=-1)
    blurred = cv2.GaussianBlur(gray, (0, 0), 1.0)
    x, y = (at[..., i].astype(np.float32) - np.float32(0.5) for i in (0, 1))
    profile = cv2.remap(blurred, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    slope = np.abs(np.gradient(profile, axis=1))
    slope[~inside] = 0
    middle, before, after = slope[:, 1:-1], slope[:, :-2], slope[:, 2:]
    # An edge that crosses the outline is not an edge of the ball: its gradient points elsewhere.
    across = [cv2.Sobel(blurred, cv2.CV_32F, dx, dy, scale=1 / 8) for dx, dy in ((1, 0), (0, 1))]
    g = np.stack([cv2.remap(a, x, y, cv2.INTER_LINEAR) for a in across], axis=-1)
    aligned = np.abs((g * outward[:, None]).sum(axis=-1)) > ALIGNED * np.hypot(g[..., 0], g[..., 1])
    peak = (middle > before) & (middle >= after) & (middle > 0.5) & aligned[:, 1:-1]
    strength = np.where(peak, middle, 0)
    found = []
    for _ in range(3):
        i = strength.argmax(axis=1)
        rows = np.flatnonzero(strength[np.arange(len(i)), i] > 0)
        j = i[rows]
        a, b, c = before[rows, j], middle[rows, j], after[rows, j]
        shift = 0.5 * (a - c) / np.minimum(a - 2 * b + c, -1e-9)
        distance = steps[j + 1] + 0.5 * np.clip(shift, -0.5, 0.5)
        found.append(points[rows] + distance[:, None] * outward[rows])
        strength[rows, j] = 0
    return np.concatenate(found)


def _most_edges(edges: F64, camera: Camera | None, tolerance: float, rng: np.random.Generator) -> Ball | None:
    """Of the outlines through three edges each, the one that most edges lie on.

    Both kinds are linear, rows . w = values: a cone as in `PerspectiveBall.fit`, and a circle's
    2 x a + 2 y b + c = x^2 + y^2. What is left, over its slope across the outline, is a distance in pixels.
    """
    if camera is None:
        middle = edges.mean(axis=0)
        x = edges - middle
        rows, values = np.column_stack([2 * x, np.ones(len(x))]), (x**2).sum(axis=1)
    else:
        rows, values = camera.rays(edges), np.ones(len(edges))
    three = np.stack([rng.choice(len(edges), 3, replace=False) for _ in range(TRIALS)])
    with np.errstate(all="ignore"):
        sound = np.abs(np.linalg.det(rows[three])) > 1e-12
        three = three[sound]
        w = np.linalg.solve(rows[three], values[three][..., None])[..., 0]
        if camera is None:
            slope = 2 * np.sqrt(w[:, 2] + w[:, 0] ** 2 + w[:, 1] ** 2)
        else:
            slope = np.sqrt((w**2).sum(axis=1) - 1) / np.sqrt(camera.fx * camera.fy)
        off = np.abs(rows @ w.T - values[:, None]) / slope
    count = (off < tolerance).sum(axis=0)
    return _fit(edges[three[count.argmax()]], camera) if len(count) else None


def _fit(points: F64, camera: Camera | None) -> Ball | None:
    return OrthographicBall.fit(points) if camera is None else PerspectiveBall.fit(camera, points)


def _rms(values: F64) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.inf

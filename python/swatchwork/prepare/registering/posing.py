# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The pose of a photograph from points of it that are paired with points of the mesh (paper, section 6).

Minimises the squared distance in pixels between the points clicked and the mesh's points projected, over
those pairs that agree: see `consensus`. The focal length is the lens's; how well it fits is told too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F64, Bool
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering.consensus import Agreement, agreements
from swatchwork.prepare.registering.least import least_squares, misses_px, zoomed

FEWEST, RECOMMENDED = 4, 6
"""Three pairs have up to four poses; with fewer than six, one wrong pair can still find others to agree."""
TOLERANCE_PX, TOLERANCE_SHARE = 4.0, 0.004
"""Of the longer side: a click on a large photograph that is shown whole is off by as much of the screen."""
LINE = 0.01
"""Second singular value of centred points over the first, from which down they lie on a line."""
RIVAL = 1.5
"""A second pose whose rms is not that many times larger may be the true one."""
FLOOR_PX = 0.25
"""Added to the rms in that comparison: of exact pairs, every ratio would be chance."""
FOCAL_SHARE, FOCAL_SIGMAS = 0.03, 3.0
ZOOMS = (0.5, 1 / 1.6, 0.8, 1.25, 1.6, 2.0)
"""Focal lengths tried, over the given one, where no pose fits: 1.5 and 1.6 are the crops of small sensors."""


@dataclass(frozen=True, eq=False)
class Posed:
    """A photograph's pose, and how well the pairs fit.

    Attributes:
        camera: the lens, posed in the mesh's world.
        inliers: Bool[C], the pairs it is fitted to.
        residual_px: F64[C], distance of each pair; infinite behind the camera.
        rms_px: over the inliers.
        rival_px: rms of the next best pose over as many pairs; infinite where there is none.
        focal_fits: factor of the focal length that fits the inliers best; 1 where they do not tell.
        focal_deviation: its standard deviation, infinite where the inliers do not tell.
    """

    camera: Camera
    inliers: Bool
    residual_px: F64
    rms_px: float
    rival_px: float
    focal_fits: float
    focal_deviation: float

    @property
    def ambiguous(self) -> bool:
        """Whether another pose is nearly as good, as for points of a plane seen from afar."""
        return self.rival_px < RIVAL * self.rms_px + FLOOR_PX

    @property
    def focal_off(self) -> bool:
        """Whether another focal length fits clearly better: by 3 %, and by three standard deviations."""
        off = abs(self.focal_fits - 1)
        return off > max(FOCAL_SHARE, FOCAL_SIGMAS * self.focal_deviation)

    @property
    def outliers(self) -> tuple[int, ...]:
        """Numbers of the pairs thrown out, counted from 0."""
        return tuple(int(i) for i in np.flatnonzero(~self.inliers))


def default_tolerance_px(lens: Camera) -> float:
    """Distance up to which a pair agrees: 4 pixels, or 0.4 % of the longer side where that is more."""
    return max(TOLERANCE_PX, TOLERANCE_SHARE * max(lens.width, lens.height))


def pose_from_pairs(
    lens: Camera, uv_px: F64, x_in_world: F64, *, tolerance_px: float | None = None, name: str | None = None
) -> Posed:
    """The pose that most pairs agree on.

    Of 4 or 5 pairs all must agree: no wrong one could be told from the others. Of more, at least half, and
    five, must.

    Args:
        lens: its own pose is not used.
        uv_px: [C, 2]; x_in_world: [C, 3].
        tolerance_px: distance up to which a pair agrees; None is `default_tolerance_px`.
        name: of the photograph, for errors.

    Raises:
        InputError: fewer than 4 distinct pairs; all points near a line, or in one place of the image; no pose
            that enough pairs agree on, or clearly more with the mesh's mirror image.
    """
    uv_px = np.asarray(uv_px, dtype=np.float64).reshape(-1, 2)
    x_in_world = np.asarray(x_in_world, dtype=np.float64).reshape(-1, 3)
    tolerance = default_tolerance_px(lens) if tolerance_px is None else tolerance_px
    _check(uv_px, x_in_world, tolerance, name)
    found = agreements(lens, uv_px, x_in_world, tolerance)
    best = found[0] if found else None
    count = len(uv_px)
    if best is None or best.count < needed(count):
        raise _disagreement(lens, uv_px, x_in_world, tolerance, best, name)
    if best.count < 0.8 * count:
        # Of a flat relief, half the pairs may agree by chance with a mirrored mesh or a wrong lens.
        _check_others(lens, uv_px, x_in_world, tolerance, best, best.count + 3, name)
    inliers = best.inliers
    _check_spread(x_in_world[inliers], "the points of the mesh that agree", name)
    factor, deviation = _focal(best, uv_px, x_in_world)
    return Posed(
        best.camera, inliers, best.residual_px, best.rms_px, _rival_px(found, best), factor, deviation
    )


def needed(count: int) -> int:
    """How many of ``count`` pairs must agree."""
    return count if count < RECOMMENDED else max(5, (count + 1) // 2)


def mirrored(x_in_world: F64) -> F64:
    """Points of the mesh's mirror image; every other reflection is the same up to a rotation."""
    return np.asarray(x_in_world * [-1.0, 1.0, 1.0])


def _rival_px(found: list[Agreement], best: Agreement) -> float:
    rivals = [other.rms_px for other in found[1:] if other.count >= best.count]
    return min(rivals, default=np.inf)


def _focal(best: Agreement, uv_px: F64, x_in_world: F64) -> tuple[float, float]:
    """The focal length's factor that fits best, and its standard deviation by the residuals' scatter."""
    uv, x = uv_px[best.inliers], x_in_world[best.inliers]
    freedom = 2 * len(uv) - 7
    # Two equations to spare say something of the scatter, none do of both.
    if freedom < 2:
        return 1.0, np.inf
    camera, normal = least_squares(best.camera, uv, x, focal=True)
    factor = camera.fx / best.camera.fx
    # A tenth of a pixel is the least that a click may be off; exact pairs would know everything.
    scatter = max(float((misses_px(camera, uv, x) ** 2).sum()) / freedom, 0.1**2)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(scale, scale)
    if np.linalg.cond(scaled) > 1e12 or not 0.1 < factor < 10:
        return 1.0, np.inf
    return factor, float(np.sqrt(scatter * np.linalg.inv(scaled)[6, 6]) / scale[6])


def _check(uv_px: F64, x_in_world: F64, tolerance_px: float, name: str | None) -> None:
    if len(uv_px) != len(x_in_world):
        raise InputError(
            f"{len(uv_px)} points of the photograph and {len(x_in_world)} of the mesh",
            file=name,
            expected="as many of each",
        )
    if not (np.isfinite(uv_px).all() and np.isfinite(x_in_world).all()):
        raise InputError("a pair is not finite", file=name, expected="finite coordinates")
    if not (np.isfinite(tolerance_px) and tolerance_px > 0):
        raise InputError(f"the tolerance is {tolerance_px:g} px", expected="a positive number of pixels")
    distinct = min(len(np.unique(points, axis=0)) for points in (uv_px, x_in_world))
    if distinct < FEWEST:
        raise InputError(
            f"{distinct} distinct pair{'' if distinct == 1 else 's'} of points",
            file=name,
            expected=f"{FEWEST} or more, better {RECOMMENDED} to 12, of which a wrong one can be told",
            hint="Click more points, all over the object and at different depths",
        )
    _check_spread(x_in_world, "the points of the mesh", name)
    if np.ptp(uv_px, axis=0).max() < 2 * tolerance_px:
        raise InputError(
            f"the points of the photograph lie within {np.ptp(uv_px, axis=0).max():.1f} px",
            file=name,
            expected="points all over the object",
        )


def _check_spread(x_in_world: F64, which: str, name: str | None) -> None:
    along, across = np.linalg.svd(x_in_world - x_in_world.mean(axis=0), compute_uv=False)[:2]
    if across <= LINE * along:
        raise InputError(
            f"{which} lie on a line (within {100 * across / max(along, 1e-300):.1g} % of its length)",
            file=name,
            expected="points all over the object, since a turn about the line changes none of these",
            hint="Click points beside the line",
        )


def _check_others(
    lens: Camera,
    uv_px: F64,
    x_in_world: F64,
    tolerance_px: float,
    best: Agreement | None,
    enough: int,
    name: str | None,
) -> None:
    """Raises where ``enough`` pairs agree with left and right exchanged, or with another focal length."""
    count = len(uv_px)
    tried = [agreements(lens, uv_px, mirrored(x_in_world), tolerance_px)]
    tried.append(agreements(lens, uv_px[:, ::-1], x_in_world, tolerance_px))
    mirror, swapped = (found[0] if found and found[0].count >= enough else None for found in tried)
    if swapped is not None and (mirror is None or swapped.count > mirror.count):
        raise InputError(
            f"u and v are swapped: the other way round {swapped.count} of {count} pairs agree (rms "
            f"{swapped.rms_px:.1f} px)",
            file=name,
            expected="u to the right and v down",
        )
    if mirror is not None:
        raise _is_mirrored(mirror, best, name)
    for zoom in ZOOMS:
        other = agreements(zoomed(lens, zoom), uv_px, x_in_world, tolerance_px)
        if other and other[0].count >= enough:
            raise InputError(
                f"the focal length of {lens.fx:.0f} px does not fit: with {zoom * lens.fx:.0f} px "
                f"{other[0].count} of {count} pairs agree (rms {other[0].rms_px:.1f} px)",
                file=name,
                expected="the intrinsics of this camera, at this photograph's size",
            )


def _is_mirrored(mirror: Agreement, best: Agreement | None, name: str | None) -> InputError:
    count = len(mirror.inliers)
    own = f"{best.count if best is not None else 0} of {count} pairs agree on a pose of the mesh as it is"
    return InputError(
        f"the pairs fit the mesh's mirror image: with it {mirror.count} of {count} agree (rms "
        f"{mirror.rms_px:.1f} px), and {own}",
        file=name,
        expected="a mesh and a photograph with the same left and right",
        hint="Is the mesh exported with swapped or reversed axes, are u and v swapped in the file of the "
        "pairs, or is the photograph flipped?",
    )


def _disagreement(
    lens: Camera,
    uv_px: F64,
    x_in_world: F64,
    tolerance_px: float,
    best: Agreement | None,
    name: str | None,
) -> InputError:
    """Says what explains the pairs where something does, else how far they are off."""
    count = len(uv_px)
    # Of so few pairs, any mesh fits some of them.
    enough = max(needed(count), RECOMMENDED, int(0.6 * count))
    _check_others(lens, uv_px, x_in_world, tolerance_px, best, enough, name)
    if best is not None and np.isfinite(best.residual_px).sum() < needed(count):
        found = f"{(~np.isfinite(best.residual_px)).sum()} of {count} points lie behind the camera"
    else:
        agree = 0 if best is None else best.count
        worst = "" if best is None else f"; the pairs are off by {_listed(best.residual_px)} px"
        found = f"{agree} of {count} pairs agree on a pose, within {tolerance_px:.1f} px{worst}"
    must = "all, of fewer than 6" if count < RECOMMENDED else f"{needed(count)} or more"
    return InputError(
        found,
        file=name,
        expected=must,
        hint="Check the pairs that are far off, the focal length, and that the mesh is of this object",
    )


def _listed(residual_px: F64) -> str:
    shown = [f"{value:.0f}" if np.isfinite(value) else "behind" for value in residual_px[:12]]
    return ", ".join(shown) + (", ..." if len(residual_px) > 12 else "")

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Figs. 10 and 11: what errors of normals and of camera positions do, by roughness."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..arrays import F64, unit
from ..baselines import SparseAsPossible
from ..reflectance import paper
from ..simulate import Pairs, Sphere, SphereCapture, visible_pairs
from ..simulate.viewpoints import DISTANCE
from ..solve import SolveOptions
from .experiment import Claim, Experiment, Figures, Plot, Setting, Table
from .spheres import Test, recover, views_of
from .targets import homogeneous

SIGMAS = (0.05, 0.1, 0.15, 0.2)
NORMAL_DEGREES = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0)
"""Mean angles between the true and the assumed normal."""
CAMERA_PERCENT = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0)
"""Half-width of the uniform noise on each coordinate of a camera, of its distance."""
VIEWS, TEXELS = 6, 600
OPTIONS = SolveOptions(n=1, N=1)
"""The spheres are of one material."""


def measure_normals(setting: Setting) -> Figures:
    """NRMS by roughness and mean angle."""
    return _measure(setting, "fig10", setting.pick(NORMAL_DEGREES, (0.0, 3.0)), with_wrong_normals)


def measure_cameras(setting: Setting) -> Figures:
    """NRMS by roughness and noise of the position."""
    return _measure(setting, "fig11", setting.pick(CAMERA_PERCENT, (0.0, 3.0)), with_wrong_cameras)


def _measure(setting: Setting, name: str, amounts: tuple[float, ...], spoil) -> Figures:  # type: ignore[no-untyped-def]
    light, novel = setting.data.probe("grace"), setting.data.probe("uffizi")
    views = views_of(0)[: setting.pick(VIEWS, 3)]
    runs = []
    for sigma in setting.pick(SIGMAS, SIGMAS[::3]):
        sphere = homogeneous(sigma, setting.pick(TEXELS, 150))
        test = Test.of(sphere, novel)
        for amount in amounts:

            def make(sphere: Sphere = sphere, test: Test = test, amount: float = amount) -> Figures:
                capture = spoil(sphere, sphere.captured(light, views, paper()), views, amount)
                found, weights = recover(SparseAsPossible(OPTIONS), capture)
                return {"nrms": test.error(found, weights)}

            kept = setting.kept(f"{name}-{sigma:g}-{amount:g}", make)
            runs.append({"sigma": sigma, "amount": amount} | kept)
    return {"runs": runs}


def with_wrong_normals(sphere: Sphere, capture: SphereCapture, views: F64, degrees: float) -> SphereCapture:
    """The method is told normals that are off by a mean angle."""
    rng = np.random.default_rng(10)
    # Of a small two-dimensional Gaussian the mean length is sigma sqrt(pi / 2).
    offset = rng.normal(size=sphere.normal.shape) * np.deg2rad(degrees) / np.sqrt(np.pi / 2)
    normal = unit(
        sphere.normal + offset - np.einsum("mx,mx->m", offset, sphere.normal)[:, None] * sphere.normal
    )
    pairs = replace(capture.pairs, normal=normal[capture.pairs.texel].astype(np.float32))
    return replace(capture, pairs=pairs)


def with_wrong_cameras(sphere: Sphere, capture: SphereCapture, views: F64, percent: float) -> SphereCapture:
    """The method is told camera positions that are off; the cameras still look at the sphere's centre.

    A texel is then looked up where the wrong camera sees it, which is another point of the true picture.
    """
    rng = np.random.default_rng(11)
    true = DISTANCE * views
    told = true + rng.uniform(-1, 1, true.shape) * DISTANCE * percent / 100
    believed = _pairs_from(sphere.normal, told)
    texel, view = believed.texel, believed.view
    point = sphere.normal[texel]
    # The pixel's ray, as the true camera sees it.
    turn = np.stack([_rotation(a, b) for a, b in zip(told, true, strict=True)])
    ray = np.einsum("pab,pb->pa", turn[view], unit(point - told[view]))
    origin = true[view]
    along = np.einsum("px,px->p", ray, origin)
    inside = along**2 - (np.einsum("px,px->p", origin, origin) - 1)
    hit = inside > 0
    seen = origin + (-along - np.sqrt(np.maximum(inside, 0)))[:, None] * ray
    normal, to_viewer = unit(seen), unit(origin - seen)
    hit &= np.einsum("px,px->p", normal, to_viewer) > 0.03
    kept = np.flatnonzero(hit)
    looked = Pairs(
        texel[kept],
        view[kept],
        normal[kept].astype(np.float32),
        to_viewer[kept].astype(np.float32),
        np.searchsorted(texel[kept], np.arange(len(sphere.normal) + 1)).astype(np.int64),
    )
    # Homogeneous: the texel's own weights are those of any other point.
    radiance = sphere.radiance(capture.light, looked).astype(np.float32)
    told_pairs = replace(
        looked, normal=believed.normal[kept], to_viewer=unit(told[view] - point)[kept].astype(np.float32)
    )
    return replace(capture, pairs=told_pairs, radiance=radiance)


def _pairs_from(normal: F64, positions: F64) -> Pairs:
    """Visible pairs of cameras at positions [k, 3]."""
    pairs = visible_pairs(normal, unit(positions))
    to_viewer = unit(positions[pairs.view] - normal[pairs.texel])
    return replace(pairs, to_viewer=to_viewer.astype(np.float32))


def _rotation(a: F64, b: F64) -> F64:
    """The least rotation [3, 3] that takes direction a to b."""
    a, b = unit(a), unit(b)
    v, c = np.cross(a, b), float(a @ b)
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1 + c))


def claims(figures: Figures) -> list[Claim]:
    """Shinier is more sensitive."""
    amounts, sigmas = (sorted({r[key] for r in figures["runs"]}) for key in ("amount", "sigma"))
    of = {(r["sigma"], r["amount"]): r["nrms"] for r in figures["runs"]}
    rise = [of[s, amounts[-1]] - of[s, amounts[0]] for s in sigmas]
    words = ", ".join(f"{100 * x:.1f} % (sigma {s:g})" for s, x in zip(sigmas, rise, strict=True))
    return [
        Claim(
            "Shinier materials are more sensitive.",
            f"from no error to the largest NRMS rises by {words}",
            rise[-1] > 0 and all(a >= b for a, b in pairwise(rise)),
        )
    ]


def _tables(figures: Figures, what: str) -> list[Table]:
    sigmas = sorted({r["sigma"] for r in figures["runs"]})
    amounts = sorted({r["amount"] for r in figures["runs"]})
    of = {(r["sigma"], r["amount"]): r["nrms"] for r in figures["runs"]}
    rows = tuple((f"{a:g}", *(f"{100 * of[s, a]:.2f}" for s in sigmas)) for a in amounts)
    return [Table((what, *(f"sigma {s:g}" for s in sigmas)), rows, "novel-light NRMS in %")]


def _plots(figures: Figures, name: str, what: str) -> list[Plot]:
    curves = {
        f"sigma {s:g}": [(r["amount"], 100 * r["nrms"]) for r in figures["runs"] if r["sigma"] == s]
        for s in sorted({r["sigma"] for r in figures["runs"]})
    }
    return [Plot(name, curves, what, "novel-light NRMS in %", logarithmic=False)]


FIG10 = Experiment(
    "fig10",
    "Fig. 10: normal errors",
    measure_normals,
    claims,
    lambda figures: _tables(figures, "mean angle, degrees"),
    minutes=0.3,
    how="Spheres of one glossy material each, six views under Grace, normals perturbed at random; NRMS "
    "under Uffizi with the true normals.",
    plots=lambda figures: _plots(figures, "fig10", "mean angle, degrees"),
)
FIG11 = Experiment(
    "fig11",
    "Fig. 11: camera errors",
    measure_cameras,
    claims,
    lambda figures: _tables(figures, "noise, % of distance"),
    minutes=0.3,
    how="The same spheres with camera positions perturbed at random, each still looking at the centre.",
    plots=lambda figures: _plots(figures, "fig11", "noise, % of distance"),
)

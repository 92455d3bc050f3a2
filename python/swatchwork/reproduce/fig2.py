# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Fig. 2: how well views determine the unknowns, by light and shape, against their number k."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..analysis import (
    LEAST,
    blend_spectra,
    condition_numbers,
    directional_responses,
    singular_values,
)
from ..arrays import F64, Bool, fibonacci_sphere, unit
from ..light import Environment
from ..reflectance import GenericBasis, paper
from ..response import generic_responses
from .experiment import Claim, Experiment, Figures, Plot, Setting, Table

PROBES = ("stpeters", "grace", "rnl", "uffizi")
TRIALS = 80
MOST = 20
SPARE = 4
"""Times as many views are drawn as are counted, so that the rim has enough that see it."""
SHAPES = {"plane": 0.0, "cap": np.pi, "hemisphere": 2 * np.pi}
"""Solid angle of the normals, about +z."""
POINTS = 60
BLENDED = 4
TOLERANCES = (0.01, 1e-4)
"""Of the largest singular value, below which one counts as zero: the noise of a photograph, and less."""
ALIKE = 0.2
"""Relative difference of ranks that counts as none."""


def measure(setting: Setting) -> Figures:
    """Ranks and condition numbers, by curve and k."""
    most = setting.pick(MOST, 6)
    found: Figures = {"k": list(range(1, most + 1)), "curves": {}}
    for shape, solid_angle in SHAPES.items():
        normal = normals(solid_angle, setting.pick(POINTS, 15))
        for light in ("directional", "environment"):
            make = partial(_curve, setting, normal, light, most)
            found["curves"][f"{shape}, {light}"] = setting.kept(f"fig2-{shape}-{light}", make)
    found["curves"]["plane, optimised directional"] = setting.kept(
        "fig2-optimised", partial(_optimised, setting, most)
    )
    return found


def normals(solid_angle: float, count: int) -> F64:
    """About ``count`` normals [M, 3], evenly over a cap about +z; one for no solid angle."""
    if solid_angle == 0:
        return np.array([[0.0, 0.0, 1.0]])
    everywhere = fibonacci_sphere(round(count * 4 * np.pi / solid_angle))
    return everywhere[everywhere[:, 2] >= 1 - solid_angle / (2 * np.pi)]


def above(count: int, rng: np.random.Generator) -> F64:
    """Directions [count, 3] uniform over the upper hemisphere."""
    d = unit(rng.normal(size=(count, 3)))
    d[:, 2] = np.abs(d[:, 2])
    return d


def _curve(setting: Setting, normal: F64, light: str, most: int) -> Figures:
    """Ranks and condition numbers over the trials; the worst point counts."""
    basis, trials = paper(), setting.pick(TRIALS, 4)
    probes = [setting.data.probe(name) for name in PROBES] if light == "environment" else []
    results = []
    for trial in range(trials):
        rng = np.random.default_rng([trial, 2])
        views = above(SPARE * most, rng)
        if light == "directional":
            responses = directional(basis, normal, views, above(len(views), rng))
        else:
            probe = probes[trial % len(probes)]
            responses = environmental(basis, normal, views, probe, _random_rotation(rng))
        results.append(judged(responses, normal @ views.T > LEAST, most))
    return _pooled(results)


def directional(basis: GenericBasis, normal: F64, views: F64, lights: F64) -> F64:
    """Responses [M, V, J] to a directional light of irradiance pi a view, of unit cosine-weighted power."""
    V = len(views)
    pairs = np.repeat(normal, V, axis=0), *(np.tile(d, (len(normal), 1)) for d in (views, lights))
    return directional_responses(basis, *pairs).reshape(len(normal), V, -1)


def environmental(basis: GenericBasis, normal: F64, views: F64, light: Environment, rotation: F64) -> F64:
    """Responses [M, V, J] under a light that is turned: normals and views are turned back instead."""
    n = np.repeat(normal, len(views), axis=0) @ rotation
    o = np.tile(views, (len(normal), 1)) @ rotation
    found = np.zeros((len(n), basis.kernels))
    seen = np.flatnonzero(np.einsum("px,px->p", n, o) > LEAST)
    of_seen = generic_responses(
        basis, light.pyramid(), n[seen].astype(np.float32), o[seen].astype(np.float32)
    )
    found[seen] = of_seen.mean(axis=2)
    return found.reshape(len(normal), len(views), -1)


def judged(responses: F64, seen: Bool, most: int) -> Figures:
    """Of the first k views that see a point, its rank and condition; of the first k views, all points' rank.

    The worst of the points counts.
    """
    order = np.argsort(~seen, axis=1, kind="stable")[:, :most]
    own = np.take_along_axis(np.where(seen[..., None], responses, 0.0), order[..., None], axis=1)
    counts = list(range(1, most + 1))
    spectra = blend_spectra(own @ own.transpose(0, 2, 1), counts, responses.shape[2])
    first = responses[:, :most]
    grams = np.cumsum(np.einsum("mvj,mvi->vji", first, first, optimize=True), axis=0)
    whole = singular_values(grams)
    return {
        "condition": condition_numbers(spectra, BLENDED).max(axis=1).tolist(),
        **{f"rank {t:g}": _rank(spectra, t).min(axis=1).tolist() for t in TOLERANCES},
        **{f"representative {t:g}": _rank(whole, t).tolist() for t in TOLERANCES},
    }


def _rank(singular: F64, tolerance: float) -> F64:
    return np.asarray(np.count_nonzero(singular > tolerance * singular[..., :1], axis=-1), np.float64)


def _pooled(results: list[Figures]) -> Figures:
    """Means of ranks, and medians of condition numbers, which may be infinite."""
    found = {}
    for key in results[0]:
        values = np.array([r[key] for r in results])
        pooled = np.median(values, axis=0) if key == "condition" else values.mean(axis=0)
        found[key] = [float(x) if np.isfinite(x) else None for x in pooled]
    return found


def _optimised(setting: Setting, most: int) -> Figures:
    """Light and view directions on a plane, each the one of many that lowers the condition number most."""
    rng = np.random.default_rng(22)
    count = setting.pick(3000, 200)
    views, lights = above(count, rng), above(count, rng)
    # Half of them near the mirror direction, where glossy kernels vary.
    half = count // 2
    lights[:half] = unit(views[:half] * [-1, -1, 1] + 0.2 * rng.normal(size=(half, 3)))
    lights[:, 2] = np.abs(lights[:, 2])
    rows = directional(paper(), np.array([[0.0, 0.0, 1.0]]), views, lights)[0]
    rows = rows[rows.any(axis=1)]
    chosen: list[int] = []
    for k in range(1, most + 1):
        grams = _with_each(rows, chosen)
        spectra = singular_values(grams)
        at = min(k, BLENDED - 1) - 1 if k < BLENDED else k - 1
        condition = spectra[:, 0] / np.maximum(spectra[:, at], 1e-300)
        if k == 1:
            condition = -spectra[:, 0]
        condition[chosen] = np.inf
        chosen.append(int(np.argmin(condition)))
    return _pooled([judged(rows[None, chosen], np.ones((1, most), bool), most)])


def _with_each(rows: F64, chosen: list[int]) -> F64:
    """Gram matrices [C, k + 1, k + 1] of the chosen rows and each other one."""
    base = rows[chosen]
    grams = np.zeros((len(rows), len(chosen) + 1, len(chosen) + 1))
    grams[:, :-1, :-1] = base @ base.T
    cross = rows @ base.T
    grams[:, -1, :-1] = grams[:, :-1, -1] = cross
    grams[:, -1, -1] = (rows**2).sum(axis=1)
    return grams


def _random_rotation(rng: np.random.Generator) -> F64:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0 else q[:, ::-1])


def curve(figures: Figures, name: str, key: str) -> F64:
    """One curve [k]; infinite where it is not determined."""
    return np.array([np.inf if x is None else x for x in figures["curves"][name][key]], dtype=np.float64)


def claims(figures: Figures) -> list[Claim]:
    """The conclusions of section 5."""
    rank, whole = f"rank {TOLERANCES[0]:g}", f"representative {TOLERANCES[0]:g}"
    last, k = -1, figures["k"][-1]
    few = min(4, k) - 1

    def all_of(key: str, light: str) -> list[F64]:
        return [curve(figures, f"{shape}, {light}", key) for shape in SHAPES]

    def words(curves: list[F64], at: int) -> str:
        return ", ".join(f"{c[at]:.1f}" for c in curves)

    natural, directed = all_of(rank, "environment"), all_of(rank, "directional")
    conditions = {light: all_of("condition", light) for light in ("environment", "directional")}
    reps = {light: all_of(whole, light) for light in ("environment", "directional")}
    optimised = curve(figures, "plane, optimised directional", rank)
    flat, cap, hemisphere = reps["environment"]
    ten = min(10, k) - 1
    at_ten = [c[ten] for c in conditions["environment"]]
    return [
        Claim(
            "The blend matrix's minimum rank grows faster under natural than under directional light (a).",
            f"at k = {k} {words(natural, last)} (plane, cap, hemisphere) against {words(directed, last)}",
            all(a[last] > b[last] for a, b in zip(natural, directed, strict=True)),
        ),
        Claim(
            "Natural light has the smaller condition number (b).",
            f"medians at k = {few + 1} {words(conditions['environment'], few)} against "
            f"{words(conditions['directional'], few)}; at k = {ten + 1} "
            f"{words(conditions['environment'], ten)} against {words(conditions['directional'], ten)}",
            all(
                a[at] < b[at]
                for at in (few, ten)
                for a, b in zip(conditions["environment"], conditions["directional"], strict=True)
            ),
        ),
        Claim(
            "Optimised directions on a plane have the rank of natural light (Nielsen et al. 2015).",
            f"rank {optimised[few]:.1f} at k = {few + 1}, {optimised[ten]:.1f} at k = {ten + 1}; natural "
            f"light {natural[0][few]:.1f}, {natural[0][ten]:.1f}",
            all(abs(optimised[at] / natural[0][at] - 1) < ALIKE for at in (few, ten)),
        ),
        Claim(
            "Natural light has the higher representative rank on curved shapes (c).",
            f"cap, hemisphere at k = {few + 1}: {words(reps['environment'][1:], few)} against "
            f"{words(reps['directional'][1:], few)}; at k = {k} "
            f"{words(reps['environment'][1:], last)} against {words(reps['directional'][1:], last)}",
            all(
                bool((a > b).all())
                for a, b in zip(reps["environment"][1:], reps["directional"][1:], strict=True)
            ),
        ),
        Claim(
            "Condition numbers find the three shapes similarly robust (b).",
            f"{', '.join(f'{x:.1f}' for x in at_ten)} at k = {ten + 1}",
            bool(max(at_ten) < 3 * min(at_ten)),
            f"cap and hemisphere are {max(at_ten[1:]) / min(at_ten[1:]):.1f} times apart; the plane is a "
            "single point, while of the others the worst of many counts.",
        ),
        Claim(
            "Curved shapes have the higher representative rank, above all at small k (c).",
            f"plane, cap, hemisphere: {words(reps['environment'], 1)} at k = 2, "
            f"{words(reps['environment'], last)} at k = {k}",
            all(
                bool((c[1:] > flat[1:]).all()) and c[1] / flat[1] > c[last] / flat[last]
                for c in (cap, hemisphere)
            ),
        ),
        Claim(
            "A cap is about as good as a hemisphere (c).",
            f"representative rank {cap[few]:.1f} and {hemisphere[few]:.1f} at k = {few + 1}, "
            f"{cap[last]:.1f} and {hemisphere[last]:.1f} at k = {k}",
            bool((np.abs(cap / hemisphere - 1) < ALIKE).all()),
        ),
    ]


def tables(figures: Figures) -> list[Table]:
    """Each curve at some k."""
    shown = [k for k in (1, 2, 3, 4, 5, 7, 10, 15, 20) if k in figures["k"]]
    found = []
    for key, words in (
        (f"rank {TOLERANCES[0]:g}", "minimum rank of the blend matrix, tolerance 1 %"),
        (f"rank {TOLERANCES[1]:g}", "the same, tolerance 0.01 %"),
        ("condition", "its worst condition number, median over the trials"),
        (f"representative {TOLERANCES[0]:g}", "rank of the representative matrix, tolerance 1 %"),
        (f"representative {TOLERANCES[1]:g}", "the same, tolerance 0.01 %"),
    ):
        rows = []
        for name in figures["curves"]:
            values = curve(figures, name, key)[[k - 1 for k in shown]]
            rows.append((name, *("" if np.isinf(x) else f"{x:.3g}" for x in values)))
        found.append(Table((words, *(f"k = {k}" for k in shown)), tuple(rows)))
    return found


def plots(figures: Figures) -> list[Plot]:
    """(a), (b) and (c)."""
    kinds = (
        ("fig2a", f"rank {TOLERANCES[0]:g}", "minimum rank of the blend matrix", False),
        ("fig2b", "condition", "worst condition number", True),
        ("fig2c", f"representative {TOLERANCES[0]:g}", "rank of the representative matrix", False),
    )
    ks = [float(k) for k in figures["k"]]
    return [
        Plot(
            name,
            {x: list(zip(ks, map(float, curve(figures, x, key)), strict=True)) for x in figures["curves"]},
            "k, views",
            words,
            logarithmic,
        )
        for name, key, words, logarithmic in kinds
    ]


FIG2 = Experiment(
    "fig2",
    "Fig. 2: robustness by light and shape",
    measure,
    claims,
    tables,
    minutes=2,
    how="Ranks and condition numbers (n = 4) of the paper's section 5, paper's basis: 80 trials of random "
    "light and view directions, and of four probes at 20 random rotations and random views each; normals of "
    "a plane, a cap (solid angle pi) and a hemisphere. Views lie above the plane; for the blend matrix k "
    "counts the views that see the point. A singular value below the tolerance, of the largest, counts as "
    "zero. Nielsen et al.'s table of directions is not at hand: ours are found one by one, each the one of "
    "3,000 that leaves the smallest ratio of the largest to the least singular value.",
    plots=plots,
)

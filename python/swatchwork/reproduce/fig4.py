# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Figs. 3 and 4: error against the number of views, on a richly textured target."""

from __future__ import annotations

import numpy as np

from ..baselines import SparseAsPossible
from ..reflectance import paper
from ..solve import SolveOptions
from .experiment import Claim, Experiment, Figures, Plot, Setting, Table
from .spheres import Portrait, Test, captures, run, views_of
from .targets import copper

VIEWS = (1, 2, 3, 4, 5, 7, 10)
TRIALS = 10
TEXELS = 600
MOST_N = 10
LEVELLED = 1.5
"""After the knee the error is at most this many times that of the most views."""


def measure(setting: Setting) -> Figures:
    """The mean error of trials that differ in their views, by k."""
    sphere = copper(setting.data, setting.pick(TEXELS, 150))
    light, test = setting.data.probe("grace"), Test.of(sphere, setting.data.probe("uffizi"))
    method = SparseAsPossible(SolveOptions(max_N=setting.pick(MOST_N, 4), max_n=setting.pick(5, 2)))
    views = setting.pick(VIEWS, (1, 3, 5))
    portrait = Portrait(sphere, test.light, setting.parts, setting.pick(180, 64))
    runs = []
    for trial in range(setting.pick(TRIALS, 1)):
        for k in views:

            def make(k: int = k, trial: int = trial) -> Figures:
                taken = captures(sphere, light, views_of(trial)[:k], paper())
                seen = portrait if trial == 0 else None
                return run(method, taken, [test], seen, f"fig4-{trial}-{k}")

            runs.append({"trial": trial} | setting.kept(f"fig4-{trial}-{k}", make))
    portrait.show(setting.pictures / "fig3.jpg", {f"fig4-0-{k}": f"k = {k}" for k in views})
    return {"views": list(views), "runs": runs}


def mean_error(figures: Figures, k: int, of: str = "nrms") -> float:
    """Mean NRMS of the trials with k views."""
    return float(np.mean([r[of] for r in figures["runs"] if r["k"] == k]))


def claims(figures: Figures) -> list[Claim]:
    """The knee at three views."""
    views = figures["views"]
    first, knee, last = (mean_error(figures, k) for k in (views[0], 3, views[-1]))
    seen = [mean_error(figures, k, "nrms_seen") for k in (views[0], 3, views[-1])]
    return [
        Claim(
            "There is a knee in the error at k = 3, after which it levels off (Fig. 4).",
            f"NRMS {100 * first:.1f} % at k = {views[0]}, {100 * knee:.1f} % at k = 3, "
            f"{100 * last:.1f} % at k = {views[-1]}; where some view looks "
            + ", ".join(f"{100 * x:.1f} %" for x in seen),
            knee < LEVELLED * last and knee < 0.7 * first,
            "views are random over the whole sphere, so at k = 3 an eighth of it is in none, and a third in "
            "one; this target's texture hardly repeats, so a texel that no view sees has no neighbour that "
            "would do, and three materials at a point need two or three views there. The knee is where "
            "most texels have that many.",
        )
    ]


def tables(figures: Figures) -> list[Table]:
    """Error by k."""
    rows = []
    for k in figures["views"]:
        of = [r for r in figures["runs"] if r["k"] == k]
        errors = [r["nrms"] for r in of]
        typical = [float(np.median([r[f"found_{x}"] for r in of])) for x in ("n", "N")]
        error = [f"{100 * q(errors):.2f}" for q in (np.mean, np.min, np.max)]
        seen = 100 * mean_error(figures, k, "nrms_seen")
        rows.append((str(k), *error, f"{seen:.2f}", *(f"{x:.0f}" for x in typical)))
    head = ("k", "NRMS %", "least", "most", "seen surface", "n", "N")
    return [
        Table(head, tuple(rows), f"{len(figures['runs']) // len(figures['views'])} trials of random views")
    ]


def plots(figures: Figures) -> list[Plot]:
    """Fig. 4."""
    kinds = {"all of the surface": "nrms", "the surface that is seen": "nrms_seen"}
    curves = {
        words: [(float(k), 100 * mean_error(figures, k, of)) for k in figures["views"]]
        for words, of in kinds.items()
    }
    return [Plot("fig4", curves, "k, views", "novel-light NRMS in %")]


FIG4 = Experiment(
    "fig4",
    "Figs. 3, 4: number of views",
    measure,
    claims,
    tables,
    minutes=5,
    how="A sphere textured like a tarnished copper plate, of five GGX materials outside the basis, three "
    "of them blended at a point ('copper' of Wang et al. is not public), captured under Grace from "
    "random views; NRMS under Uffizi from four other views.",
    plots=plots,
    pictures=(("fig3.jpg", "Fig. 3: the first trial's result by k, and its differences"),),
)

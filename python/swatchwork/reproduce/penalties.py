# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Section 7.1, sparseness penalty values: a wide range of them gives much the same result."""

from __future__ import annotations

from ..baselines import SparseAsPossible
from ..reflectance import paper
from ..solve import SolveOptions
from .experiment import Claim, Experiment, Figures, Setting, Table
from .spheres import Test, captures, run, views_of
from .targets import copper

BLEND_PENALTIES = (0.003, 0.0055, 0.01)
REPRESENTATIVE_PENALTIES = (0.001, 0.0022, 0.005)
"""Roots of lambda0 and lambda1: the ends of the published ranges, and their geometric mean."""
UNDER, OVER = (1e-5, 1e-5), (0.1, 0.1)
VIEWS, TEXELS, MOST_N = 10, 600, 12
LOW = 0.05


def measure(setting: Setting) -> Figures:
    """NRMS and what was found, by penalties."""
    sphere = copper(setting.data, setting.pick(TEXELS, 150))
    light, test = setting.data.probe("grace"), Test.of(sphere, setting.data.probe("uffizi"))
    capture = captures(sphere, light, views_of(0)[: setting.pick(VIEWS, 4)], paper())
    inside = [(a, b) for a in BLEND_PENALTIES for b in REPRESENTATIVE_PENALTIES]
    runs = []
    for a, b in [*setting.pick(inside, inside[4:5]), UNDER, OVER]:
        options = SolveOptions(
            lambda0=a**2, lambda1=b**2, max_N=setting.pick(MOST_N, 4), max_n=setting.pick(5, 2)
        )

        def make(options: SolveOptions = options) -> Figures:
            return run(SparseAsPossible(options), capture, [test])

        part = {"lambda0": a, "lambda1": b, "inside": (a, b) not in (UNDER, OVER)}
        runs.append(part | setting.kept(f"penalties-{a:g}-{b:g}", make))
    return {"runs": runs}


def claims(figures: Figures) -> list[Claim]:
    """Below 5 % inside, worse outside."""
    inside = [r["nrms"] for r in figures["runs"] if r["inside"]]
    under, over = figures["runs"][-2:]
    most = max(r["found_N"] for r in figures["runs"] if r["inside"])
    return [
        Claim(
            "NRMS is below 5 % for all penalties of the range, at k = 10.",
            f"{100 * min(inside):.2f} to {100 * max(inside):.2f} %",
            max(inside) < LOW,
        ),
        Claim(
            "Underweighting overfits with an unduly complicated model.",
            f"n = {under['found_n']}, N = {under['found_N']} at NRMS {100 * under['nrms']:.2f} %",
            under["nrms"] > max(inside) and under["found_N"] > most,
        ),
        Claim(
            "Overweighting leaves a high error.",
            f"n = {over['found_n']}, N = {over['found_N']} at NRMS {100 * over['nrms']:.2f} %",
            over["nrms"] > max(inside),
        ),
    ]


def tables(figures: Figures) -> list[Table]:
    """By penalties."""
    rows = tuple(
        (
            f"{r['lambda0']:g}^2",
            f"{r['lambda1']:g}^2",
            "yes" if r["inside"] else "no",
            str(r["found_n"]),
            str(r["found_N"]),
            f"{100 * r['nrms']:.2f}",
        )
        for r in figures["runs"]
    )
    return [Table(("lambda0", "lambda1", "in the range", "n", "N", "NRMS %"), rows)]


PENALTIES = Experiment(
    "penalties",
    "Penalty values",
    measure,
    claims,
    tables,
    minutes=2,
    how="The target and lights of Fig. 4, k = 10 views, penalties given instead of automatic.",
)

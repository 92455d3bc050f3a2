# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Fig. 5: brute force over the supports of a blend, the paper's pruning, and the exact search."""

from __future__ import annotations

import time

from ..baselines import SparseAsPossible
from ..reflectance import paper
from ..solve import Search, SolveOptions, blend
from .experiment import Claim, Experiment, Figures, Setting, Table
from .spheres import Test, measurements_of, recover, views_of
from .targets import copper

SEARCHES: tuple[Search, ...] = ("brute", "pruned", "exact")
VIEWS, TEXELS = 10, 600
n, N = 3, 8
ALIKE = 0.02
"""Difference of errors, as a share, that a picture does not show."""


def measure(setting: Setting) -> Figures:
    """The same fit three times."""
    sphere = copper(setting.data, setting.pick(TEXELS, 150))
    light = setting.data.probe("grace")
    tests = [Test.of(sphere, setting.data.probe(name)) for name in ("uffizi", "rnl")]
    views = views_of(0)[: setting.pick(VIEWS, 4)]
    runs = []
    for search in SEARCHES:

        def make(search: Search = search) -> Figures:
            capture = sphere.captured(light, views, paper())
            options = SolveOptions(n=n, N=setting.pick(N, 4), search=search)
            # Responses are the same for all: they are made before the clock starts.
            _ = capture.responses
            start = time.process_time()
            found, weights = recover(SparseAsPossible(options), capture)
            seconds = time.process_time() - start
            problem = measurements_of(capture).problem
            step = blend(
                problem.fold(found.representatives), problem.radiance, problem.offsets, n, search=search
            )
            return {
                "search": search,
                "cpu_s": seconds,
                "visited": step.visited / problem.texels,
                "nrms": [test.error(found, weights) for test in tests],
            }

        runs.append(setting.kept(f"fig5-{search}", make))
    return {"runs": runs}


def claims(figures: Figures) -> list[Claim]:
    """Similar fidelity, half the computation."""
    brute, pruned, exact = figures["runs"]
    apart = max(abs(p / b - 1) for p, b in zip(pruned["nrms"], brute["nrms"], strict=True))
    saved = 1 - pruned["cpu_s"] / brute["cpu_s"]
    part = exact["visited"] / brute["visited"]
    ours = max(abs(e / b - 1) for e, b in zip(exact["nrms"], brute["nrms"], strict=True))
    return [
        Claim(
            "Pruning gives similar fidelity with 47 % less computation.",
            f"NRMS {100 * apart:.1f} % apart, {100 * saved:.0f} % less processor time for the whole fit",
            saved > 0.3 and apart < 0.1,
            f"a texel's supports fall from {brute['visited']:.0f} to {pruned['visited']:.0f}, but the fit "
            "spends its time elsewhere, and the list leaves out supports that the best blends need.",
        ),
        Claim(
            "Beyond the paper: the exact search has brute force's answer at part of its cost.",
            f"NRMS {100 * ours:.2f} % apart, {100 * part:.1f} % of its supports",
            ours < ALIKE and part < 0.5,
        ),
    ]


def tables(figures: Figures) -> list[Table]:
    """By search."""
    rows = tuple(
        (r["search"], f"{r['visited']:.1f}", f"{r['cpu_s']:.1f}", *(f"{100 * e:.3f}" for e in r["nrms"]))
        for r in figures["runs"]
    )
    return [Table(("search", "supports a texel", "cpu s, whole fit", "Uffizi NRMS %", "Grove NRMS %"), rows)]


FIG5 = Experiment(
    "fig5",
    "Fig. 5: search pruning",
    measure,
    claims,
    tables,
    minutes=0.5,
    how=f"The target and capture light of Fig. 4 with n = {n}, N = {N} given; the whole fit by each search. "
    "Supports are those that the last blend step looks at.",
)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Fig. 6: what each sparseness term is for, and the global linear model."""

from __future__ import annotations

from ..baselines import (
    Clustering,
    GlobalLinear,
    Method,
    NoSparseBlend,
    PerTexel,
    PerTexelLobe,
    SparseAsPossible,
    single_lobe_basis,
)
from ..reflectance import basis_by_name
from ..solve import SolveOptions
from .experiment import Claim, Experiment, Figures, Plot, Setting, Table
from .spheres import Capture, Portrait, Test, captures, label_of, run, views_of, with_basis
from .targets import two_of_four

TEXELS = 600
VIEWS = (6, 12, 24, 48, 62, 75)
STRENGTHS = (0.5, 0.2, 0.1, 0.03, 0.01, 0.001)
"""Penalties of the global linear model; its best one by the true error is shown, which can only help it."""
BASIS = "extended"
FEW = 2
"""Kernels of a channel that a texel may have without a sparse basis: about one diffuse and one specular."""
EQUAL = 1.05
"""Error, as a multiple, that counts as equal quality."""


def methods(setting: Setting) -> list[Method]:
    """Ours first."""
    most = SolveOptions(max_N=setting.pick(10, 5), max_n=setting.pick(5, 2))
    ours: list[Method] = [SparseAsPossible(most), NoSparseBlend(most), PerTexel(FEW, "no sparse basis")]
    strengths = setting.pick(STRENGTHS, STRENGTHS[2:3])
    low_rank: list[Method] = [GlobalLinear(s, iterations=setting.pick(400, 50)) for s in strengths]
    return [*ours, *low_rank, PerTexel(), Clustering(4), PerTexelLobe()]


def measure(setting: Setting) -> Figures:
    """Every method at ever more views, until it has the error of ours at six."""
    sphere = two_of_four(setting.data, setting.pick(TEXELS, 120))
    light, test = setting.data.probe("stpeters"), Test.of(sphere, setting.data.probe("uffizi"))
    portrait = Portrait(sphere, test.light, setting.parts, setting.pick(120, 48))
    ours = methods(setting)[0]
    enough = 0.0
    runs: list[Figures] = []
    reached: set[str] = set()
    for k in setting.pick(VIEWS, (3,)):
        capture = captures(sphere, light, views_of(0)[:k], basis_by_name(BASIS))
        lobes = with_basis(capture, single_lobe_basis())
        for method in methods(setting):
            if method.name in reached:
                continue
            label = label_of(method)
            name = label.replace(" ", "-")
            taken = lobes if isinstance(method, Clustering | PerTexelLobe) else capture
            part = f"fig6-{k}-{name}"

            def make(method: Method = method, taken: Capture = taken, part: str = part) -> Figures:
                return run(method, taken, [test], portrait, part)

            runs.append(setting.kept(part, make) | {"label": label})
            enough = enough or EQUAL * float(runs[-1]["nrms"])
        reached |= {r["method"] for r in runs if r["nrms"] <= enough}
    least = min(r["k"] for r in runs)

    def published() -> Figures:
        return run(ours, captures(sphere, light, views_of(0)[:least], basis_by_name("paper")), [test])

    in_paper_basis = setting.kept("fig6-paper-basis", published)
    shown = {f"fig6-{least}-{r['label'].replace(' ', '-')}": r["label"] for r in runs if r["k"] == least}
    portrait.show(setting.pictures / "fig6.jpg", shown)
    return {"runs": runs, "enough": enough, "in_paper_basis": in_paper_basis}


def best(figures: Figures, method: str, k: int) -> Figures | None:
    """A method's run of the least error at k views, if it was tried."""
    of = [r for r in figures["runs"] if r["method"] == method and r["k"] == k]
    return min(of, key=lambda r: r["nrms"]) if of else None


def needed(figures: Figures, method: str) -> str:
    """The views at which a method has the error of ours at the fewest."""
    of = sorted(r["k"] for r in figures["runs"] if r["method"] == method and r["nrms"] <= figures["enough"])
    most = max(r["k"] for r in figures["runs"])
    return str(of[0]) if of else f"more than {most}"


def claims(figures: Figures) -> list[Claim]:
    """Lowest error, n and N found, and what the others need."""
    k = min(r["k"] for r in figures["runs"])
    names = list(dict.fromkeys(r["method"] for r in figures["runs"]))
    at = {name: best(figures, name, k) for name in names}
    ours = at[names[0]]
    assert ours is not None
    others = {name: r["nrms"] for name, r in at.items() if r is not None and name != names[0]}
    rank = at["global linear"]
    found = [
        Claim(
            f"With both terms, k = {k} views give the lowest error.",
            f"{100 * ours['nrms']:.1f} %; the others "
            + ", ".join(f"{name} {100 * value:.1f} %" for name, value in others.items()),
            ours["nrms"] < min(others.values()),
        ),
        Claim(
            "The truth, n = 2 and N = 4, is found.",
            f"n = {ours['found_n']}, N = {ours['found_N']}",
            (ours["found_n"], ours["found_N"]) == (2, 4),
            "the measured materials lie outside the basis, so that one of them pays for a second "
            "representative; in tests whose materials the basis holds n = 2, N = 4 is found "
            "(docs/validation.md).",
        ),
    ]
    tried = {r["k"] for r in figures["runs"]}
    for name, views in (("no sparse blend", 12), ("no sparse basis", 75), ("global linear", 62)):
        need = needed(figures, name)
        found.append(
            Claim(
                f"{name}: equal quality needs k = {views} at least.",
                f"needs k = {need} (of those tried)",
                views in tried and (need.startswith("more") or int(need) >= views),
            )
        )
    if rank is not None:
        found.append(
            Claim(
                "The global linear model overestimates N (9 for 4).",
                f"rank {rank['materials']} at its best penalty",
                rank["materials"] > 4,
                "each penalty gives another rank. At its best one by views: "
                + ", ".join(
                    f"{r['materials']} at k = {r['k']}"
                    for r in (best(figures, "global linear", k) for k in sorted(tried))
                    if r is not None
                )
                + ".",
            )
        )
    return found


def tables(figures: Figures) -> list[Table]:
    """Error by method and k."""
    views = sorted({r["k"] for r in figures["runs"]})
    rows = []
    for name in dict.fromkeys(r["method"] for r in figures["runs"]):
        cells = []
        for k in views:
            r = best(figures, name, k)
            unfinished = "" if r is None or r["status"] == "converged" else ", iteration limit"
            cells.append("" if r is None else f"{100 * r['nrms']:.1f} (N = {r['materials']}{unfinished})")
        rows.append((name, *cells, needed(figures, name)))
    head = ("method", *(f"k = {k}" for k in views), "k for equal quality")
    published = figures["in_paper_basis"]
    words = f"{100 * published['nrms']:.1f} (N = {published['materials']})"
    rows.append((f"{published['method']}, paper's basis", words, *([""] * (len(views) - 1)), ""))
    return [Table(head, tuple(rows), f"NRMS in % and the materials found, {BASIS} basis")]


def plots(figures: Figures) -> list[Plot]:
    """Error against k."""
    curves = {}
    for name in dict.fromkeys(r["method"] for r in figures["runs"]):
        tried = {k: best(figures, name, k) for k in sorted({r["k"] for r in figures["runs"]})}
        curves[name] = [(float(k), 100 * r["nrms"]) for k, r in tried.items() if r is not None]
    return [Plot("fig6", curves, "k, views", "novel-light NRMS in %")]


FIG6 = Experiment(
    "fig6",
    "Fig. 6: sparseness, and the global linear model",
    measure,
    claims,
    tables,
    minutes=40,
    how="Pink plastic, hematite, yellow phenolic and blue metallic paint of MERL on a sphere, two blended "
    "at a point, rendered by dense quadrature, captured under St. Peter's; NRMS under Uffizi from "
    "four other views, rims to n.o = 0.03 included. 'No sparse basis' fits every texel by itself with "
    "all generic kernels.",
    plots=plots,
    pictures=(("fig6.jpg", "what each method recovers, and its differences"),),
)

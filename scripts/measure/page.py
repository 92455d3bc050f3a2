# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Write docs/validation.md from the figures that the measurements left as JSON.

    python scripts/measure/page.py --figures target/validation --page docs/validation.md

Reads the .json of each of SECTIONS, whichever are there. Every verdict is computed from them against the
bounds below; the page names command and commit of each figure.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import captures
import confidence
import exactness
import exports
import frames
import interreflections
import photographs_page
import planning
import results
import robust_page
import shadows
import silhouettes
import two_of_four
import viewer

from swatchwork.surface import sky

Figures = dict[str, Any]

IGEA_PEER = 0.239
"""Novel-light NRMS of the peer on igea-merl at k=12, from that capture's README."""

FORWARD_BOUNDS = (0.007, 0.015)
"""NRMS of the worst kernel: sigma below 0.1, any."""

SYNTHETIC_BOUNDS = {
    "noise-free, k=6": 0.001,
    "GGX truth, k=3": 0.02,
    "GGX truth, k=6": 0.01,
    "3 % noise, k=6": 0.035,
    "GGX truth, 3 % noise, k=6": 0.035,
}
FOUND_TOO = ("noise-free, k=6", "3 % noise, k=6")
"""Cases in which n=2 and N=4 are to be found as well."""


def source(figures: Figures) -> str:
    return f"`{figures['command']}`, commit {figures['commit']}, {figures['date']}."


def exactness_section(figures: Figures) -> str:
    families = [exactness.Family(**family) for family in figures["blend"]]
    fits = figures["representatives"]
    worst_fit = max(fit["difference"] for fit in fits)
    count = sum(family.problems for family in families)
    short = max(0, 100_000 - count)
    verdicts = [
        ("problems short of 100,000", short, 0, ""),
        ("blend step: objective above exhaustive search's", max(f.worst for f in families), 1e-6, ""),
        ("blend step: answers that are not feasible", sum(f.infeasible for f in families), 0, ""),
        ("representative step: off an independent solver", worst_fit, 1e-6, ""),
    ]
    largest = max(fit["N"] for fit in fits)
    return f"""{source(figures)}

The blend step against enumeration of every support in NumPy, N to {exactness.MOST_N}, n to
{exactness.MOST_BLENDED}: *worse by* is the largest excess of its objective, *better by* what enumeration in
floating point missed, *off brute* the difference to the core's own brute force, all relative to the optimum
or to {figures["energy_floor"]:.0e} of the measured energy. *Same support* counts problems that leave a
residual (otherwise the best support need not be the only one; nor is it where columns are twins).
*Visited* are supports a problem.

{results.table(exactness.BLEND_HEAD, exactness.blend_rows(families), markdown=True)}

The representative step against Lawson-Hanson NNLS on the stacked rows (and bounded-variable least squares at
N = 1): {len(fits)} problems, N up to {largest}, 0 to 3 % noise; worst relative difference of the
objective {worst_fit:.1e}.

{results.verdicts(verdicts)}
"""


def two_of_four_section(figures: Figures) -> str:
    runs = [two_of_four.Run(**run) for run in figures["runs"]]
    verdicts: list[results.Verdict] = []
    for name, bound in SYNTHETIC_BOUNDS.items():
        of = [run for run in runs if run.case == name]
        if of:
            mean = sum(run.nrms for run in of) / len(of)
            verdicts.append((f"{name}: mean NRMS of {len(of)} seeds", mean, bound, "%"))
        if of and name in FOUND_TOO:
            other = sum((run.n, run.N) != (2, 4) for run in of)
            verdicts.append((f"{name}: runs that find another n, N", other, 0, ""))
    failures = [
        two_of_four.row(run)
        for run in runs
        if run.nrms > SYNTHETIC_BOUNDS[run.case] or (run.n, run.N) != (2, 4)
    ]
    failed = results.table(two_of_four.HEAD, failures, markdown=True) if failures else "None."
    rows = [two_of_four.row(run) for run in runs] + two_of_four.mean_rows(runs)
    return f"""{source(figures)}

A sphere of {figures["texels"]} points, {figures["basis"]} basis, light (capture, novel): {figures["lights"]},
search order: {figures["search_order"]}, automatic penalties. NRMS is of the novel light in views that were
not measured; the floor has the true weights.

{results.verdicts(verdicts)}

Runs above the bound, or with another n or N:

{failed}

Every run:

{results.table(two_of_four.HEAD, rows, markdown=True)}
"""


def capture_verdicts(runs: list[Figures]) -> list[results.Verdict]:
    """The issue's bounds, each for the basis that does better there."""

    def best(name: str, views: int) -> Figures | None:
        of = [run for run in runs if (run["capture"], run["views"]) == (name, views)]
        return min(of, key=lambda run: run["evaluation"]["nrms"]) if of else None

    verdicts: list[results.Verdict] = []
    for name, views, bound in (("sphere-merl", 12, 0.085), ("sphere-merl", 6, 0.11)):
        if (run := best(name, views)) is not None:
            verdicts.append((f"{name}, k={views} ({run['basis']})", run["evaluation"]["nrms"], bound, "%"))
    if (run := best("sphere-merl", 12)) is not None:
        ratio = run["evaluation"]["nrms"] / run["floor"]["nrms"]
        verdicts.append((f"sphere-merl, k=12 ({run['basis']}), over its floor", ratio, 1.2, "x"))
    if (run := best("igea-merl", 12)) is not None:
        half = f"igea-merl, k=12 ({run['basis']}), half of the peer's"
        verdicts.append((half, run["evaluation"]["nrms"], IGEA_PEER / 2, "%"))
    return verdicts


def captures_section(figures: Figures) -> str:
    runs = figures["runs"]
    commits = ", ".join(dict.fromkeys(run["commit"] for run in runs))
    rows = [captures.row(run) for run in runs]
    limit = 100 * captures.SHUT_IN
    parts = []
    for run in runs:
        b = run["breakdown"]
        shares = (b[f"{part}_nrms"] for part in ("seen", "unseen", "open", "shut_in"))
        floor_error = min(1.0, (run["floor"]["nrms"] / run["evaluation"]["nrms"]) ** 2)
        cells = [f"{100 * share:.2f}" if share > 0 else "-" for share in (*shares, floor_error)]
        parts.append([f"{run['capture']}, {run['basis']}", str(run["views"]), *cells])
    split_head = ["capture", "k", "seen", "unseen", "open", "shut in", "floor's share of error"]
    return f"""{source(figures)} Runs were made at commit {commits}.

Novel-light NRMS on `test/`, in %. Each command is a process of its own; *s* and *MB* are the wall
time and peak memory of `swatchwork reconstruct`, *atlas* its resolution, the default. The floor is the same
basis and texels with the true weights. *inner* is n.o above 0.2; *rim, share*: NRMS below that, and the part
of the squared error there. *unseen, share*: texels that no photograph shows, and the part of the error at
them. *shut in, share*: test pixels from which the object hides more than {limit:.0f} % of the hemisphere,
and the part of the error there.

{results.verdicts(capture_verdicts(runs))}

{results.table(captures.HEAD, rows, markdown=True)}

Where the error sits: NRMS in % at seen and unseen texels, at open and shut-in ones, and how much of the
squared error the floor has too (the basis, the light's resolution, interreflections).

{results.table(split_head, parts, markdown=True)}
"""


def shadows_section(figures: Figures) -> str:
    rows = [shadows.row(r) for r in figures["rows"]]
    return f"""{source(figures)}

Irradiance under the capture's own light at {shadows.TEXELS} texels of a {shadows.RESOLUTION} x
{shadows.RESOLUTION} atlas, from the masks of so many shared samples (0: no shadows at all), against masks of
their own with every cell traced: NRMS in %, of all and of the 95 % nearest the truth. Seconds, and
megabytes of masks. {sky.SAMPLES:,} are the default.

{results.table(shadows.HEAD, rows, markdown=True)}
"""


def forward_section(figures: Figures) -> str:
    names = ("sigma below 0.1", "sigma from 0.1 up", "diffuse")
    rows = [
        [name, *(f"{100 * v:.2f}" for v in values)]
        for name, values in (
            *figures["worst"].items(),
            *((f"all, seed {seed} alone", values) for seed, values in figures["seeds"].items()),
        )
    ]
    sharp, broad, diffuse = (max(v[k] for v in figures["worst"].values()) for k in range(3))
    verdicts = [
        ("worst kernel and probe, sigma below 0.1", sharp, FORWARD_BOUNDS[0], "%"),
        ("worst kernel and probe, all", max(sharp, broad, diffuse), FORWARD_BOUNDS[1], "%"),
    ]
    count = len(figures["seeds"])
    return f"""{source(figures)}

Responses of every kernel against brute-force quadrature over the probe's own raster, at
{figures["pairs"]} random pairs of normal and viewer with n.o above 0.1: NRMS in % of the worst kernel by
itself. A pair costs {figures["lookups"]} environment lookups and up to {max(figures["lights"])} point lights.
A few grazing views of a bright spot hold most of a kernel's energy, so that each of the {count} seeds alone
is a small sample; the bounds are for all of them.

{results.verdicts(verdicts)}

{results.table(["probe", *names], rows, markdown=True)}
"""


def planning_section(figures: Figures) -> str:
    rows, took = figures["rows"], figures["duration"]
    most = planning.FEWER[-1]
    of = {kind: planning.ratio(rows, kind) for kind in ("planned", "uniform", "random")}
    runs = {kind: planning.ratio_of_runs(rows, kind) for kind in of}
    verdicts = [
        (f"{most} planned views: error over that of {planning.RANDOM_K} random ones", of["planned"], 1, ""),
        (f"30 views, {took['triangles']} triangles, 1024 x 512 probe", took["seconds"], 30, "s"),
    ]
    target = f"{planning.MATERIALS} GGX materials, {planning.BLENDED} blended at a point"
    draws = f"{planning.RANDOM_K} random ones ({planning.DRAWS} draws)"
    fewer = ", ".join(f"{planning.ratio(rows, 'planned', k):.2f} with {k}" for k in planning.FEWER)
    words = f"""Novel-light NRMS in % by kind and number of views. Over that of {draws},
means over the seeds, median of the nine scenes: planned ones {fewer};
{most} that are merely far apart {of["uniform"]:.2f}; {most} random ones {of["random"]:.2f}. Run by run the
medians are {runs["planned"]:.2f}, {runs["uniform"]:.2f} and {runs["random"]:.2f}: ten random views are
at times as good as any, and at times very bad."""
    return f"""{source(figures)}

{len(rows)} runs: three objects under three lights, five seeds each;
{target}, {planning.NOISE_PERCENT:g} % noise, n and N found.
{words}

{results.verdicts(verdicts)}

{results.table(list(planning.COLUMNS), [planning.cells(r) for r in rows], markdown=True)}
"""


def confidence_section(figures: Figures) -> str:
    rows = figures["rows"]
    verdicts = [(f"{r['capture']}: 1 - correlation", 1 - r["expected"], 0.4, "") for r in rows]
    gain = min(r["expected"] - r["views"] for r in rows)
    verdicts.append(("correlation of the number of views, less ours, at most", -gain, 0, ""))
    return f"""{source(figures)}

The error that is expected of each texel (material/trust.py, learnt from held-out views of the capture alone)
against its actual one under novel light, from the true materials: Spearman's rank correlation, beside that of
the number of views and of the residual. *nine*: root mean squares over a texel and its eight nearest. One
texel's actual error depends on which highlights reach which viewer, which no map of the surface can know:
*halves* is its correlation with itself between two halves of the viewers, *own light* that between the novel
light and the capture's. The last columns are root mean squares, of the actual error without its largest
hundredth.

{results.verdicts(verdicts)}

{results.table(list(confidence.HEAD), [confidence.cells(r) for r in rows], markdown=True)}
"""


EXPORT_BOUND = 0.02
"""NRMS of the Mitsuba export on igea-merl against relight."""


def exports_section(figures: Figures) -> str:
    rows = figures["rows"]
    verdicts = [
        (f"{r['capture']}: Mitsuba against {what}", r[key], EXPORT_BOUND, "%")
        for r in rows
        if r["export"] == "mitsuba"
        for key, what in (("nrms", "relight"), ("fine", f"relight --samples {exports.FINE}"))
    ]
    return f"""{source(figures)}

Pictures by Mitsuba against `relight`, light and cameras of `test/`. NRMS is free of the renderer's noise (two
seeds; the product of their differences), *noise* is that of one picture. `relight` shades a pixel inside the
object once unless told otherwise, Mitsuba in many places: in *fine*, `relight --samples {exports.FINE}` does
too, and what is left is the difference of the models. *stated loss* is what the command says of the .glb: of
single points without shadows under a light that the fit did not see. It is read back and its BRDF evaluated
anew from the specification (scripts/measure/gltf_bsdf.py).

{results.verdicts(verdicts)}

{results.table(exports.HEAD, [exports.row(r) for r in rows], markdown=True)}
"""


PHOTOGRAPH_NOISE = 0.02
"""Of the photographs of spot-merl-interreflect, from its README."""


def interreflections_section(figures: Figures) -> str:
    rows = figures["rows"]
    plain = rows[0]
    last = [r for r in rows if r["fit"] == f"rounds: {interreflections.ROUNDS}"][-1]
    verdicts: list[results.Verdict] = [
        (f"{part}: NRMS with both over that with neither", last[part] / plain[part], 1.0, "")
        for part in ("all", "shut_in", "deep")
    ]
    low, tenth, hundredth = (100 * plain["indirect"][k] for k in interreflections.SHARES)
    shut_in, deep = 100 * interreflections.SHUT_IN, 100 * interreflections.DEEP
    return f"""{source(figures)}

Atlas of {figures["resolution"]} x {figures["resolution"]} texels, extended basis, test views at a third of
their size. NRMS in %; *shut in*: pixels whose texel's sky the object hides to more than {shut_in:.0f} %
(cosine-weighted), *deep*: to more than {deep:.0f} %. *rounds* are of solving and blending under the light
that the object sends to itself; as many rounds without that light are the control. *cpu ratio*: CPU time of
all rounds so far over that of the plain reconstruction. *MB*: peak of the process up to there, relighting
included. Of the light shown to the photographs, indirect light is {low:.1f} % at the typical point, over
{tenth:.1f} % at a tenth of the points and over {hundredth:.0f} % at a hundredth.

{results.verdicts(verdicts)}

{results.table(interreflections.HEAD, [interreflections.cells(r) for r in rows], markdown=True)}
"""


def interreflections_check_section(figures: Figures) -> str:
    noise = figures["noise"]
    names = ("median", "tenth", "hundredth")
    median, tenth, hundredth = (100 * noise[name] for name in names)
    verdicts: list[results.Verdict] = [
        ("noise of all light shown, NRMS", noise["nrms"], PHOTOGRAPH_NOISE, "%"),
        ("noise at the 90th percentile of measurements", noise["tenth"], PHOTOGRAPH_NOISE, "%"),
        ("sphere-merl: places that see the object", figures["places_of_convex"], 0, ""),
    ]
    return f"""{source(figures)}

Noise of all light that spot shows to its photographs, relative to it, from two sets of places where indirect
light is gathered: {median:.2f} % at the median measurement, {tenth:.2f} % at the 90th percentile,
{hundredth:.1f} % at the 99th. The photographs have {100 * PHOTOGRAPH_NOISE:.0f} %. An object that sees
nothing of itself is left as it was found.

{results.verdicts(verdicts)}
"""


def silhouettes_section(figures: Figures) -> str:
    rows = figures["rows"]
    verdicts = [(f"{r['capture']}: worst angle", r["degrees"], 0.1, "degrees") for r in rows]
    verdicts += [(f"{r['capture']}: worst place", r["share"], 0.002, "%") for r in rows]
    return f"""{source(figures)}

`prepare register` without a clicked pair: each photograph is placed where its alpha is the mesh's silhouette
and nowhere else. Place: distance of the camera from the true one, over that to the object.

{results.verdicts(verdicts)}

{results.table(silhouettes.HEAD, [silhouettes.cells(r) for r in rows], markdown=True)}
"""


CANVAS_BOUNDS = {"sphere": 0.03, "knot": 0.05, "igea-merl": 0.05}
LARGEST_PAGE_MB, SLOWEST_S = 20.0, 3.0


def viewer_section(figures: Figures) -> str:
    canvases, pages = figures["canvases"], figures["pages"]
    verdicts = [
        (f"{r['name']}: worst canvas, against {what}", r[key], CANVAS_BOUNDS[r["name"]], "%")
        for r in canvases
        for key, what in (("nrms", "relight"), ("fine", f"relight --samples {viewer.FINE}"))
    ]
    verdicts += [(f"{r['name']}: page", r["megabytes"], LARGEST_PAGE_MB, "MB") for r in pages]
    verdicts += [(f"{r['name']}: first picture", r["first_picture_s"], SLOWEST_S, "s") for r in pages]
    return f"""{source(figures)}

The page of `swatchwork view` in headless Chromium, drawn by software on two cores (no graphics card).
Canvases: still pictures of so many *passes* (a person's has 64), by evenly drawn windows of 16 x 16
pixels of the object, against `relight`, three cameras and two lights each, A > 0.5; *fine*: against
`relight --samples {viewer.FINE}`, *sampling*: of `relight` against that, the worst of each. First
picture: from opening the file, the median of {viewer.LOADS} loads. No page said anything on the console
or asked for anything but itself.

{results.verdicts(verdicts)}

{results.table(viewer.CANVAS_HEAD, [viewer.canvas_cells(r) for r in canvases], markdown=True)}

{results.table(viewer.PAGE_HEAD, [viewer.page_cells(r) for r in pages], markdown=True)}
"""


def frames_section(figures: Figures) -> str:
    rows, sound, littered = figures["rows"], figures["sound"], figures.get("littered", [])
    must = [row for row in rows if row["fault"] in frames.MUST]
    costed = [row for row in must if "as_is" in row]
    light = [row for row in rows if row["fault"] not in frames.MUST]
    verdicts: list[results.Verdict] = [
        (f"of {len(must)} that must be named: not named", sum(not row["named"] for row in must), 0, ""),
        ("named beside the wrong one", sum(row["others"] for row in rows), 0, ""),
        (f"named in {len(sound)} sound captures", sum(row["named"] for row in sound), 0, ""),
    ]
    if costed:
        ratio = max(row["diagnosed"] / row["left_out"] for row in costed)
        verdicts.append(("those: worst NRMS over leaving out by hand", ratio, frames.RATIO, "x"))
        ratio = max(row["diagnosed"] / row["clean"] for row in costed)
        verdicts.append(("those: worst NRMS over the clean capture's", ratio, frames.RATIO, "x"))
    wrong = sum(not row["right"] for row in rows)
    unnamed = sum(not row["named"] for row in light)
    return f"""{source(figures)}

One of {frames.VIEWS} photographs is wrong; what `reconstruct` says of it, and novel-light NRMS in %: *as is*
(`--keep-suspects`), *diagnosed*, *left out* by hand, and of the *clean* capture; *ratio* is diagnosed over
left out. Atlas {frames.RESOLUTION}, {frames.TEXELS} texels, n = 2 and N = 4 given, alike in all columns. Of
the {len(light)} milder faults {unnamed} are not named; the kind is wrong, or none, in
{wrong} of all {len(rows)}.

{results.verdicts(verdicts)}

{results.table(frames.HEAD, [frames.cells(row) for row in rows], markdown=True)}

With outliers besides, in a share of the object's pixels of every photograph; *in doubt*: the summary says
that there are too many contradictions to judge.

{results.table(frames.OUTLIERS_HEAD, [frames.outlier_cells(row) for row in littered], markdown=True)}

Sound captures: photographs named, the largest scale that one of them is measured to have against the others,
and the largest misfit (0 to 1).

{results.table(frames.ALARM_HEAD, [frames.alarm_cells(row) for row in sound], markdown=True)}
"""


SECTIONS: dict[str, tuple[str, Callable[[Figures], str]]] = {
    "forward_model": ("Forward model", forward_section),
    "exactness": ("Exactness", exactness_section),
    "two_of_four": ("Two of four materials", two_of_four_section),
    "two_of_four-paper-order": ("Two of four materials, in the paper's search order", two_of_four_section),
    "robust": ("Robust fit", robust_page.section),
    "shadows": ("Shared shadows", shadows_section),
    "captures": ("Captures of measured materials", captures_section),
    "planning": ("Planned views", planning_section),
    "confidence": ("Expected errors", confidence_section),
    "frames": ("Suspect photographs", frames_section),
    "silhouettes": ("Poses by silhouettes", silhouettes_section),
    "photographs": (
        "From photographs",
        lambda figures: f"{source(figures)}\n\n{photographs_page.section(figures)}",
    ),
    "viewer": ("Viewer", viewer_section),
    "exports": ("Exports", exports_section),
    "interreflections": ("Interreflections", interreflections_section),
    "interreflections-check": (
        "Interreflections: noise, and a convex object",
        interreflections_check_section,
    ),
}
HEAD = """# Validation

Written by `make validate` (scripts/measure/page.py); do not edit. A commit with a "+" had uncommitted changes
of the package.
"""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--figures", type=Path, default=results.ROOT / "target" / "validation")
    parser.add_argument("--page", type=Path, default=results.ROOT / "docs" / "validation.md")
    args = parser.parse_args()
    results.write_page(args.page, HEAD, SECTIONS, args.figures)


if __name__ == "__main__":
    main()

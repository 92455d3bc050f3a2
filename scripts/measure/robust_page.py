# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The section on noise and outliers of docs/validation.md, from robust.py's figures."""

from __future__ import annotations

from typing import Any

import results

FOUND = {0.0: 0.9, 1.0: 0.9, 2.0: 0.9, 3.0: 0.9, 5.0: 0.7}
"""Share of the runs that are to find n=2, N=4, by noise."""
SPOILT = 1.5
"""NRMS of spoilt photographs over that of clean ones, at most."""
COST = 1.05
"""CPU time and memory of a clean capture with the robust fit over those without, at most."""

Rows = list[dict[str, Any]]


def section(figures: dict[str, Any]) -> str:
    """The parts that were measured, each with its source."""
    parts = [("noise", noise), ("weighed", weighed), ("outliers", outliers), ("cost", cost)]
    return "\n\n".join(
        f"{_source(figures['sources'][name])}\n\n{write(figures)}" for name, write in parts if name in figures
    )


def noise(figures: dict[str, Any]) -> str:
    runs: Rows = figures["noise"]
    verdicts: list[results.Verdict] = []
    rows = []
    for level, share in FOUND.items():
        for truth in ("basis", "ggx"):
            of = [run for run in runs if run["noise"] == level and run["truth"] == truth]
            if not of:
                continue
            other = sum((run["n"], run["N"]) != (2, 4) for run in of)
            nrms = [100 * run["nrms"] for run in of]
            floor = sum(100 * run["floor"] for run in of) / len(of)
            rows.append(
                [
                    f"{level:g} %, {truth}",
                    len(of),
                    len(of) - other,
                    f"{sum(nrms) / len(nrms):.3f}",
                    f"{max(nrms):.3f}",
                    f"{floor:.3f}",
                    ", ".join(sorted({f"{run['n']}, {run['N']}" for run in of})),
                ]
            )
        every = [run for run in runs if run["noise"] == level]
        if every:
            wrong = sum((run["n"], run["N"]) != (2, 4) for run in every) / len(every)
            verdicts.append((f"{level:g} % noise: runs that find another n, N", wrong, 1 - share, "%"))
    found = sum(run["outliers"] is not None for run in runs)
    verdicts.append(("runs that see outliers in mere noise", found, 0, ""))
    head = ["noise, truth", "seeds", "found 2, 4", "NRMS %", "worst %", "floor %", "n, N found"]
    of_noise = figures["sources"]["noise"]
    return f"""Two blended of four materials, k=6, {of_noise["texels"]} points, light (capture, novel):
{of_noise["lights"]}. Noise of p %: each measurement times 1 + p/100 N(0,1), plus p/200 of the median
measurement times N(0,1). NRMS is of the novel light in views that were not measured.

{results.verdicts(verdicts)}

{results.table(head, rows, markdown=True)}"""


def weighed(figures: dict[str, Any]) -> str:
    runs: Rows = figures["weighed"]
    rows = []
    for truth in dict.fromkeys(run["truth"] for run in runs):
        of = [run for run in runs if run["truth"] == truth]
        noisy = 100 * sum(run["noisy"] for run in of) / len(of)
        cells = [f"{of[0]['noise']:g} %, {truth}", len(of), f"{noisy:.0f}"]
        for case in ("alike", "weighed"):
            found = sum((run[case]["n"], run[case]["N"]) == (2, 4) for run in of)
            cells += [found, f"{100 * sum(run[case]['nrms'] for run in of) / len(of):.3f}"]
        rows.append(cells)
    head = [
        "noise, truth",
        "seeds",
        "noisy %",
        "alike: found 2, 4",
        "NRMS %",
        "weighed: found 2, 4",
        "NRMS %",
    ]
    points = figures["sources"]["weighed"]["texels"]
    return f"""The same ({points} points), every point counted *alike* as in the table above, and *weighed*
by its read noise as `reconstruct` does (that noise given; on captures it is estimated). *Noisy* points are
those that then count less. A point's coverage gives it no weight of its own: the relative error of Eq. 5 is a
sum over its views already, and a point that few views see is as much of the surface.

{results.table(head, rows, markdown=True)}"""


def outliers(figures: dict[str, Any]) -> str:
    runs: Rows = figures["outliers"]
    names = list(dict.fromkeys((run["shape"], run["seed"]) for run in runs))
    verdicts: list[results.Verdict] = []
    rows = []
    for shape, seed in names:
        of = {run["case"]: run for run in runs if (run["shape"], run["seed"]) == (shape, seed)}
        clean = of["clean"]["nrms"]
        verdicts.append(
            (f"{shape}, seed {seed}: spoilt over clean", of["spoilt"]["nrms"] / clean, SPOILT, "")
        )
        for case, run in of.items():
            rows.append(
                [
                    f"{shape}, seed {seed}, {case}",
                    f"{run['n']}, {run['N']}",
                    f"{100 * run['nrms']:.2f}",
                    f"{run['nrms'] / clean:.2f}",
                    f"{100 * run['left_out']:.0f}",
                    f"{100 * run['undecided'] / run['texels']:.0f}",
                    f"{run['cpu_seconds']:.0f}",
                ]
            )
    head = ["capture", "n, N", "NRMS %", "over clean", "left out %", "undecided %", "CPU s"]
    return f"""Captures of 12 photographs (128 pixels, GGX, 1 % noise and read noise), a fifth of the
object's pixels replaced by blobs of another colour and by single bright pixels; a third of the samples are
touched. *All counted* is `--no-robust`. *Undecided* are texels of whose views no two agree, or that one
view sees: they have a neighbour's blend that a view agrees with, else their own that one agrees with, else
the nearest. *Without texels of one or two views*: representatives of the clean capture from those of the
drawn texels that three views see, the fewest that can outvote an outlier, without weights of noise and
without the survey for what they miss; all texels are blended from them. NRMS of clean test frames under
another light.

{results.verdicts(verdicts)}

{results.table(head, rows, markdown=True)}"""


def cost(figures: dict[str, Any]) -> str:
    of = figures["cost"]
    rows = [
        ["with" if run["robust"] else "without", f"{run['cpu_seconds']:.1f}", f"{run['peak_mb']:.0f}"]
        for run in of["runs"]
    ]
    verdicts = [
        ("CPU time, with over without (the least of each)", of["time"], COST, ""),
        ("peak memory, with over without", of["memory"], COST, ""),
        ("materials that differ", float(not of["same"]), 0, ""),
    ]
    return f"""A clean capture with and without the robust fit, by turns, a process each.

{results.verdicts(verdicts)}

{results.table(["robust fit", "CPU s", "peak MB"], rows, markdown=True)}"""


def _source(of: dict[str, Any]) -> str:
    return f"`{of['command']}`, commit {of['commit']}, {of['date']}."

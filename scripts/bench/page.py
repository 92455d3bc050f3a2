# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Write docs/benchmarks.md from the figures that the benchmarks left as JSON.

    python scripts/bench/page.py --figures target/bench --page docs/benchmarks.md

Reads the JSON of all the benchmarks; a part without one stays as the page has it. Every verdict is computed
from them against the bounds below; ratios compare runs of one file.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import beside_commit
import beside_peer
import resume
import scaling
import shared
import stages
import streaming
import table1
from shared import results

Figures = dict[str, Any]

MINUTES = {"Mouse": 5.0, "Pig": 8.0}
"""Wall time at most, on 2 cores, at 1024 x 1024."""
MOUSE_GB = 4.0
STREAMING = 0.02
"""Relative difference of novel-light NRMS between the subset and every texel."""
HARD_SECONDS = 120.0
"""A million texels at N=18, n=5."""
VISITED = 0.02
"""Of brute force's supports."""
SLOPE = 1.05
"""Of cost over M."""
FLAT = 0.1
"""Slope of peak memory over M that counts as flat."""
OF_PEER = (0.4, 0.1)
"""NRMS and time, ours over the peer's converged ones."""
CORES = 2
"""That the bounds on time are for."""
FULL = 1024
"""Side of the atlas that the bounds of Table 1's rows are for."""


def source(figures: Figures, parts: list[Figures]) -> str:
    """Command, commits of the measured parts, date, machine."""
    commits = ", ".join(dict.fromkeys(part["commit"] for part in parts)) or figures["commit"]
    m = figures["machine"]
    return (
        f"`{figures['command']}`, commit {commits}, {figures['date']}; "
        f"{m['cores']} cores, {m['processor']}, {m['instruction_set']}."
    )


def commands(parts: list[Figures]) -> str:
    """The measured command lines, once each, as a block."""
    lines = dict.fromkeys(f"    {part['command']}  # commit {part['commit']}" for part in parts)
    return "\n".join(lines)


# ---- sections ------------------------------------------------------------------------------------
def table1_section(figures: Figures) -> str:
    rows = figures["rows"]
    names = table1.stage_names(rows)
    found: list[results.Verdict] = []
    for row in rows:
        name, cost = row["row"]["name"], row["cost"]
        if name in MINUTES and figures["resolution"] == FULL and figures["machine"]["cores"] <= CORES:
            found.append((f"{name}, wall", cost["wall_s"] / 60, MINUTES[name], "min"))
        if name == "Mouse" and figures["resolution"] == FULL:
            found.append(("Mouse, peak memory", cost["peak_mb"] / 1000, MOUSE_GB, "GB"))
    paper = [row["row"]["paper_minutes"] * 60 / row["cost"]["wall_s"] for row in rows]
    mean = math.exp(sum(map(math.log, paper)) / len(paper))
    bounds = (
        results.verdicts(found) if found else f"The bounds are for a {FULL} x {FULL} atlas on {CORES} cores."
    )
    return f"""{source(figures, rows)}

Simulated captures of the same k, n and N, images of *pixels* a side, atlas of
{figures["resolution"]} x {figures["resolution"]} (scripts/bench/scenes.py: GGX lobes beyond
either basis, Smith masking, 1 % noise). n and N are found by the search; the truth's are in brackets. *paper*
is its minutes on 8 Xeon cores, on its own objects; *wall* and *cpu* are minutes of `swatchwork reconstruct`,
from EXR files to material folder; then the stages' seconds. NRMS is of the novel light, in %: that light
has a sun, and where its image at a grazing angle is in the picture, a thousandth of the pixels decides the
NRMS; PSNR-L, which clips at white, tells of the rest. Both count what no photograph shows (*unseen*, in % of
the texels), where the nearest seen texel's blend stands in. The paper's minutes over ours, geometric mean:
{mean:.1f}.

{bounds}

{results.table(table1.head(names), [table1.cells(row, names) for row in rows], markdown=True)}

{commands(rows)}
"""


def scaling_section(figures: Figures) -> str:
    series = figures["series"]
    found: list[results.Verdict] = []
    if "M" in series:
        slope = scaling.slopes("M", series["M"])
        found.append(("slope of cpu time over M", slope["cpu"][0], SLOPE, ""))
        found.append(("the same between the two largest", slope["cpu"][1], SLOPE, ""))
        found.append(("slope of wall time over M", slope["wall"][0], SLOPE, ""))
        found.append(("slope of peak memory over M", slope["MB"][0], FLAT, ""))
        found.append(("the same between the two largest", slope["MB"][1], FLAT, ""))
    tables = [scaling.table(name, done, markdown=True) for name, done in series.items()]
    every = [run for done in series.values() for run in done]
    return f"""{source(figures, every)}

The capture of {figures["capture"]}, with images of {figures["size"]} x {figures["size"]} pixels;
n = {scaling.GIVEN["n"]} and N = {scaling.GIVEN["N"]} are given, but for the series that vary them, and the
atlas is of {scaling.RESOLUTION} x {scaling.RESOLUTION} texels, but for M. Seconds, in all and by stage;
*MB* is peak memory. The last two rows are log-log slopes, of all points by least squares and between the two
largest.

{results.verdicts(found) if found else ""}

{(chr(10) * 2).join(tables)}

{commands(every)}
"""


def stages_section(figures: Figures) -> str:
    parts = figures["parts"]
    found: list[results.Verdict] = []
    hard = parts.get("hard")
    if hard:
        found.append(
            (
                f"N=18, n=5, a million texels (of {hard['texels']:,})",
                hard["seconds_a_million"],
                HARD_SECONDS,
                "s",
            )
        )
        found.append(("its supports, of brute force's", hard["share"], VISITED, "%"))
    rows = parts.get("blend", {}).get("rows", ())
    if rows:
        of_all = sum(row["relaxations"] for row in rows) / sum(
            row["relaxations"] / row["share"] for row in rows
        )
        found.append(("all rows' supports, of brute force's", of_all, VISITED, "%"))
    extra = ""
    if "respond" in parts and not parts["respond"]["limit"]:
        extra = "\nBare lookups were not measured: run `cargo bench -p swatchwork-core` first.\n"
    rates = [[name, f"{rate / 1e6:.1f}"] for name, rate in figures["criterion"].items()]
    kernels = results.table(["criterion bench", "M/s"], rates, markdown=True) if rates else "Not run."
    views = f", {hard['views']:.1f} views a texel" if hard else ""
    return f"""{source(figures, list(parts.values()))} {figures["threads"]} threads.

What limits a stage: the bytes of the files for reading, bare environment lookups for responses, a dense
product in BLAS for the Gram blocks. The Gram blocks' rate is of the work that a product for each pair of
representatives would take; the kernel does less, for it forms a texel's products once for all of its pairs,
and can pass that limit (see scripts/bench/stages.py).
{extra}
{results.table(stages.LIMIT_HEAD, stages.limit_rows(parts), markdown=True)}

Exact blends; representatives outside the truth, 1 % noise{views}.

{results.verdicts(found) if found else ""}

{results.table(stages.BLEND_HEAD, stages.blend_rows(parts), markdown=True)}

Kernels:

{kernels}
"""


def peer_section(figures: Figures) -> str:
    captures = figures["captures"]
    found: list[results.Verdict] = []
    for capture in captures:
        of_error, of_time = beside_peer.ratios(capture)
        converged = "" if capture["peer"]["converged"] else " (not converged)"
        at_least = ", at least" if beside_peer.arrived(capture) == 0 else ""
        found.append(
            (f"{capture['capture']}: NRMS over the peer's lowest{converged}", of_error, OF_PEER[0], "")
        )
        found.append(
            (f"{capture['capture']}: time over the peer's{converged}{at_least}", of_time, OF_PEER[1], "")
        )
    runs = [run for capture in captures for run in (capture["ours"], capture["peer"])]
    versions = ", ".join(dict.fromkeys(capture["peer"]["mitsuba"] for capture in captures))
    schedule = ", ".join(f"{name} {value:g}" for name, value in captures[0]["peer"]["schedule"].items())
    rows = [row for capture in captures for row in beside_peer.rows(capture)]
    return f"""{source(figures, runs)}

The peer is Mitsuba {versions}: textures of a `principled` BSDF by Adam (scripts/bench/peer.py; {schedule}),
with the same mesh, cameras and light, one after the other. NRMS is of the novel light in test/, in %. The
peer is scored at 1, 5, 10 and 20 times our time, until it has converged: twice the time lowers its misfit to
the photographs by less than 1 %. Its time in the ratio is the last checkpoint whose misfit was not yet within
1 % of the last one's, or the first. Who fits it does not see the novel light's error, which may be lowest
long before; its NRMS in the ratio is the lowest of all checkpoints.

{results.verdicts(found)}

{results.table(beside_peer.HEAD, rows, markdown=True)}

{commands(runs)}
"""


def streaming_section(figures: Figures) -> str:
    found: list[results.Verdict] = []
    for subset, every in streaming.pairs(figures["runs"]):
        a, b = (run["evaluation"]["nrms"] for run in (subset, every))
        other = sum(subset["summary"][letter] != every["summary"][letter] for letter in ("n", "N"))
        found.append((f"{subset['capture']}: NRMS, relative difference", abs(a - b) / b, STREAMING, "%"))
        found.append((f"{subset['capture']}: of n and N, how many differ", other, 0, ""))
    rows = [row for pair in streaming.pairs(figures["runs"]) for row in streaming.rows(*pair)]
    return f"""{source(figures, figures["runs"])}

Atlas of {figures["resolution"]} x {figures["resolution"]}. *subset* is the default; *every* searches n
and N on all texels throughout.

{results.verdicts(found)}

{results.table(streaming.HEAD, rows, markdown=True)}
"""


def resume_section(figures: Figures) -> str:
    kills = figures["kills"]
    differ = sum(bool(kill["differ"]) for kill in kills)
    return f"""{source(figures, [figures["undisturbed"]])}

An undisturbed run took {figures["undisturbed"]["cost"]["wall_s"]:.1f} s. Each killed one goes on by the same
command; every file is compared but the report, which tells the time.

{results.verdicts([(f"of {len(kills)} runs, how many end with another material", differ, 0, "")])}

{results.table(resume.HEAD, resume.rows(figures), markdown=True)}
"""


WORSE = 1.05


def beside_section(figures: Figures) -> str:
    rows = figures["rows"]
    found = [
        (f"{row['capture']}: {what}, over commit {figures['before']}", row[key], WORSE, "times")
        for row in rows
        for key, what in (("cpu", "CPU time"), ("wall", "time"), ("peak", "peak memory"))
    ]
    return f"""{source(figures, [])}

Clean captures, 1 % noise, reconstructed by that commit and by this one in turn: what looking for outliers and
for suspect photographs, digests of checkpoints and limits on files cost where there is nothing to be found.

{results.verdicts(found)}

{results.table(beside_commit.HEAD, [beside_commit.cells(row) for row in rows], markdown=True)}
"""


SECTIONS: dict[str, tuple[str, Callable[[Figures], str]]] = {
    "table1": ("Table 1 of the paper", table1_section),
    "peer": ("Beside Mitsuba 3", peer_section),
    "scaling": ("Cost against M, k, N, n", scaling_section),
    "stages": ("Stages against their limits", stages_section),
    "streaming": ("A subset of texels against every texel", streaming_section),
    "beside_commit": ("Clean captures, beside an earlier commit", beside_section),
    "resume": ("kill -9 at random moments", resume_section),
}
HEAD = """# Benchmarks

Written by `make bench` (scripts/bench/page.py); do not edit. A commit with a "+" had uncommitted changes of
the package. Peak memory is the largest resident size of the process, in 1e6 bytes.
"""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--figures", type=Path, default=shared.BENCH)
    parser.add_argument("--page", type=Path, default=results.ROOT / "docs" / "benchmarks.md")
    args = parser.parse_args()
    results.write_page(args.page, HEAD, SECTIONS, args.figures)


if __name__ == "__main__":
    main()

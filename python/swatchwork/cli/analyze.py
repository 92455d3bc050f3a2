# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork analyze``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from .console import plain, session
from .options import AsJson, BasisName, Convention, Quiet, Seed, Threads, Verbose, use_threads

if TYPE_CHECKING:
    from ..workflow import AnalysisSummary


class Where(StrEnum):
    """Where the views of an object are."""

    random = "random"
    uniform = "uniform"
    planned = "planned"


def analyze(
    capture: Annotated[
        Path | None, typer.Argument(help="A capture: its own views, object and light.", show_default=False)
    ] = None,
    *,
    mesh: Annotated[Path | None, typer.Option(help="Instead: an object to be captured.")] = None,
    shape: Annotated[
        str | None, typer.Option(help="Instead: plane, cap, hemisphere (normals of pi, 2 pi) or sphere.")
    ] = None,
    environment: Annotated[
        list[Path] | None,
        typer.Option(help="HDR light probe; several are compared, and views counted under the first."),
    ] = None,
    convention: Annotated[
        list[Convention] | None,
        typer.Option(help="How their pixels stand for directions: one for all, or one each."),
    ] = None,
    rotations: Annotated[
        int, typer.Option(min=1, metavar="COUNT", help="Compare each light at so many angles about z.")
    ] = 1,
    directional: Annotated[
        bool, typer.Option("--directional", help="Instead: a random directional light a view.")
    ] = False,
    arrangement: Annotated[
        Where | None,
        typer.Option("--arrangement", help="Where the views of an object are.", show_default="random"),
    ] = None,
    views: Annotated[
        int | None,
        typer.Option(min=1, metavar="COUNT", help="How many.", show_default="the capture's, or 20"),
    ] = None,
    occluder: Annotated[
        list[Path] | None, typer.Option(help="Mesh that blocks light and sight; repeatable.")
    ] = None,
    basis: Annotated[BasisName, typer.Option(help="Generic basis.")] = BasisName.extended,
    noise: Annotated[
        float,
        typer.Option(metavar="SHARE", help="Relative noise of a measurement, for ranks and weight errors."),
    ] = 0.01,
    blended: Annotated[
        int, typer.Option(metavar="N", help="Materials blended at a point: the condition is at the (n-1)th.")
    ] = 4,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="HTML page with plots to write.")
    ] = None,
    seed: Seed = 0,
    threads: Threads = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Tell how many views suffice, from the ranks and condition numbers of both optimisations (section 5).

    Nothing is photographed or fitted: shape, light and cameras decide. For n materials at a point its blend
    matrix needs rank n - 1, and the smaller its condition number the less noise grows into the weights.

    Examples:

    swatchwork analyze my-capture -o analysis.html

    swatchwork analyze --mesh scan.ply --environment a.exr --convention mitsuba --rotations 4

    swatchwork analyze --shape sphere --directional --views 30
    """
    use_threads(threads)
    from ..workflow import analyze_views, environments_of

    files = environment or []
    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        found = analyze_views(
            capture=capture,
            mesh=mesh,
            shape=shape,
            environments=environments_of(files, [c.value for c in convention or []]) if files else (),
            names=[f"{file.absolute().parent.name}/{file.name}" for file in files],
            directional=directional,
            rotations=rotations,
            arrangement=arrangement.value if arrangement else None,
            views=views,
            occluders=occluder or [],
            basis=basis.value,
            noise=noise,
            blended=blended,
            seed=seed,
            page=output,
            progress=run.progress,
        )
        run.show(_table(found))
        if found.lights:
            run.show(_of_lights(found))
        run.say(found.in_words())
        run.result(found.as_dict())


def _table(found: AnalysisSummary) -> Table:
    table = Table(box=None, pad_edge=False)
    names = ("k", "seen %", "rank", "worst", "condition", "95 %", "worst", "weight error", "repr. rank")
    for name in names:
        table.add_column(name, justify="right")
    for r in found.rows:
        table.add_row(
            str(r.k),
            f"{100 * r.coverage:.1f}",
            f"{r.rank_median:g}",
            str(r.rank_worst),
            _number(r.condition_median),
            _number(r.condition_most),
            _number(r.condition_worst),
            "-" if r.weight_error is None else f"{r.weight_error:.2f}",
            str(r.representative_rank),
        )
    return table


def _of_lights(found: AnalysisSummary) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("light, the best first")
    for name in ("condition", "95 %", "representative rank"):
        table.add_column(name, justify="right")
    for r in found.lights:
        table.add_row(
            Text(plain(r.light)),
            _number(r.condition_median),
            _number(r.condition_most),
            str(r.representative_rank),
        )
    return table


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"

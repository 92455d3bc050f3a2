# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The page: each claim with our figure and a verdict, then the figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .experiment import Claim, Experiment, Setting, Table

HEAD = """# Reproduction

Written by `swatchwork reproduce`; do not edit. Each verdict is computed from the figures. {data}
{size}

"""


def page(experiments: Sequence[Experiment], found: Mapping[str, Any], setting: Setting) -> str:
    """Markdown of the experiments that have been run."""
    size = (
        "**Quick sizes: these figures only show that everything runs.**"
        if setting.quick
        else "NRMS is as in the paper's section 7, by pixels."
    )
    parts = [HEAD.format(data=setting.data.words(), size=size)]
    parts.append(_table(Table(("experiment", "claims", "hold", "seconds"), _summary(experiments, found))))
    for experiment in experiments:
        if experiment.name in found:
            parts.append(_section(experiment, found[experiment.name], setting))
    return "\n".join(parts)


def _summary(experiments: Sequence[Experiment], found: Mapping[str, Any]) -> tuple[tuple[str, ...], ...]:
    rows = []
    for experiment in experiments:
        if experiment.name not in found:
            rows.append((experiment.title, "not run", "", ""))
            continue
        claims = experiment.claims(found[experiment.name]["figures"])
        held = sum(claim.holds for claim in claims)
        rows.append(
            (experiment.title, str(len(claims)), str(held), f"{found[experiment.name]['seconds']:.0f}")
        )
    return tuple(rows)


def _section(experiment: Experiment, found: Any, setting: Setting) -> str:
    options = (
        (" --data DATA" if setting.data.folder else "")
        + (" --captures CAPTURES" if setting.captures else "")
        + (" --quick" if setting.quick else "")
    )
    commit = f", commit {found['commit']}" if found.get("commit") else ""
    command = f"`swatchwork reproduce {experiment.name}{options} -o DIR`{commit}\n"
    parts = [f"## {experiment.title}\n", command]
    parts.append(experiment.how + "\n")
    claims = experiment.claims(found["figures"])
    parts.append(_table(Table(("the paper", "here", "verdict"), tuple(_row(claim) for claim in claims))))
    parts += [f"{c.paper} Here: {c.why}\n" for c in claims if c.why and not c.holds]
    parts += [_table(table) for table in experiment.tables(found["figures"])]
    shown = [(f"{plot.name}.svg", plot.y_label) for plot in experiment.plots(found["figures"])]
    shown += [(file, words) for file, words in experiment.pictures if (setting.pictures / file).is_file()]
    parts += [f"![{words}](pictures/{file})\n" for file, words in shown]
    return "\n".join(parts)


def _row(claim: Claim) -> tuple[str, str, str]:
    return claim.paper, claim.found, "holds" if claim.holds else "**does not hold**"


def _table(table: Table) -> str:
    lines = [table.caption + ":\n"] if table.caption else []
    lines.append("| " + " | ".join(table.head) + " |")
    lines.append("| " + " | ".join("---" for _ in table.head) + " |")
    lines += ["| " + " | ".join(row) + " |" for row in table.rows]
    return "\n".join(lines) + "\n"

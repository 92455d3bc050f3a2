# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Run experiments one after another, keep their figures, and write the page."""

from __future__ import annotations

import hashlib
import json
import subprocess
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

from ..capture import read_capture
from ..errors import InputError
from ..progress import SILENT, Progress
from ..report import curve_plot
from ..whole import whole_text
from ..workflow import digest_of_the_package, fingerprints
from .data import Data
from .experiment import Claim, Experiment, Figures, Setting
from .fig2 import FIG2
from .fig4 import FIG4
from .fig5 import FIG5
from .fig6 import FIG6
from .fig7 import FIG7
from .fig8 import FIG8
from .fig9 import FIG9
from .methods import METHODS
from .page import page
from .penalties import PENALTIES
from .sensitivity import FIG10, FIG11
from .table1 import TABLE1

EXPERIMENTS = (FIG2, FIG4, PENALTIES, FIG5, FIG6, FIG7, FIG8, FIG9, FIG10, FIG11, TABLE1, METHODS)
SAME_AS = {"fig3": "fig4", "fig13": "table1", "fig14": "table1", "fig15": "table1", "fig16": "table1"}
"""Figures of the paper that one experiment measures together."""


@dataclass(frozen=True)
class Reproduction:
    """What was run and found."""

    output: str
    page: str
    claims: tuple[tuple[str, Claim], ...]
    """Each with its experiment's name."""
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        held = sum(claim.holds for _, claim in self.claims)
        return f"{held} of {len(self.claims)} claims hold; {self.page} says which ({self.seconds:.0f} s)"


def reproduce(
    names: Sequence[str],
    output: str | PathLike[str],
    *,
    data: str | PathLike[str] | None = None,
    captures: str | PathLike[str] | None = None,
    quick: bool = False,
    progress: Progress = SILENT,
) -> Reproduction:
    """Run the paper's experiments and write their page.

    Args:
        names: experiments, or "all". What the same code finished before is kept; figures that other code made
            stay on the page until their experiment is run again.
        output: folder of figures (NAME.json), pictures and reproduction.md.
        data: folder of probes, materials and textures (data.py); procedural stand-ins without it.
        captures: folder of captures with a ``test/`` each, for "methods"; one is made without it.
        quick: small versions of everything, to see that it runs.

    Raises:
        InputError: an unknown experiment, or the folder holds figures of other data or of the other size.
    """
    start = time.perf_counter()
    chosen = experiments_of(names)
    folder = Path(output)
    given = Data(Path(data) if data is not None else None)
    at = Path(captures) if captures is not None else None
    if at is not None and not any(at.glob("*/test/transforms.json")):
        raise InputError("holds no captures", file=at, expected="folders with a test/transforms.json each")
    setting = Setting(given, folder, quick, at, code=digest_of_the_package())
    _agree(setting)
    with progress.stage("Experiments", sum(e.minutes for e in chosen)) as task:
        for experiment in chosen:
            task.describe(experiment.title)
            file = folder / f"{experiment.name}.json"
            if not _finished(file, setting.code):
                own = replace(setting, task=task, spent=[])
                figures = experiment.run(own)
                made = {"code": setting.code, "commit": _commit(), "figures": figures}
                whole_text(file, json.dumps(made | {"seconds": sum(own.spent)}, indent=1) + "\n")
            task.advance(experiment.minutes)
    found = {e.name: f for e in EXPERIMENTS if (f := _readable(e, folder)) is not None}
    for experiment in EXPERIMENTS:
        if experiment.name in found:
            for plot in experiment.plots(found[experiment.name]["figures"]):
                svg = curve_plot(
                    plot.curves,
                    x_label=plot.x_label,
                    y_label=plot.y_label,
                    logarithmic=plot.logarithmic,
                    alone=True,
                )
                whole_text(setting.pictures / f"{plot.name}.svg", svg + "\n")
    whole_text(folder / "reproduction.md", page(EXPERIMENTS, found, setting))
    claims = tuple(
        (experiment.name, claim)
        for experiment in chosen
        for claim in experiment.claims(found[experiment.name]["figures"])
    )
    return Reproduction(str(folder), str(folder / "reproduction.md"), claims, time.perf_counter() - start)


def experiments_of(names: Sequence[str]) -> list[Experiment]:
    """Experiments by name, in the paper's order."""
    known = {e.name: e for e in EXPERIMENTS}
    wanted = {SAME_AS.get(name, name) for name in names} or {"all"}
    unknown = sorted(wanted - {*known, "all"})
    if unknown:
        raise InputError(f"no experiment {unknown[0]!r}", expected=f"all, or some of {', '.join(known)}")
    return [e for e in EXPERIMENTS if "all" in wanted or e.name in wanted]


def _agree(setting: Setting) -> None:
    """Figures in the folder must be of the same data and size as what is to come."""
    if setting.folder.exists() and not setting.folder.is_dir():
        raise InputError("is a file", file=setting.folder, expected="a folder, new or of an earlier run")
    head = {
        "quick": setting.quick,
        "data": setting.data.fingerprint(),
        "captures": _digest_of(setting.captures),
    }
    file = setting.folder / "setting.json"
    if not file.exists():
        whole_text(file, json.dumps(head, indent=1) + "\n")
        return
    there = json.loads(file.read_text(encoding="utf-8"))
    other = sorted(key for key in head if there.get(key) != head[key])
    if other:
        raise InputError(
            f"holds figures of another setting: its {' and '.join(other)} differ",
            file=setting.folder,
            expected="the same size, data and captures as now",
            hint="Choose another folder, or remove this one",
        )


def _finished(file: Path, code: str) -> bool:
    """Whether this code has made an experiment's figures."""
    return file.exists() and json.loads(file.read_text(encoding="utf-8")).get("code") == code


def _readable(experiment: Experiment, folder: Path) -> Figures | None:
    """An experiment's figures, if there are any; those of other code if its claims can be made of them."""
    file = folder / f"{experiment.name}.json"
    if not file.exists():
        return None
    found: Figures = json.loads(file.read_text(encoding="utf-8"))
    if found.get("code") != digest_of_the_package():
        try:
            experiment.claims(found["figures"]), experiment.tables(found["figures"])
        except (KeyError, IndexError, TypeError, ValueError, AttributeError):
            return None
    return found


def _commit() -> str:
    """The commit of the checkout that the package runs from, if it does."""
    here = Path(__file__)

    def git(*words: str) -> str | None:
        command = ["git", "-C", str(here.parent), *words]
        try:
            found = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)
        except (OSError, subprocess.TimeoutExpired):
            return None
        return found.stdout.strip() if found.returncode == 0 else None

    # An environment inside somebody's own repository is not that repository's.
    if git("ls-files", "--error-unmatch", here.name) is None:
        return ""
    return git("describe", "--always", "--dirty", "--exclude=*") or ""


def _digest_of(captures: Path | None) -> str:
    """SHA-256 of what the captures' files are; which is also a check that all of them can be read."""
    digest = hashlib.sha256()
    for file in sorted(captures.glob("*/test/transforms.json")) if captures is not None else []:
        for folder in (file.parent.parent, file.parent):
            digest.update(json.dumps(fingerprints(read_capture(folder))).encode())
    return digest.hexdigest()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Write the part "Hostile input" of docs/reliability.md from the results of `run.py`.

    python scripts/fuzz/page.py --count 10000

It reads the results of the code as it is: of other code, the figures would be another's.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import textwrap
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from others import FIRST  # noqa: E402
from run import HANG_S, REPOSITORY, code_digest, seeds_of  # noqa: E402
from worker import MOST_GROWTH_MB  # noqa: E402

from reliability import put  # noqa: E402

Row = dict[str, Any]
OUTCOMES = ("refused", "warned", "accepted", "crashed", "hung")
COUNTS = "| cases | error | warning | accepted | crash | hang |\n|---|---|---|---|---|---|---|\n"
HARMLESS, SEVERAL, UNKNOWN = "may be harmless", "several mutations", "not known: the process died"
KINDS = {
    "json": "transforms.json: values, structure, paths",
    "images": "EXR, .hdr, PNG, JPEG: photographs, masks, probes",
    "meshes": "OBJ, PLY, glTF, GLB",
    "folder": "files missing, empty, swapped; links, pipes, devices",
    "material": "material folder: svbrdf.json, blend.exr, mesh.obj",
    "metashape": "Metashape cameras.xml, entity bombs too",
    "colmap": "COLMAP text models",
    "files": "pairs, intrinsics, groups, exposures of `prepare`",
}
"""What a mutation is about, in words."""


def written(rows: list[Row], asked: int) -> str:
    """The part, in Markdown."""
    captures = [r for r in rows if r["seed"] < FIRST]
    others = [r for r in rows if r["seed"] >= FIRST]
    outcomes = Counter(r["outcome"] for r in rows)
    silent = [r for r in rows if r["finding"] and r["outcome"] == "accepted"]
    single = [r for r in rows if len(r["done"]) == 1]
    slowest = max(rows, key=lambda r: float(r["seconds"]))
    read_only = max((r for r in rows if not r["whole"]), key=lambda r: float(r["seconds"]))
    finished = [r for r in captures if r["whole"] and r["outcome"] in ("accepted", "warned")]
    command = ["git", "-C", str(REPOSITORY), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    partly = "" if len(captures) >= asked else f" ({asked:,} were asked for)"
    lines = [
        "## Hostile input",
        "",
        f"{len(captures):,} captures{partly} and {len(others):,} material folders, foreign projects and "
        "files of `prepare`, each spoilt by one to three seeded mutations: "
        f"**{outcomes['crashed']} crashes, {outcomes['hung']} hangs over {HANG_S:.0f} s, {len(silent)} "
        "violations that nobody reports**.",
        "",
        f"`make fuzz` (`python scripts/fuzz/run.py --count {asked}`), commit {commit}; a stopped run goes "
        "on, and `--case SEED` runs one case and says what was done. Each is read whole: JSON, photographs, "
        f"masks, probes, mesh, occluders. {len(finished)} of those that could be read were also checked, "
        "reconstructed and written with report and viewer. An outcome other than success, a warning or "
        "one of the package's own errors is a crash; so is a process that dies. Growth by more than "
        f"{MOST_GROWTH_MB} MB is a finding: the most was {max(r['growth_mb'] for r in rows)} MB. "
        f"Slowest: {float(slowest['seconds']):.1f} s (seed {slowest['seed']}), of those only read "
        f"{float(read_only['seconds']):.1f} s (seed {read_only['seed']}), on one thread of a machine that "
        "was busy otherwise.",
        "",
        "A mutation makes a violation for certain, which must be reported, or may be harmless; values and "
        "words of foreign projects and of files of `prepare` are counted as the latter, whatever they are. "
        f"Each of the {len(single):,} cases of one mutation counts in its class. Where there are several, an "
        "outcome may be due to any of them, so that these have a row of their own.",
        "",
        "| violation " + COUNTS + _table(rows, _class),
        "",
        "| mutated " + COUNTS + _table(rows, lambda row: _alone(row, lambda d: KINDS[d["kind"]])),
    ]
    if found := [r for r in rows if r["finding"]]:
        lines += ["", "Findings:", "", *(f"- seed {r['seed']} ({r['base']}): {r['finding']}" for r in found)]
    filled = [line if line.startswith(("|", "-")) else textwrap.fill(line, 118) for line in lines]
    return "\n".join([*filled, "", RULES])


def _alone(row: Row, of: Callable[[dict[str, Any]], str]) -> str:
    """What a case's only mutation is about; a process that died says nothing of its own."""
    if not row["done"]:
        return UNKNOWN
    return of(row["done"][0]) if len(row["done"]) == 1 else SEVERAL


def _class(row: Row) -> str:
    return _alone(row, lambda done: done["violation"] or HARMLESS)


def _table(rows: list[Row], of: Callable[[Row], str]) -> str:
    counts: dict[str, Counter[str]] = {}
    for row in rows:
        counts.setdefault(of(row), Counter())[row["outcome"]] += 1
    body = []
    last = [HARMLESS, SEVERAL, UNKNOWN]
    for name in sorted(counts, key=lambda n: (last.index(n) + 1 if n in last else 0, -counts[n].total())):
        c = counts[name]
        body.append(f"| {name} | {c.total():,} | " + " | ".join(f"{c[o]:,}" for o in OUTCOMES) + " |")
    return "\n".join(body)


RULES = """What holds, with tests of each in `tests/test_hostile*.py`:

- Only regular files are read, never pipes or devices. Sizes that a header declares are held against a
  limit, and against what the file can hold, before anything is allocated (`capture/guarding.py`).
- An image of up to 179 million pixels may be asked for. Uniform pixels pack so well (DWA and HTJ2K most), and
  what an EXR file is cropped by takes so little, that some 20 KB are enough: reading takes 39 bytes a pixel,
  7 GB at the limit. What the probe's convention or the frame's size refuses is not decoded.
- A path of a capture stays in its folder (mesh, occluders and probe may also lie in the one above), by
  itself and through symbolic links; links of photographs may lead one folder up where that is a capture.
  Links into folders that you trust are followed where `SWATCHWORK_LINKS_INTO` names these, separated as in
  `PATH`. So it is for what `prepare import` copies, and for a material folder's files.
- A mesh brings no other file but the buffers of a glTF, from its own folder. Nothing is fetched. Meshes that
  nodes or primitives of a glTF share count as often as they are placed.
- What a material folder says under each key has a type and a range, and it says how large its mesh is.
- JSON is limited in size and depth, and a key twice is refused. XML with a document type is refused.
- Nothing is unpickled or evaluated. Every page escapes names and forbids all requests; the viewer runs its
  own script alone, other pages none. Control characters of names reach a terminal as escapes."""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--folder", type=Path, default=REPOSITORY / "target/fuzz")
    parser.add_argument("--page", type=Path, default=REPOSITORY / "docs/reliability.md")
    given = parser.parse_args()
    results = given.folder / f"results-{code_digest()}.jsonl"
    if not results.is_file():
        sys.exit(f"{results} is not there: run scripts/fuzz/run.py with the code as it is")
    wanted = set(seeds_of(given.count))
    text = results.read_text(encoding="utf-8")
    rows = [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]
    put(given.page, "fuzz", written([r for r in rows if r["seed"] in wanted], given.count))


if __name__ == "__main__":
    main()

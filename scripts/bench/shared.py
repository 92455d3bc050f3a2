# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What the benchmarks share: measured processes, finished parts kept as JSON, slopes, and the machine."""

from __future__ import annotations

import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import log
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1] / "measure"))
import results

HERE = Path(__file__).resolve().parent
BENCH = results.ROOT / "target" / "bench"
SWATCHWORK = Path(sys.executable).with_name("swatchwork")

Figures = dict[str, Any]


@dataclass(frozen=True)
class Cost:
    """What a process and its children took."""

    wall_s: float
    cpu_s: float
    """User and system."""
    peak_mb: float
    """Resident, of the largest process, in 1e6 bytes."""


def run(command: Sequence[str], environment: dict[str, str] | None = None) -> tuple[Figures, Cost]:
    """Run a command that prints JSON, as a process of its own; its JSON and its cost.

    The process's own ``peak_mb``, where its JSON has one, counts too: a process that resets the kernel's
    high-water mark between stages hides earlier peaks from its parent.

    Raises:
        RuntimeError: it failed; with the last of what it wrote to stderr.
    """
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as said:
        start = time.perf_counter()
        process = subprocess.Popen(
            list(command), stdout=out, stderr=said, env=os.environ | (environment or {})
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        said.seek(0)
        if process.returncode:
            raise RuntimeError(
                f"{shlex.join(command)}: exit code {process.returncode}\n{said.read()[-2000:]}"
            )
        found = json.loads(out.read())
    unit = 1 if sys.platform == "darwin" else 1024
    peak = max(usage.ru_maxrss * unit / 1e6, float(found.get("peak_mb", 0)))
    return found, Cost(wall, usage.ru_utime + usage.ru_stime, peak)


def follow(command: Sequence[str]) -> None:
    """Run a command whose output goes to stderr.

    Raises:
        RuntimeError: it failed.
    """
    status = subprocess.run(list(command), stdout=sys.stderr, check=False).returncode
    if status:
        raise RuntimeError(f"{shlex.join(command)}: exit code {status}")


def reconstruct(capture: Path, material: Path, *options: str, threads: int | None = None) -> Figures:
    """`swatchwork reconstruct` from image files to material folder: its JSON, its cost, and the command."""
    command = [str(SWATCHWORK), "reconstruct", str(capture), "-o", str(material), *options, "--json", "-q"]
    if threads:
        command += ["--threads", str(threads)]
    begin_anew(material)
    commit = results.commit()
    found, cost = run(command)
    return {"command": as_typed(command), "commit": commit, "cost": asdict(cost), "summary": found}


def begin_anew(material: Path) -> None:
    """Remove what an interrupted run left: one that went on from it would take only the rest's time."""
    for folder in (material, material.with_name(f"{material.name}.partial")):
        if folder.exists():
            shutil.rmtree(folder)


def novel_light(material: Path, test: Path, renders: Path) -> Figures:
    """Relight a material from a test folder's cameras and evaluate it: nrms and the rest."""
    cameras = str(test / "transforms.json")
    run([str(SWATCHWORK), "relight", str(material), "--cameras", cameras, "-o", str(renders), "--json", "-q"])
    return score(renders, test)


def score(renders: Path, test: Path) -> Figures:
    """`swatchwork evaluate` of renders against a test folder, without the frames' own figures."""
    found, _ = run([str(SWATCHWORK), "evaluate", str(renders), str(test), "--capture", "--json", "-q"])
    return {key: value for key, value in found.items() if key != "frames"}


def as_typed(command: Sequence[str]) -> str:
    """A command line as one would type it in the checkout."""
    words = [Path(command[0]).name, *map(results.as_seen_from_root, command[1:])]
    return shlex.join(words)


def kept(file: Path, make: Callable[[], Figures]) -> Figures:
    """The figures in ``file``; made and written first where it is not there."""
    if not file.exists():
        print(f"{file.stem} ...", file=sys.stderr, flush=True)
        figures = make()
        file.parent.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(".part")
        part.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
        part.replace(file)
    return json.loads(file.read_text(encoding="utf-8"))


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of log y over log x by least squares; NaN with fewer than two points above zero."""
    points = [(log(a), log(b)) for a, b in zip(x, y, strict=True) if a > 0 and b > 0]
    mean_x, mean_y = (sum(p[i] for p in points) / max(len(points), 1) for i in (0, 1))
    spread = sum((a - mean_x) ** 2 for a, _ in points)
    return sum((a - mean_x) * (b - mean_y) for a, b in points) / spread if spread > 0 else float("nan")


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def machine() -> Figures:
    """Cores, processor and the instruction set that the core uses."""
    from swatchwork.response import instruction_sets

    model = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next(
            (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), model
        )
    except OSError:
        pass
    return {"processor": model, "cores": cores(), "instruction_set": instruction_sets()[-1]}


def write(path: Path | None, figures: Figures) -> None:
    """`results.write`, with the machine."""
    results.write(path, {"machine": machine()} | figures)

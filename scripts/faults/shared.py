# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What the faults share: a small capture, runs of the command line, what they left, rows for the page."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1] / "measure"))
import results
import same_bits
from same_bits import contents

from swatchwork.workflow import digest_of_the_package

HERE = Path(__file__).resolve().parent
SOURCES = [file for file in HERE.glob("*.py") if file.name != "page.py"]
"""Of these scripts; page.py only writes what was found."""


def code_digest(
    sources: Iterable[Path] = (*SOURCES, Path(results.__file__), Path(same_bits.__file__)),
) -> str:
    """Of the package and of these scripts: what other code found is not what this one would."""
    digest = hashlib.sha256(digest_of_the_package().encode())
    for file in sorted(sources):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:12]


FAULTS = results.ROOT / "target" / "faults" / code_digest()
"""All that is made and found, by the code that made it."""

OPTIONS = ["--resolution", "48", "--texels", "150", "--max-n", "2", "--max-N", "3"]
OTHERS = ["--resolution", "32", "--texels", "100", "--n", "1", "--N", "1"]
"""Of the older material, which the run is to replace."""

TICKS = os.sysconf("SC_CLK_TCK")

MAKE_CAPTURE = """
import sys
from swatchwork.simulate import simulate_capture
simulate_capture(sys.argv[1], object_shape="blob", rows=16, k=3, test_views=2, size=48, materials=2)
"""


@dataclass(frozen=True)
class Row:
    """One line of the page: a fault, how often, what was there afterwards, and whether that is right."""

    fault: str
    times: int
    found: str
    holds: bool
    limit: bool = False
    """Whether what was found is a known limit, which notes.md names; then it neither holds nor fails."""

    @property
    def verdict(self) -> str:
        """In a word."""
        return "holds" if self.holds else "known limit" if self.limit else "**fails**"


def rows_of(rows: list[Row], **more: Any) -> dict[str, Any]:
    """Figures of a fault, as JSON holds them."""
    return {"commit": results.COMMIT, "rows": [asdict(row) for row in rows]} | more


def child(*faults: str) -> list[str]:
    """The command line up to its arguments, with faults put in."""
    return [sys.executable, str(HERE / "child.py"), *faults, "--"]


def reconstruct(output: Path, *faults: str, options: list[str] = OPTIONS) -> list[str]:
    """The command of the run that is disturbed."""
    return [*child(*faults), "reconstruct", str(capture()), "-o", str(output), *options, "-q"]


def started(command: list[str], **how: Any) -> subprocess.Popen[str]:
    """A process whose standard error can be read."""
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, **how)


def ran(command: list[str], **how: Any) -> tuple[int, str]:
    """Exit code (negative: a signal) and standard error of a command."""
    process = started(command, **how)
    said = process.communicate()[1]
    return process.returncode, said


def capture() -> Path:
    """A blob before three cameras, made once."""
    folder = FAULTS / "capture"
    if not folder.is_dir():
        part = folder.with_name("capture.part")
        shutil.rmtree(part, ignore_errors=True)
        # In a process of its own: this one forks, which threads of the core would not outlive.
        subprocess.run([sys.executable, "-c", MAKE_CAPTURE, str(part)], check=True)
        part.rename(folder)
    return folder


def material(name: str, options: list[str]) -> Path:
    """An undisturbed run's material, made once."""
    folder = FAULTS / name
    if not folder.is_dir():
        code, said = ran(reconstruct(folder, options=options))
        assert code == 0, said
    return folder


@cache
def whole() -> Path:
    """What every run that goes on must end with."""
    return material("whole", OPTIONS)


@cache
def older() -> Path:
    """Another material, for a run to replace."""
    return material("older", OTHERS)


def cpu_s(pid: int) -> float:
    """CPU time that a process has taken, of Linux; how busy the machine is does not count."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def emptied(name: str) -> Path:
    """An empty folder to work in."""
    folder = FAULTS / "work" / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def with_older(folder: Path) -> Path:
    """``folder/out`` as a copy of the older material."""
    shutil.copytree(older(), folder / "out")
    return folder / "out"


def state_of(output: Path) -> str:
    """What an output is: ``none``, ``older``, ``new``, or else ``half``."""
    if not output.exists():
        return "none"
    found = contents(output)
    return {True: "older", False: "half"}[found == contents(older())] if found != contents(whole()) else "new"


def left_beside(output: Path) -> list[str]:
    """Names beside the output."""
    return sorted(path.name for path in output.parent.iterdir() if path.name != output.name)


def counted(words: list[str]) -> str:
    """``3 older, 2 new``."""
    return ", ".join(f"{words.count(word)} {word}" for word in sorted(set(words)))

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One case: a seed to a spoilt folder, everything that reads it, and what came of that."""

from __future__ import annotations

import shutil
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from random import Random
from typing import Any

import folders  # noqa: F401  (puts its mutations on the list)
import gltfs  # noqa: F401
import images  # noqa: F401
import json_texts  # noqa: F401
import jsons  # noqa: F401
import meshes  # noqa: F401
import others
from captures import CAPTURES, QUICK
from mutating import Done, spoil

from swatchwork import reconstruct_folder
from swatchwork.capture import read_capture, read_photograph
from swatchwork.errors import CaptureWarning, SwatchworkError
from swatchwork.light import read_environment
from swatchwork.surface import read_mesh
from swatchwork.workflow import check_capture, describe

WHOLE = 0.1
"""Share of the captures that are also reconstructed, of those that can be read: a dozen times as dear."""
NO_MEMORY = ("bad_alloc", "bad allocation", "cannot allocate", "insufficient memory", "out of memory")
"""What libraries say of it that raise something else."""
UNSURE = ("json_bits_flipped",)
"""Mutations after which another need not be seen: they may unname its file."""


def run_case(seed: int, bases: Path, scratch: Path) -> dict[str, Any]:
    """What was done, and the outcome: accepted, warned, refused, or a finding.

    ``finding`` is None, or what no input may do: another exception, or a violation that nobody reports.
    """
    rng = Random(seed)
    folder = scratch / f"case-{seed}"
    shutil.rmtree(folder, ignore_errors=True)
    kind = others.KINDS[seed % 2] if seed >= others.FIRST else rng.choice(CAPTURES)
    start = time.perf_counter()
    whole = False
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        if kind in CAPTURES:
            shutil.copytree(bases / kind, folder / "capture")
            done = spoil(folder / "capture", rng, ("json", "images", "meshes", "folder"))
            whole = rng.random() < WHOLE
            work: Callable[[], None] = lambda: _read(folder, whole)  # noqa: E731
        else:
            done, work = others.prepared(kind, bases, folder, rng)
        prepared = time.perf_counter()
        outcome, message, finding = _outcome(work)
    warned = [str(w.message) for w in said if issubclass(w.category, CaptureWarning)]
    if outcome == "accepted" and warned:
        outcome, message = "warned", warned[0]
    sure = [d for d in done if d.violation and not any(other.name in UNSURE for other in done)]
    if outcome == "accepted" and sure:
        finding = f"nobody reports: {sure[0].name} ({sure[0].what})"
    _remove(folder, scratch)
    return {
        "seed": seed,
        "base": kind,
        "done": [asdict(d) for d in done],
        "whole": whole,
        "outcome": outcome,
        "message": message[:300],
        "finding": finding,
        "seconds": round(time.perf_counter() - prepared, 3),
        "preparing": round(prepared - start, 3),
    }


def _outcome(work: Callable[[], None]) -> tuple[str, str, str | None]:
    try:
        work()
    except SwatchworkError as error:
        # A bomb that memory ran out over is no reported one, whatever a reader made of it.
        full = next((e for e in _chain(error) if _is_out_of_memory(e)), None)
        return "refused", str(error), full and f"memory ran out: {full!r}"[:400]
    except Exception as error:
        import traceback

        at = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(at.filename).name}:{at.lineno}"
        return "crashed", str(error), f"{type(error).__name__} at {where}: {error}"[:400]
    return "accepted", "", None


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _is_out_of_memory(error: BaseException) -> bool:
    return isinstance(error, MemoryError) or any(words in str(error).lower() for words in NO_MEMORY)


def _read(folder: Path, whole: bool) -> None:
    """All that reading a capture means; and all that is done with it, where ``whole``."""
    source = folder / "capture"
    capture = read_capture(source)
    for frame in capture.frames:
        read_photograph(frame)
    for light in {id(f.environment): f.environment for f in capture.frames}.values():
        assert light is not None
        read_environment(light)
    assert capture.mesh_path is not None
    for mesh in (capture.mesh_path, *capture.occluder_paths):
        read_mesh(mesh)
    describe(source)
    if whole:
        check_capture(source, folder / "check.html")
        reconstruct_folder(source, folder / "material", QUICK, viewer=True)
        for page in (folder / "check.html", folder / "material/report.html", folder / "material/viewer.html"):
            text = page.read_text(encoding="utf-8")
            assert "Content-Security-Policy" in text and "<img src=x" not in text


def _remove(folder: Path, scratch: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.rmtree(scratch / "private-capture", ignore_errors=True)


__all__ = ["Done", "run_case"]

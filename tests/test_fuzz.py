# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""That `make fuzz` finds what it looks for: crashes, hangs, dead processes, violations nobody reports."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

FUZZ = Path(__file__).resolve().parents[1] / "scripts" / "fuzz"
WORKER = """import json, os, sys, time
for line in sys.stdin:
    if line.strip() == "1": time.sleep(60)
    if line.strip() == "2": os.abort()
    print(json.dumps({"seed": int(line)}), flush=True)
"""


@pytest.fixture(scope="module")
def fuzz() -> Any:
    """The fuzzer's modules, which are scripts, by name."""
    sys.path.insert(0, str(FUZZ))
    try:
        import captures
        import case
        import run

        yield {"captures": captures, "case": case, "run": run}
    finally:
        sys.path.remove(str(FUZZ))


@pytest.fixture(scope="module")
def bases(fuzz: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz") / "bases"
    fuzz["captures"].make_bases(folder)
    return folder


@pytest.fixture
def case(fuzz: dict[str, Any]) -> ModuleType:
    module: ModuleType = fuzz["case"]
    return module


def sure(case: ModuleType, bases: Path, scratch: Path) -> dict[str, Any]:
    """The first case with a violation for certain and nothing else."""
    for seed in range(100):
        found: dict[str, Any] = case.run_case(seed, bases, scratch)
        if len(found["done"]) == 1 and found["done"][0]["violation"] and found["done"][0]["kind"] == "images":
            return found
    pytest.fail("no such seed")


def test_a_seed_is_a_case(case: ModuleType, bases: Path, tmp_path: Path) -> None:
    for seed in (3, 1_000_000_003):
        one, other = (case.run_case(seed, bases, tmp_path) for _ in range(2))
        assert one["done"] == other["done"] and one["outcome"] == other["outcome"]
        assert one["finding"] is None


def test_what_is_reported_is_no_finding(case: ModuleType, bases: Path, tmp_path: Path) -> None:
    found = sure(case, bases, tmp_path)
    assert found["outcome"] == "refused" and found["finding"] is None and found["message"]


def test_silence_is_a_finding(
    case: ModuleType, bases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(case, "_read", lambda *_: None)
    assert str(sure(case, bases, tmp_path)["finding"]).startswith("nobody reports: ")


def test_any_other_exception_is_a_finding(
    case: ModuleType, bases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(case, "read_capture", lambda _: 1 // 0)
    found = case.run_case(0, bases, tmp_path)
    assert found["outcome"] == "crashed" and "ZeroDivisionError" in found["finding"]


def test_hangs_and_dead_processes_are_findings(
    fuzz: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = fuzz["run"]
    (tmp_path / "worker.py").write_text(WORKER, encoding="utf-8")
    monkeypatch.setattr(run, "HERE", tmp_path)
    # Longer than a process takes to start, shorter than the worker sleeps.
    monkeypatch.setattr(run, "HANG_S", 8.0)
    worker = run.Worker(tmp_path, tmp_path / "scratch")
    found = [worker.run(seed) for seed in (0, 1, 2, 3)]
    worker.stop()
    assert [f.get("outcome") for f in found] == [None, "hung", "crashed", None]
    assert "killed after 8 s" in found[1]["finding"] and "died with code -6" in found[2]["finding"]


def test_a_stopped_run_goes_on(fuzz: dict[str, Any], bases: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is there is not run again; a line that was cut off counts for nothing."""
    run, served = fuzz["run"], []

    class Recorded:
        def __init__(self, *_: object) -> None: ...

        def run(self, seed: int) -> dict[str, Any]:
            served.append(seed)
            return {"seed": seed, "base": "exr", "finding": None}

        def stop(self) -> None: ...

    monkeypatch.setattr(run, "Worker", Recorded)
    results = run.run(3, bases.parent, 1)
    assert served == [0, 1_000_000_000, 1, 2]
    text = results.read_text(encoding="utf-8")
    results.write_text(text[: text.rindex("{") + 5], encoding="utf-8")
    served.clear()
    run.run(4, bases.parent, 2)
    assert sorted(served) == [2, 3]
    rows = [json.loads(line)["seed"] for line in results.read_text(encoding="utf-8").splitlines()]
    assert sorted(rows) == [0, 1, 2, 3, 1_000_000_000]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""That `make fuzz` finds what it looks for: crashes, hangs, dead processes, violations nobody reports."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from scripts_of import scripts_of
from swatchwork.errors import InputError

WORKER = """import json, os, sys, time
for line in sys.stdin:
    if line.strip() == "1": time.sleep(60)
    if line.strip() == "2": os.abort()
    print(json.dumps({"seed": int(line)}), flush=True)
"""


@pytest.fixture(scope="module")
def fuzz() -> Any:
    """The fuzzer's modules, which are scripts, by name."""
    with scripts_of("fuzz"):
        import captures
        import case
        import others
        import page
        import run

        yield {"captures": captures, "case": case, "others": others, "page": page, "run": run}


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


def test_bombs_that_a_reader_calls_damaged_are_findings(
    case: ModuleType, bases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def exhausted(_: Path) -> None:
        try:
            raise MemoryError("Unable to allocate 9 GiB")
        except MemoryError as error:
            raise InputError("cannot be read", file="a.exr") from error

    monkeypatch.setattr(case, "read_capture", exhausted)
    found = case.run_case(0, bases, tmp_path)
    assert found["outcome"] == "refused" and "memory ran out: MemoryError" in found["finding"]


VALUES: list[tuple[str, Any, Any, str | None]] = [
    ("spread/0", 0.1, True, "wrong type"),
    ("solver/N", 1, True, "wrong type"),
    ("solver/N", 1, -1, "out of range"),
    ("solver/noise", 0.1, None, None),
    ("solver/objective", 0.1, "aaaa", "wrong type"),
    ("solver/objective", 0.1, 0.2, None),
    ("solver/photographs/frames/0/misfit", 0.1, -1, None),
    ("solver/photographs", {"frames": []}, 5, "wrong type"),
    ("penalties", {"lambda0": 0.1}, {}, "wrong type"),
    ("penalties/lambda0", 0.1, float("nan"), "non-finite"),
    ("representatives/0/0/0", 0.1, 1e300, "out of range"),
    ("trust", None, {}, None),
    ("trust", None, float("inf"), "non-finite"),
    ("inputs", {"a": "b"}, {}, None),
]


def test_values_of_a_material_have_classes(fuzz: dict[str, Any]) -> None:
    for path, old, new, expected in VALUES:
        assert fuzz["others"].of_a_value(path.split("/"), old, new) == expected, (path, new)


def test_files_of_prepare_are_read_as_they_are(fuzz: dict[str, Any], bases: Path, tmp_path: Path) -> None:
    """Else each case would be refused whatever was done to its file."""
    for file in sorted((bases / "foreign/files").iterdir()):
        (tmp_path / file.name).write_bytes(file.read_bytes())
        fuzz["others"]._read(tmp_path / file.name)


def test_outcomes_of_several_mutations_are_nobodys(fuzz: dict[str, Any]) -> None:
    """One of two may hide that nobody reports the other."""
    done = [{"violation": v, "kind": "json"} for v in ("twice", "missing", None)]
    rows = [{"done": [d], "outcome": "refused"} for d in done]
    rows += [{"done": done[:2], "outcome": "refused"}, {"done": [], "outcome": "crashed"}]
    page = fuzz["page"]
    names = [line.split("|")[1].strip() for line in page._table(rows, page._class).splitlines()]
    assert names[:2] == ["twice", "missing"] and names[2:] == [page.HARMLESS, page.SEVERAL, page.UNKNOWN]


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

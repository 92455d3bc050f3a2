# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Faults at each step of a write: old, new or put back, never half.

`make faults` has them on whole runs of the command line.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from scripts_of import scripts_of
from swatchwork.whole import (
    folders,
    set_aside,
    whole_folder,
    whole_text,
)
from swatchwork.workflow.together import files_together

ROOT = Path(__file__).resolve().parents[1]
with scripts_of("faults"):
    from stepping import fresh_copy, stepped, undisturbed

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="faults are made in forked processes"),
    # What runs in the forked process touches files alone, none of the core's threads.
    pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning"),
]


def one(work: Path, text: str) -> Callable[[], int]:
    def action() -> int:
        whole_text(work / "file.txt", text)
        return 0

    return action


def folder(work: Path, text: str) -> Callable[[], int]:
    def action() -> int:
        with whole_folder(work / "out", lambda path: (path / "mark").exists()) as made:
            for name in ("mark", "a", "b"):
                (made / name).write_text(text)
        return 0

    return action


def in_two_steps(work: Path, text: str) -> Callable[[], int]:
    def action() -> int:
        folders.exchange = lambda *_: False  # type: ignore[assignment]
        return folder(work, text)()

    return action


@pytest.mark.parametrize("make", [one, folder])
def test_killed_at_any_step_it_is_the_older_or_the_new(make: Any, tmp_path: Path) -> None:
    work, kept = tmp_path / "work", tmp_path / "kept"
    old = undisturbed(make(work, "old"), lambda: fresh_copy(None, work), work)
    fresh_copy(work, kept)
    new = undisturbed(make(work, "new"), lambda: fresh_copy(kept, work), work)
    seen = []
    for ended in stepped(make(work, "new"), lambda: fresh_copy(kept, work), work, "kill"):
        visible = {name: data for name, data in ended.files.items() if ".unfinished" not in name}
        assert visible in (old.files, new.files), ended.step
        seen.append(visible)
    assert seen[0] == old.files and len(seen) > 2
    assert new.code == 0 and new.files != old.files and not [n for n in new.files if ".unfinished" in n]


def test_without_an_exchange_the_older_folder_is_put_back(tmp_path: Path) -> None:
    work, kept = tmp_path / "work", tmp_path / "kept"
    old = undisturbed(folder(work, "old"), lambda: fresh_copy(None, work), work)
    fresh_copy(work, kept)
    aside = []
    for ended in stepped(in_two_steps(work, "new"), lambda: fresh_copy(kept, work), work, "kill"):
        visible = {name for name in ended.files if not name.startswith(".")}
        if not visible:
            aside.append(ended)
    assert aside, "the moment between the renames is one of the steps"
    fresh_copy(None, work)
    for name, data in aside[0].files.items():
        (work / name).parent.mkdir(exist_ok=True)
        (work / name).write_bytes(data)
    assert set_aside(work / "out") is not None
    with pytest.raises(ZeroDivisionError), whole_folder(work / "out", lambda path: True):
        raise ZeroDivisionError
    assert {
        p.relative_to(work).as_posix(): p.read_bytes() for p in work.rglob("*") if p.is_file()
    } == old.files


@pytest.mark.parametrize("make", [one, folder])
@pytest.mark.parametrize("fault", ["full", "interrupt"])
def test_full_disk_and_ctrl_c_at_any_step_leave_nothing(make: Any, fault: Any, tmp_path: Path) -> None:
    work, kept = tmp_path / "work", tmp_path / "kept"
    old = undisturbed(make(work, "old"), lambda: fresh_copy(None, work), work)
    fresh_copy(work, kept)
    new = undisturbed(make(work, "new"), lambda: fresh_copy(kept, work), work)
    steps = 0
    for ended in stepped(make(work, "new"), lambda: fresh_copy(kept, work), work, fault):
        assert ended.files in (old.files, new.files), (ended.step, ended.said)
        if fault == "full":
            assert "cannot be written (No space left on device)" in ended.said
            assert ended.files == old.files
        steps += 1
    assert steps > 1


def test_files_together_have_their_last_only_with_all_others(tmp_path: Path) -> None:
    work, kept = tmp_path / "work", tmp_path / "kept"

    def writing(text: str) -> Callable[[], int]:
        def action() -> int:
            with files_together(work / "out", "last") as made:
                for name in ("a", "b", "last"):
                    (made / name).write_text(text)
            return 0

        return action

    undisturbed(writing("old"), lambda: fresh_copy(None, work), work)
    fresh_copy(work, kept)
    for ended in stepped(writing("new"), lambda: fresh_copy(kept, work), work, "kill"):
        found = {Path(n).name: d for n, d in ended.files.items() if ".unfinished" not in n}
        if "last" in found:
            assert set(found.values()) in ({b"old"}, {b"new"}), ended.step

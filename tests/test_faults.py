# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Faults: killed, stopped, full disks, other runs, jumping clocks. Old, new or resumable, never half.

Small ones, each at a named step; `make faults` has them on whole runs of the command line.
"""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork import workflow
from swatchwork.cli import main
from swatchwork.cli.memory import is_out_of_memory
from swatchwork.errors import CaptureWarning, InputError, OutputError
from swatchwork.keeping import Array
from swatchwork.whole import (
    exchange,
    folders,
    held,
    set_aside,
    siblings,
    whole_file,
    whole_folder,
    whole_text,
)
from swatchwork.workflow.checkpoints import checkpoints
from swatchwork.workflow.together import files_together

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "scripts" / "faults"))
sys.path.append(str(ROOT / "scripts"))
from stepping import fresh_copy, stepped, undisturbed  # noqa: E402

import reliability  # noqa: E402

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


def test_two_names_are_exchanged(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    (tmp_path / "a" / "1").touch()
    if not exchange(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this file system exchanges no names")
    assert (tmp_path / "b" / "1").exists() and not list((tmp_path / "a").iterdir())
    with pytest.raises(FileNotFoundError):
        exchange(tmp_path / "a", tmp_path / "none")


def test_what_dead_processes_left_goes_and_what_live_ones_make_stays(tmp_path: Path) -> None:
    (tmp_path / ".out.0123abcd.unfinished").mkdir()
    (tmp_path / ".out.settings").touch()
    with whole_folder(tmp_path / "out", lambda _: True) as first:
        (first / "a").touch()
        assert not (tmp_path / ".out.0123abcd.unfinished").exists()
        siblings.sweep(tmp_path / "out")
        assert (first / "a").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == [".out.settings", "out"]


def test_two_into_one_folder_end_in_one_whole(tmp_path: Path) -> None:
    """The second takes its place while the first is at work, where there was nothing before."""
    with whole_folder(tmp_path / "out", lambda _: True) as first:
        (first / "a").write_text("first")
        (first / "b").write_text("first")
        with whole_folder(tmp_path / "out", lambda _: True) as second:
            (second / "a").write_text("second")
        assert [p.name for p in (tmp_path / "out").iterdir()] == ["a"]
    assert {p.read_text() for p in (tmp_path / "out").iterdir()} == {"first"}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_folder_is_held_by_one(tmp_path: Path) -> None:
    with held(tmp_path / "renders"), pytest.raises(InputError, match="another run is writing here"):  # noqa: SIM117
        with held(tmp_path / "renders"):
            pass
    with held(tmp_path / "renders"):
        pass


def test_a_link_stays_and_what_it_points_at_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "target").mkdir()
    (tmp_path / "out").symlink_to("target")
    (tmp_path / "file").symlink_to("text")
    with whole_folder(tmp_path / "out", lambda _: True) as made:
        (made / "a").touch()
    whole_text(tmp_path / "file", "new")
    assert (tmp_path / "out").is_symlink() and (tmp_path / "target" / "a").exists()
    assert (tmp_path / "file").is_symlink() and (tmp_path / "text").read_text() == "new"


def test_a_folder_in_a_files_place(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"cannot be written \(it is a folder\)"), whole_file(tmp_path):
        pass


NUMBERS = np.arange(1000, dtype=np.float64)


def parts(output: Path, *names: str, make: Callable[[], dict[str, Array]] | None = None) -> list[str]:
    """What a run that is interrupted after these parts found there."""
    with pytest.raises(KeyboardInterrupt), checkpoints(output, {}) as keeper:
        for name in names:
            kept = keeper.kept(name, make or (lambda: {"numbers": NUMBERS}))
            np.testing.assert_array_equal(kept.rows("numbers"), NUMBERS)
        raise KeyboardInterrupt
    return keeper.resumed


def flip(file: Path) -> None:
    data = bytearray(file.read_bytes())
    data[-5] ^= 16
    file.write_bytes(data)


@pytest.mark.parametrize(
    "damage",
    [
        lambda part: flip(part / "numbers.npy"),
        lambda part: os.truncate(part / "numbers.npy", 4000),
        lambda part: (part / "numbers.npy").unlink(),
        lambda part: (part / "digests.json").write_text("{"),
        lambda part: (part / "digests.json").unlink(),
    ],
    ids=["bit", "short", "gone", "digests", "no-digests"],
)
def test_a_damaged_part_is_made_anew(damage: Callable[[Path], None], tmp_path: Path) -> None:
    parts(tmp_path / "out", "one", "two")
    damage(tmp_path / "out.partial" / "one")
    with pytest.warns(CaptureWarning, match=r"one: .*damaged since it was finished, and made anew"):
        assert parts(tmp_path / "out", "one", "two") == ["two"]
    assert parts(tmp_path / "out", "one", "two") == ["one", "two"]


def test_clocks_do_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts(tmp_path / "out", "one", "two")
    for path, moment in zip((tmp_path / "out.partial").rglob("*"), (0, 9e9, 1e9) * 9, strict=False):
        os.utime(path, (moment, moment))
    monkeypatch.setattr(time, "time", lambda: -1e9)
    assert parts(tmp_path / "out", "one", "two") == ["one", "two"]


def test_no_wall_clock_decides_anything() -> None:
    """Only what a person reads may ask for it: since when the lock is held."""
    asked = [
        f"{file.name}: {line.strip()}"
        for file in (ROOT / "python" / "swatchwork").rglob("*.py")
        for line in file.read_text(encoding="utf-8").splitlines()
        if any(word in line for word in ("time.time", "datetime", "mtime", "ctime", "strftime"))
    ]
    assert asked == ['run_lock.py: since = time.strftime("%Y-%m-%d %H:%M:%S %z")']


def test_the_second_run_is_told_whose_the_lock_is(tmp_path: Path) -> None:
    with (
        checkpoints(tmp_path / "out", {}),
        pytest.raises(
            InputError, match=rf"process {os.getpid()} on .*, since \d{{4}}-.*Wait for it, stop it"
        ),
        checkpoints(tmp_path / "out", {}),
    ):
        pass


def test_the_lock_of_a_dead_run_is_taken_over(tmp_path: Path) -> None:
    parts(tmp_path / "out", "one")
    lock = tmp_path / "out.partial" / "lock"
    lock.write_text(json.dumps({"pid": 1, "host": "here", "since": "long ago"}))
    assert parts(tmp_path / "out", "one") == ["one"]


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    def refused(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", refused)
    (tmp_path / ".out.0123abcd.unfinished").mkdir()
    with pytest.warns(CaptureWarning, match="keeps no locks"):
        parts(tmp_path / "out", "one")
    with whole_folder(tmp_path / "out", lambda _: True) as made:
        (made / "a").touch()
    assert (tmp_path / "out" / "a").exists()
    assert (tmp_path / ".out.0123abcd.unfinished").exists(), "nobody knows whether its process lives"


CHILD = """
import os, signal, sys
from swatchwork.cli import main
def raised(*_):
    {what}
import swatchwork.workflow
swatchwork.workflow.describe = raised
sys.exit(main(["info"]))
"""


def ended(what: str) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-c", CHILD.format(what=what)], capture_output=True, text=True, check=False
    )
    assert done.stdout == ""
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("what", "code", "begins"),
    [
        ("os.kill(os.getpid(), signal.SIGINT)", 130, "interrupted; nothing was half-written, and the same"),
        ("os.kill(os.getpid(), signal.SIGTERM)", 143, "terminated; nothing was half-written, and the same"),
        (
            "\n    try: os.kill(os.getpid(), signal.SIGINT)"
            "\n    finally: os.kill(os.getpid(), signal.SIGINT)",
            130,
            "stopped at once; nothing was half-written, and the same",
        ),
        ("raise MemoryError", 2, "error: out of memory; what was there before is intact."),
    ],
    ids=["ctrl-c", "sigterm", "twice", "memory"],
)
def test_how_a_command_is_stopped(what: str, code: int, begins: str) -> None:
    found, said = ended(what)
    assert found == code, said
    assert said.startswith(begins) and "Traceback" not in said
    assert len(" ".join(said.split()).split("error: ")) <= 2


def test_handlers_are_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    seen: list[Any] = []

    def describe(_: Path | None) -> None:
        seen.extend(signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM))
        raise InputError("enough")

    monkeypatch.setattr(workflow, "describe", describe)
    assert main(["info"]) == 2
    assert len(seen) == 2 and not set(seen) & set(before)
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    # Outside the main thread, where Python sets no handlers, it runs as well.
    codes: list[int] = []
    thread = threading.Thread(target=lambda: codes.append(main(["--version"])))
    thread.start()
    thread.join()
    assert codes == [0]


def test_names_of_too_little_memory() -> None:
    chained = ValueError("no")
    chained.__cause__ = MemoryError()
    assert is_out_of_memory(chained)
    assert is_out_of_memory(OSError(errno.ENOMEM, "Cannot allocate memory"))
    assert is_out_of_memory(RuntimeError("can't start new thread"))
    assert not is_out_of_memory(ValueError("no"))


def test_each_part_of_the_page_is_its_own(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    reliability.put(page, "faults", "first words")
    reliability.put(page, "hostile", "two")
    reliability.put(page, "faults", "three")
    text = page.read_text()
    assert text.startswith("# Reliability") and "first" not in text
    assert text.index("three") < text.index("<!-- /faults -->") < text.index("<!-- hostile -->\ntwo\n")
    page.write_text("<!-- faults -->")
    with pytest.raises(ValueError, match="without"):
        reliability.put(page, "faults", "four")

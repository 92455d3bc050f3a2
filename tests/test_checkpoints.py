# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Parts of an interrupted run: kept whole or not at all, gone on from only by the same run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from swatchwork.errors import InputError, OutputError
from swatchwork.keeping import Array
from swatchwork.simulate import simulate_capture
from swatchwork.workflow.checkpoints import checkpoints

NUMBERS = np.arange(12, dtype=np.float32).reshape(6, 2)


def numbers() -> dict[str, Array]:
    return {"numbers": NUMBERS}


def never() -> dict[str, Array]:
    raise AssertionError("this part was finished before")


def interrupted(output: Path, key: dict[str, str]) -> None:
    with pytest.raises(KeyboardInterrupt), checkpoints(output, key) as keeper:
        keeper.kept("one", numbers)
        raise KeyboardInterrupt


def test_a_finished_part_is_not_made_again(tmp_path: Path) -> None:
    interrupted(tmp_path / "out", {"input": "a"})
    with checkpoints(tmp_path / "out", {"input": "a"}) as keeper:
        kept = keeper.kept("one", never)
        assert keeper.resumed == ["one"]
        np.testing.assert_array_equal(kept.rows("numbers"), NUMBERS)
        np.testing.assert_array_equal(kept.rows("numbers", 2, 4), NUMBERS[2:4])
        np.testing.assert_array_equal(kept.rows("numbers", 3), NUMBERS[3:])
    assert not list(tmp_path.iterdir()), "nothing is left once the run has ended well"


def test_another_run_begins_anew(tmp_path: Path) -> None:
    interrupted(tmp_path / "out", {"input": "a"})
    with checkpoints(tmp_path / "out", {"input": "b"}) as keeper:
        keeper.kept("one", numbers)
        assert not keeper.resumed


def test_a_half_written_part_does_not_count(tmp_path: Path) -> None:
    key = {"input": "a"}
    interrupted(tmp_path / "out", key)
    part = tmp_path / "out.partial" / "one"
    part.rename(part.with_name("one.fresh"))
    with checkpoints(tmp_path / "out", key) as keeper:
        keeper.kept("one", numbers)
        assert not keeper.resumed


@pytest.mark.parametrize("left", [("lock", "key.json", "half"), ("lock", "half"), ("lock",)])
def test_a_run_killed_while_it_cleans_up_is_cleared_away(tmp_path: Path, left: tuple[str, ...]) -> None:
    """The key goes first and the lock last, so that no state on the way is gone on from or refused."""
    partial = tmp_path / "out.partial"
    (partial / "one").mkdir(parents=True)
    for name in left:
        (partial / name).write_text("{}" if name == "key.json" else "")
    with checkpoints(tmp_path / "out", {"input": "a"}) as keeper:
        keeper.kept("one", numbers)
        assert not keeper.resumed
    assert not list(tmp_path.iterdir())


def test_a_part_that_fails_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(AssertionError), checkpoints(tmp_path / "out", {}) as keeper:
        keeper.kept("one", never)
    assert not list(tmp_path.iterdir())


def test_two_runs_into_one_folder_are_refused(tmp_path: Path) -> None:
    with (
        checkpoints(tmp_path / "out", {}),
        pytest.raises(InputError, match=r"out\.partial: another run"),
        checkpoints(tmp_path / "out", {}),
    ):
        pass


def test_a_full_disk_keeps_what_was_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match=r"out\.partial: cannot be written \(No space left on device\)"):  # noqa: SIM117
        with checkpoints(tmp_path / "out", {}) as keeper:
            keeper.kept("one", numbers)
            monkeypatch.setattr(np, "save", full)
            keeper.kept("two", numbers)
    monkeypatch.undo()
    with checkpoints(tmp_path / "out", {}) as keeper:
        keeper.kept("one", never)


def reconstruct(capture: Path, output: Path) -> subprocess.Popen[bytes]:
    run = "import sys; from swatchwork.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", run, "reconstruct", str(capture)]
    command += ["-o", str(output), "--resolution", "64", "--texels", "200", "--max-n", "2", "--max-N", "3"]
    return subprocess.Popen([*command, "-q"])


def contents(folder: Path) -> dict[str, bytes]:
    """All but the report, which tells the time it took."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != "report.html"]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.skipif(not hasattr(os, "kill") or sys.platform == "win32", reason="needs SIGKILL")
def test_a_killed_run_goes_on_and_ends_with_the_same_bits(tmp_path: Path) -> None:
    capture = tmp_path / "capture"
    simulate_capture(capture, object_shape="blob", rows=24, k=3, test_views=1, size=64, materials=2)
    start = time.perf_counter()
    assert reconstruct(capture, tmp_path / "whole").wait() == 0
    whole = time.perf_counter() - start
    output = tmp_path / "killed"
    partial = tmp_path / "killed.partial"
    for part in ("sky", "observe-0001", "solve"):
        run = reconstruct(capture, output)
        # Killed as soon as a certain part is there: however slow the machine, there is something to resume.
        while not (partial / part).is_dir() and run.poll() is None:
            assert time.perf_counter() - start < 60 + 30 * whole
            time.sleep(0.002)
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
        assert not output.exists()
        assert (partial / part).is_dir()
    assert reconstruct(capture, output).wait() == 0
    assert contents(output) == contents(tmp_path / "whole")
    assert not partial.exists()

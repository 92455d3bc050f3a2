# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Finished parts: damaged ones are made anew, clocks do not count, errors do not throw them away."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from swatchwork.errors import CaptureWarning, InputError
from swatchwork.keeping import Array
from swatchwork.workflow.checkpoints import checkpoints

ROOT = Path(__file__).resolve().parents[1]

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


def test_wrong_input_keeps_what_was_finished(tmp_path: Path) -> None:
    """A drive that is away for a moment, a file put where OUT is to be: the input is the same afterwards."""
    with pytest.raises(InputError), checkpoints(tmp_path / "out", {"input": "a"}) as keeper:
        keeper.kept("one", lambda: {"numbers": NUMBERS})
        raise InputError("the photograph does not exist")
    with pytest.raises(KeyboardInterrupt), checkpoints(tmp_path / "out", {"input": "a"}) as keeper:
        keeper.kept("one", lambda: pytest.fail("it was finished"))
        raise KeyboardInterrupt
    assert keeper.resumed == ["one"]


def test_input_that_is_wrong_for_good_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError), checkpoints(tmp_path / "out", {}, lambda: True) as keeper:
        keeper.kept("one", lambda: {"numbers": NUMBERS})
        raise InputError("the photograph is truncated")
    assert not list(tmp_path.iterdir())


def test_wrong_input_before_the_first_part_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError), checkpoints(tmp_path / "out", {}):
        raise InputError("no")
    assert not list(tmp_path.iterdir())

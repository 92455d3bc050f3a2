# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One run an output: whose the lock is, locks of dead runs, file systems without locks."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.errors import CaptureWarning, InputError
from swatchwork.whole import held, whole_folder, whole_text
from swatchwork.workflow.checkpoints import checkpoints

fcntl = pytest.importorskip("fcntl", reason="there are no such locks")


def interrupted(output: Path) -> list[str]:
    """What a run that is interrupted after a part found there."""
    with pytest.raises(KeyboardInterrupt), checkpoints(output, {}) as keeper:
        keeper.kept("one", lambda: {"numbers": np.arange(3)})
        raise KeyboardInterrupt
    return keeper.resumed


def test_a_folder_is_held_by_one(tmp_path: Path) -> None:
    with held(tmp_path / "renders"), pytest.raises(InputError, match="another run is writing here"):  # noqa: SIM117
        with held(tmp_path / "renders"):
            pass
    with held(tmp_path / "renders"):
        pass


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
    interrupted(tmp_path / "out")
    lock = tmp_path / "out.partial" / "lock"
    lock.write_text(json.dumps({"pid": 1, "host": "here", "since": "long ago"}))
    assert interrupted(tmp_path / "out") == ["one"]


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    refuses(monkeypatch, number)
    (tmp_path / ".out.0123abcd.unfinished").mkdir()
    with pytest.warns(CaptureWarning, match="keeps no locks"):
        interrupted(tmp_path / "out")
    with whole_folder(tmp_path / "out", lambda _: True) as made:
        (made / "a").touch()
    assert (tmp_path / "out" / "a").exists()
    assert (tmp_path / ".out.0123abcd.unfinished").exists(), "nobody knows whether its process lives"


def refuses(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    def refused(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", refused)


def test_a_folder_that_cannot_be_locked_is_said_to_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on NFS, which locks nothing that is open for reading alone."""
    refuses(monkeypatch, errno.EBADF)
    with pytest.warns(CaptureWarning, match="renders: its file system locks no folders, so that two runs"):  # noqa: SIM117
        with held(tmp_path / "renders"):
            pass


def test_files_are_locked_as_nfs_has_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where what is open for reading alone is not locked, files of dead processes still go."""
    real = fcntl.flock

    def as_nfs(handle: Any, how: int) -> None:
        number = handle if isinstance(handle, int) else handle.fileno()
        if fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        real(handle, how)

    monkeypatch.setattr("fcntl.flock", as_nfs)
    (tmp_path / ".text.0123abcd.unfinished").touch()
    whole_text(tmp_path / "text", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["text"]


def test_a_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("swatchwork.whole.siblings", "swatchwork.workflow.run_lock"):
        monkeypatch.setattr(f"{module}.fcntl", None)
    with pytest.warns(CaptureWarning, match="this system keeps no locks"), held(tmp_path / "renders"):
        pass
    with pytest.warns(CaptureWarning, match="this system keeps no locks"), checkpoints(tmp_path / "out", {}):
        pass

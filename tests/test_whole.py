# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Files and folders that appear whole: exchanges, neighbours of dead processes, what is in the way."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from swatchwork.errors import InputError, OutputError
from swatchwork.whole import exchange, folders, siblings, whole_file, whole_folder, whole_text


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


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="makes a pipe")
def test_a_pipe_or_device_is_not_replaced(tmp_path: Path) -> None:
    """Root may rename over /dev/null, and every program that writes there fills the disk."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError, match="a device, a pipe or a socket, and no file"):
        whole_text(tmp_path / "pipe", "new")
    assert (tmp_path / "pipe").is_fifo()
    if os.geteuid() != 0 or not Path(os.devnull).is_char_device():
        return  # No harm where it would go wrong: the rename is refused.
    with pytest.raises(OutputError, match="and no file"):
        whole_text(os.devnull, "new")
    assert Path(os.devnull).is_char_device()


def is_ours(folder: Path) -> bool:
    return (folder / "mark").exists()


def set_aside_in(folder: Path) -> Path:
    """An older folder ``out`` whose process was killed between two renames."""
    aside = folder / ".out.0123abcd.replaced"
    aside.mkdir()
    (aside / "mark").write_text("dear")
    return aside


def test_an_empty_folder_does_not_cost_the_older_one(tmp_path: Path) -> None:
    set_aside_in(tmp_path)
    (tmp_path / "out").mkdir()
    with pytest.raises(ZeroDivisionError), whole_folder(tmp_path / "out", is_ours):
        raise ZeroDivisionError
    assert (tmp_path / "out" / "mark").read_text() == "dear"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_folder_of_another_kind_does_not_cost_the_older_one(tmp_path: Path) -> None:
    aside = set_aside_in(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "notes").touch()
    with pytest.raises(InputError, match="exists and is not"), whole_folder(tmp_path / "out", is_ours):
        pass
    assert (aside / "mark").read_text() == "dear"


def test_what_stepped_aside_goes_once_another_is_there(tmp_path: Path) -> None:
    set_aside_in(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mark").write_text("newer")
    with pytest.raises(ZeroDivisionError), whole_folder(tmp_path / "out", is_ours):
        raise ZeroDivisionError
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out" / "mark").read_text() == "newer"


@pytest.mark.parametrize("meanwhile", ["put back", "another"])
def test_another_run_between_the_two_renames(
    meanwhile: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It leaves what a live one set aside; and what has the place by then is replaced, not an error."""
    monkeypatch.setattr(folders, "exchange", lambda *_: False)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mark").write_text("older")
    rename = Path.rename
    seen: list[bool] = []

    def renamed(self: Path, target: Path) -> Path:
        done = rename(self, target)
        if str(target).endswith(".replaced") and not seen:
            folders.put_back(tmp_path / "out", is_ours)
            seen.append((tmp_path / "out").exists())
            if meanwhile == "put back":  # As where there are no locks.
                rename(Path(target), tmp_path / "out")
            else:
                (tmp_path / "out").mkdir()
                (tmp_path / "out" / "mark").write_text("another")
        return done

    monkeypatch.setattr(Path, "rename", renamed)
    with whole_folder(tmp_path / "out", is_ours) as made:
        (made / "mark").write_text("new")
    assert seen == [False], "what a live process set aside is left alone"
    assert (tmp_path / "out" / "mark").read_text() == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]

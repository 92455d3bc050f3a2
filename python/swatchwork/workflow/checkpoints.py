# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``OUT.partial``: the finished parts of a run, so that an interrupted one goes on where it was.

Each part is a folder of NumPy arrays that appears whole or not at all, even when the power fails. They
belong to one set of inputs, options and kernels, named in ``key.json``: a run with another key clears
them away.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, OutputError
from ..keeping import Array, Kept

try:
    import fcntl
except ImportError:  # Windows: two runs into one folder are not told apart there.
    fcntl = None  # type: ignore[assignment]

KEY = "key.json"
LOCK = "lock"


@dataclass(frozen=True)
class _OnDisk:
    folder: Path

    def rows(self, name: str, first: int = 0, last: int | None = None) -> Array:
        """See ``Kept``; only the rows asked for are read."""
        file = self.folder / f"{name}.npy"
        if first == 0 and last is None:
            return np.asarray(np.load(file, allow_pickle=False))
        return np.array(np.load(file, mmap_mode="r", allow_pickle=False)[first:last])


@dataclass
class Checkpoints:
    """A ``Keeper`` whose parts are folders in ``folder``."""

    folder: Path
    resumed: list[str] = field(default_factory=list)
    """Parts that an earlier run had finished."""

    def kept(self, name: str, make: Callable[[], Mapping[str, Array]]) -> Kept:
        """See ``Keeper``.

        Raises:
            OutputError: the part cannot be written; those before it stay.
        """
        part = self.folder / name
        if part.is_dir():
            self.resumed.append(name)
            return _OnDisk(part)
        arrays = make()
        fresh = self.folder / f"{name}.fresh"
        try:
            shutil.rmtree(fresh, ignore_errors=True)
            fresh.mkdir()
            for key, array in arrays.items():
                with (fresh / f"{key}.npy").open("wb") as stream:
                    np.save(stream, array)
                    stream.flush()
                    os.fsync(stream.fileno())
            _sync(fresh)
            fresh.rename(part)
            _sync(self.folder)
        except OSError as error:
            shutil.rmtree(fresh, ignore_errors=True)
            raise OutputError(
                f"{self.folder}: cannot be written ({error.strerror or error}); parts that were finished are "
                "kept there, and the same command goes on from them"
            ) from error
        return _OnDisk(part)


@contextmanager
def checkpoints(output: str | PathLike[str], key: Mapping[str, Any]) -> Iterator[Checkpoints]:
    """The finished parts of the run into ``output`` that ``key`` describes; removed when the block ends well.

    Raises:
        InputError: another run is writing there.
        OutputError: the place cannot be written.
    """
    output = Path(output).absolute()
    folder = output.with_name(f"{output.name}.partial")
    wanted = json.dumps(key, sort_keys=True, indent=1)
    with _locked(folder):
        if _read(folder / KEY) != wanted:
            try:
                _clear(folder)
                _write(folder / KEY, wanted)
            except OSError as error:
                raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from error
        try:
            yield Checkpoints(folder)
        except InputError:
            # Input put right is other input: nothing could go on from here.
            _remove(folder)
            raise
        except BaseException:
            if not any(path.is_dir() for path in folder.iterdir()):
                _remove(folder)
            raise
        _remove(folder)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold ``folder``, which is made if need be, against other runs."""
    try:
        if (
            folder.is_dir()
            and (names := {path.name for path in folder.iterdir()})
            and not names & {KEY, LOCK}
        ):
            raise InputError(
                f"there is a folder of that name, with {min(names)} in it",
                file=folder,
                expected="nothing, or what an interrupted run left there",
                hint="Move it away, or choose another output folder.",
            )
        while True:
            folder.mkdir(parents=True, exist_ok=True)
            lock = (folder / LOCK).open("w")
            if fcntl is None:
                break
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # A run that ended in between has removed the file that this one opened.
            with suppress(FileNotFoundError):
                if os.fstat(lock.fileno()).st_ino == (folder / LOCK).stat().st_ino:
                    break
            lock.close()
    except BlockingIOError:
        raise InputError(
            "another run is at work here",
            file=folder,
            expected="one run at a time for an output",
            hint="Wait for it, or choose another output folder.",
        ) from None
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from error
    with lock:
        yield


def _read(file: Path) -> str | None:
    with suppress(OSError, UnicodeDecodeError):
        return file.read_text(encoding="utf-8")
    return None


def _write(file: Path, text: str) -> None:
    fresh = file.with_suffix(".fresh")
    with fresh.open("w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    fresh.replace(file)
    _sync(file.parent)


def _remove(folder: Path) -> None:
    """Remove all of it, as far as that goes; killed on the way, it leaves what a later run clears away."""
    with suppress(OSError):
        _clear(folder)
        (folder / LOCK).unlink()
        folder.rmdir()


def _clear(folder: Path) -> None:
    # The key goes first: without it, what is left counts for nothing.
    (folder / KEY).unlink(missing_ok=True)
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name != LOCK:
            path.unlink()


def _sync(folder: Path) -> None:
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``OUT.partial``: the finished parts of a run, so that an interrupted one goes on where it was.

Each part is a folder of NumPy arrays that appears whole or not at all, even when the power fails; one that
was damaged since is noticed by its digests and made anew. They belong to one set of inputs, options and
kernels, named in ``key.json``: a run with another key clears them away.
"""

from __future__ import annotations

import json
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CaptureWarning, InputError, OutputError
from ..keeping import Array, Kept
from ..whole import place_of, sync, whole_text
from .digests import damage_of, write_part
from .run_lock import LOCK, locked

KEY = "key.json"


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
        part, fresh = self.folder / name, self.folder / f"{name}.fresh"
        if part.is_dir():
            damage = damage_of(part)
            if damage is None:
                self.resumed.append(name)
                return _OnDisk(part)
            warnings.warn(
                CaptureWarning(f"{part}: {damage}: damaged since it was finished, and made anew"),
                stacklevel=2,
            )
        arrays = make()
        try:
            for old in (fresh, part):
                if old.exists():
                    shutil.rmtree(old)
            write_part(fresh, arrays)
            fresh.rename(part)
            sync(self.folder)
        except OSError as error:
            shutil.rmtree(fresh, ignore_errors=True)
            raise OutputError(
                f"{self.folder}: cannot be written ({error.strerror or error}); parts that were finished are "
                "kept there, and the same command goes on from them"
            ) from error
        return _OnDisk(part)


@contextmanager
def checkpoints(
    output: str | PathLike[str], key: Mapping[str, Any], settled: Callable[[], bool] = lambda: False
) -> Iterator[Checkpoints]:
    """The finished parts of the run into ``output`` that ``key`` describes; removed when the block ends well.

    Args:
        settled: asked after an InputError: whether the input still is what ``key`` says, so that the same run
            would fail again, and its parts are removed too.

    Raises:
        InputError: another run is writing there.
        OutputError: the place cannot be written.
    """
    output = place_of(output)
    folder = output.with_name(f"{output.name}.partial")
    wanted = json.dumps(key, sort_keys=True, indent=1)
    _refuse_others(folder)
    with locked(folder):
        if _read(folder / KEY) != wanted:
            try:
                _clear(folder)
                whole_text(folder / KEY, wanted)
            except OSError as error:
                raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from error
            except OutputError:
                _remove(folder)
                raise
        try:
            yield Checkpoints(folder)
        except BaseException as error:
            # Input put right is other input: nothing could go on from here. A drive that comes back is not.
            useless = isinstance(error, InputError) and settled()
            if useless or not any(path.is_dir() for path in folder.iterdir()):
                _remove(folder)
            raise
        _remove(folder)


def _refuse_others(folder: Path) -> None:
    """Raise InputError where a folder of that name is not what a run leaves; it would be cleared away."""
    names: set[str] = set()
    with suppress(OSError):  # It may be removed meanwhile, by the run whose it is.
        names = {path.name for path in folder.iterdir()}
    if names and not names & {KEY, LOCK}:
        raise InputError(
            f"there is a folder of that name, with {min(names)} in it",
            file=folder,
            expected="nothing, or what an interrupted run left there",
            hint="Move it away, or choose another output folder.",
        )


def _read(file: Path) -> str | None:
    with suppress(OSError, UnicodeDecodeError):
        return file.read_text(encoding="utf-8")
    return None


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

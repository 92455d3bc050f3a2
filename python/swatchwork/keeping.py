# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Finished parts of a long computation, each made once: in memory here, in files in ``workflow``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]


class Kept(Protocol):
    """Arrays by name."""

    def rows(self, name: str, first: int = 0, last: int | None = None) -> Array:
        """Rows ``first`` to ``last`` of an array."""


class Keeper(Protocol):
    """What a long computation hands its parts to."""

    def kept(self, name: str, make: Callable[[], Mapping[str, Array]]) -> Kept:
        """The arrays of the part ``name``; made now unless they were before."""


@dataclass(frozen=True)
class _Held:
    arrays: Mapping[str, Array]

    def rows(self, name: str, first: int = 0, last: int | None = None) -> Array:
        return self.arrays[name][first:last]


class _InMemory:
    def kept(self, name: str, make: Callable[[], Mapping[str, Array]]) -> Kept:
        return _Held(make())


IN_MEMORY: Keeper = _InMemory()
"""Makes every part anew and holds on to it for as long as the caller does."""


@dataclass(frozen=True)
class Part:
    """A ``Keeper`` whose parts are another's, under names that begin with ``prefix``."""

    keeper: Keeper
    prefix: str

    def kept(self, name: str, make: Callable[[], Mapping[str, Array]]) -> Kept:
        """See ``Keeper``."""
        return self.keeper.kept(self.prefix + name, make)

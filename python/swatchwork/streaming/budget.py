# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How a bound on memory becomes the size of a tile and of a subset."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError

BASE = 0.6
"""GB that the interpreter, the libraries, the light and one photograph with its rays take, about."""
LARGEST_TILE = 1 << 18
"""Pairs beyond which a larger tile is no faster."""
SMALLEST_TILE = 1 << 12


@dataclass(frozen=True)
class Budget:
    """A bound on the process's memory, in GB (1e9 bytes)."""

    memory: float = 2.0

    def __post_init__(self) -> None:
        if not self.memory > BASE:
            raise InputError(
                f"memory = {self.memory} GB",
                expected=f"more than {BASE} GB, which libraries and light take",
            )

    @property
    def free(self) -> float:
        """Bytes for tile or subset: they are not there together."""
        return (self.memory - BASE) * 1e9

    def tile(self, representatives: int) -> int:
        """Pairs in a blending tile: a response takes 12 bytes, made once and weighted in place; a pair's
        numbers, direction, radiance and sorting 150."""
        return int(min(max(0.5 * self.free / (12 * representatives + 150), SMALLEST_TILE), LARGEST_TILE))

    def subset(self, kernels: int) -> int:
        """Pairs that the solver may hold: generic responses as they are made and by channel, 24 bytes each
        together, and as much again for the exploration's share, folded responses and Gram blocks."""
        return int(self.free / (40 * kernels))

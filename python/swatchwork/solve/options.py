# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a caller may choose about the solver."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..errors import InputError
from .blending import Search

MOST_REPRESENTATIVES = 64
"""Supports are 64-bit masks in the native core."""


@dataclass(frozen=True)
class SolveOptions:
    """Options of the sparse solver; None means automatic."""

    n: int | None = None
    """Representatives blended at a texel, if fixed."""
    N: int | None = None
    """Representatives in all, if fixed."""
    max_n: int = 5
    """Most blended that the search tries (the paper's real objects need no more)."""
    max_N: int = 18
    """Most representatives that the search tries (the paper's largest object)."""
    lambda0: float | None = None
    """Penalty on n (Eq. 4), a squared relative error; automatic from the residual noise if None."""
    lambda1: float | None = None
    """Penalty on N (Eq. 4), likewise."""
    search: Search = "exact"
    """How the blend step searches supports."""
    search_order: Literal["default", "paper"] = "default"
    """``paper``: section 4's loops, alternation, initialisation and greedy stop, to the letter."""
    explore_texels: int = 1200
    """Texels that models are explored on; the best goes on with all of them."""
    tolerance: float = 2e-3
    """Relative decrease an alternation below which the alternation has converged (design section 3)."""
    max_alternations: int = 600
    """Most alternations for one (n, N)."""
    robust: bool = True
    """Leave outliers out where there are any, let noisy texels count less; section 4's order never does."""
    seed: int = 0
    """Of the texels that the search runs on, and of the sample that the pruned blend search starts from."""

    @property
    def joint(self) -> bool:
        """Whether alternations include steps of representatives and weights together."""
        return self.search_order == "default"

    @property
    def robustly(self) -> bool:
        """Whether outliers and noise are heeded."""
        return self.robust and self.search_order == "default"

    def __post_init__(self) -> None:
        for name in ("n", "N", "max_n", "max_N", "max_alternations", "explore_texels"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InputError(f"{name} = {value}", expected="at least 1")
        for name in ("N", "max_N"):
            value = getattr(self, name)
            if value is not None and value > MOST_REPRESENTATIVES:
                raise InputError(f"{name} = {value}", expected=f"at most {MOST_REPRESENTATIVES}")
        if self.n is not None and self.N is not None and self.n > self.N:
            raise InputError(
                f"n = {self.n} is more than N = {self.N}",
                expected="no more representatives blended at a texel than there are",
            )
        if self.n is not None and self.N is None and self.n > self.max_N:
            raise InputError(
                f"n = {self.n} is more than max_N = {self.max_N}",
                expected="room for as many representatives as a texel is to blend",
            )
        for name in ("lambda0", "lambda1"):
            value = getattr(self, name)
            if value is not None and not 0 <= value < 1:
                raise InputError(
                    f"{name} = {value}",
                    expected="a squared relative error from 0 up to 1, such as 0.005^2 = 2.5e-5",
                )

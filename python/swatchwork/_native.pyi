# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Types of the Rust extension; checked against the built module by scripts/ci/check_stub.py."""

import numpy as np
import numpy.typing as npt

# Rendering operator.

class Pyramid:
    def __new__(cls, base: npt.NDArray[np.float32]) -> Pyramid: ...
    @property
    def size(self) -> int: ...

class RingBasis:
    def __new__(
        cls,
        tangent: npt.NDArray[np.float32],
        solid_angle: npt.NDArray[np.float32],
        azimuths: npt.NDArray[np.uint32],
        maskings: list[str],
        plane: npt.NDArray[np.uint32],
        weights: npt.NDArray[np.float32],
        diffuse: npt.NDArray[np.float32],
    ) -> RingBasis: ...
    @property
    def kernels(self) -> int: ...
    @property
    def lookups(self) -> int: ...
    def generic_responses(
        self,
        pyramid: Pyramid,
        normal: npt.NDArray[np.float32],
        to_viewer: npt.NDArray[np.float32],
        sky: npt.NDArray[np.uint64],
        sky_row: npt.NDArray[np.int32],
        instruction_set: str | None = None,
    ) -> npt.NDArray[np.float32]: ...
    def representative_responses(
        self,
        representatives: npt.NDArray[np.float64],
        pyramid: Pyramid,
        normal: npt.NDArray[np.float32],
        to_viewer: npt.NDArray[np.float32],
        sky: npt.NDArray[np.uint64],
        sky_row: npt.NDArray[np.int32],
        instruction_set: str | None = None,
    ) -> npt.NDArray[np.float32]: ...

def instruction_sets() -> list[str]: ...

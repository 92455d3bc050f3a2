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
    @property
    def lights(self) -> list[int]: ...

class RingBasis:
    def __new__(
        cls,
        tangent: npt.NDArray[np.float32],
        solid_angle: npt.NDArray[np.float32],
        azimuths: npt.NDArray[np.uint32],
        layer: npt.NDArray[np.uint32],
        light_bins: tuple[float, float, int],
        maskings: list[str],
        fresnel: list[int],
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

class SolverProblem:
    """Measurements and generic responses at the texels that take part (Eq. 5)."""

    @property
    def gamma(self) -> npt.NDArray[np.float64]: ...
    def __new__(
        cls,
        responses: npt.NDArray[np.float32],
        radiance: npt.NDArray[np.float32],
        offsets: npt.NDArray[np.int64],
        floor: npt.NDArray[np.float64],
    ) -> SolverProblem: ...
    def fold(self, representatives: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]: ...
    def representatives(
        self, weights: npt.NDArray[np.float64], start: npt.NDArray[np.float64]
    ) -> tuple[npt.NDArray[np.float64], float, bool]: ...
    def joint_step(
        self,
        weights: npt.NDArray[np.float64],
        representatives: npt.NDArray[np.float64],
        damping: float,
    ) -> npt.NDArray[np.float64]: ...
    def normal_equations(
        self, weights: npt.NDArray[np.float64], channel: int
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], float]: ...

def blend(
    responses: npt.NDArray[np.float32],
    radiance: npt.NDArray[np.float32],
    offsets: npt.NDArray[np.int64],
    most: int,
    search: str = "exact",
    previous: npt.NDArray[np.float64] | None = None,
    sample: float = 0.05,
    cover: float = 0.99,
    seed: int = 0,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], int]: ...
def blend_slots(
    responses: npt.NDArray[np.float32],
    radiance: npt.NDArray[np.float32],
    offsets: npt.NDArray[np.int64],
    most: int,
    search: str = "exact",
    sample: float = 0.05,
    cover: float = 0.99,
    seed: int = 0,
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.float32], npt.NDArray[np.float64], int]: ...
def nnls(
    h: npt.NDArray[np.float64], b: npt.NDArray[np.float64], start: npt.NDArray[np.float64], tolerance: float
) -> tuple[npt.NDArray[np.float64], bool]: ...

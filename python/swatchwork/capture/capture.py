# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a capture is: photographs with cameras, a mesh, and the light they were taken under."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture.camera import Camera
from swatchwork.errors import InputError

CONVENTIONS = ("blender", "mitsuba", "debevec-angular")
"""How pixels of an environment map stand for directions; the formulas are in `swatchwork.light`."""


@dataclass(frozen=True, eq=False)
class EnvironmentSource:
    """An environment map on disk.

    Attributes:
        file: HDR image, EXR or .hdr.
        convention: one of `CONVENTIONS`.
        world_from_environment: F64[3, 3] rotation.
    """

    file: Path
    convention: str
    world_from_environment: F64 = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True, eq=False)
class Frame:
    """One photograph.

    Attributes:
        name: the frame's ``file_path`` as the JSON has it.
        image_path: the image file.
        mask_path: image whose gray level above 0.5 is inside; None: all of the image.
        exposure: pixel value per radiance; radiance = pixel / exposure.
        camera: its calibrated camera.
        environment: the light in this frame: its own, or else the capture's.
    """

    name: str
    image_path: Path
    mask_path: Path | None
    exposure: float
    camera: Camera
    environment: EnvironmentSource | None


@dataclass(frozen=True, eq=False)
class Capture:
    """A capture folder, read.

    Attributes:
        root: its folder.
        file: its ``transforms.json``.
        mesh_path: the object's mesh.
        occluder_paths: meshes that block light and sight but are not recovered.
        environment: the light of all frames that have none of their own.
        frames: the photographs, in the order of the file.
    """

    root: Path
    file: Path
    mesh_path: Path | None
    occluder_paths: tuple[Path, ...]
    environment: EnvironmentSource | None
    frames: tuple[Frame, ...]

    def first(self, k: int) -> Capture:
        """The capture with its first ``k`` frames only.

        Raises:
            InputError: ``k`` is less than 1 or more than there are.
        """
        if not 1 <= k <= len(self.frames):
            raise InputError(
                f"{k} frames asked for", file=self.file, expected=f"1 to the {len(self.frames)} that it has"
            )
        return replace(self, frames=self.frames[:k])

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a material folder to renders: one EXR and one preview for each camera."""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import F64
from ..capture import CONVENTIONS, Capture, EnvironmentSource, read_capture
from ..errors import InputError
from ..light import Environment, read_environment
from ..material import read_material
from ..progress import SILENT, Progress
from ..relight import Lighting, RelitScene, relight, turntable
from ..surface import Mesh, read_mesh

BOUNCES = 2
"""Beside the edge of a corner with albedos up to 0.8, they carry 95 % of the indirect light."""


@dataclass(frozen=True)
class RelightSummary:
    """What was rendered."""

    material: str
    output: str
    files: tuple[str, ...]
    turntable: str | None
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        turning = f" and {Path(self.turntable).name}" if self.turntable else ""
        count = len(self.files)
        return f"{count} render{'s' if count != 1 else ''}{turning} in {self.output} ({self.seconds:.1f} s)"


def relight_folder(
    material_folder: str | PathLike[str],
    cameras: str | PathLike[str],
    output: str | PathLike[str],
    *,
    environment: str | PathLike[str] | None = None,
    convention: str | None = None,
    rotation: tuple[str, float] | None = None,
    turntable_frames: int = 0,
    turntable_format: str = "gif",
    samples: int = 2,
    interreflections: int | None = None,
    progress: Progress = SILENT,
) -> RelightSummary:
    """Render a material from the cameras of a transforms.json, under its light or another.

    Args:
        material_folder: as ``reconstruct_folder`` writes it.
        cameras: transforms.json; its mesh and images need not exist, its occluders must.
        output: folder of the renders.
        environment: image to use instead of the file's own; ``convention`` is then required.
        rotation: world axis ("x", "y", "z") and degrees to turn the light by, right-handed.
        turntable_frames: also turn the object once before the first camera, in so many pictures.
        turntable_format: "gif" or "mp4".
        samples: as `swatchwork.relight.render` takes them.
        interreflections: times that light may go on from the object to the object; by default ``BOUNCES`` for
            a material that was recovered with them, else 0. The turntable goes without.

    Raises:
        InputError: material, cameras or light are wrong, an occluder is missing, or there is no light.
        OutputError: a file cannot be written.
    """
    start = time.perf_counter()
    given = given_environment(environment, convention)
    material = read_material(material_folder)
    capture = read_capture(cameras, require_images=False)
    lighting = Lighting(given, rotation_matrix(rotation))
    occluders = occluder_meshes(capture)
    scene = RelitScene.of(material, occluders, progress)
    bounces = interreflections
    if bounces is None:
        bounces = BOUNCES if material.solver.get("interreflections") else 0
    done = relight(
        scene, capture, output, lighting=lighting, samples=samples, bounces=bounces, progress=progress
    )
    turning = None
    if turntable_frames:
        turning = Path(output) / f"turntable.{turntable_format}"
        first = capture.frames[0]
        light = lighting.of(capture, first)
        turntable(scene, first.camera, light, turning, frames=turntable_frames, progress=progress)
    return RelightSummary(
        str(material_folder),
        str(output),
        tuple(str(frame.exr) for frame in done),
        str(turning) if turning else None,
        time.perf_counter() - start,
    )


def occluder_meshes(capture: Capture) -> list[Mesh]:
    """The meshes that stand between object and light or camera; InputError where one is not on disk."""
    for path in capture.occluder_paths:
        # Rendered without it, the object would silently lack its shadow.
        if not path.is_file():
            raise InputError(
                f"the occluder {path} does not exist",
                file=capture.file,
                expected='every file of "occluders"',
                hint='Put it there, or take it out of "occluders" to render without it',
            )
    return [read_mesh(path) for path in capture.occluder_paths]


def given_environment(file: str | PathLike[str] | None, convention: str | None) -> Environment | None:
    """The environment that was asked for by name; InputError where only half of it was said."""
    if file is None:
        if convention is not None:
            raise InputError("--convention says how --environment is read", expected="--environment FILE too")
        return None
    if convention is None:
        raise InputError(
            "nothing says how its pixels stand for directions",
            file=file,
            expected=f"--convention {' or '.join(CONVENTIONS)}",
        )
    return read_environment(EnvironmentSource(Path(file), convention))


def rotation_matrix(rotation: tuple[str, float] | None) -> F64:
    """[3, 3] right-handed rotation about a world axis by degrees; the identity for None."""
    matrix = np.eye(3)
    if rotation is not None:
        axis, degrees = rotation
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        i = "xyz".index(axis)
        j, k = (i + 1) % 3, (i + 2) % 3
        matrix[j, j] = matrix[k, k] = c
        matrix[k, j], matrix[j, k] = s, -s
    return matrix

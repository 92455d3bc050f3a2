# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a material folder to renders: one EXR and one preview for each camera."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from PIL import Image

from ..arrays import F32, F64, U8
from ..capture import Capture, EnvironmentSource, Frame, read_capture, write_exr
from ..errors import InputError, OutputError
from ..light import Environment, read_environment
from ..material import Material, read_material
from ..progress import SILENT, Progress
from ..relight import render
from .previews import preview


@dataclass(frozen=True)
class RelightSummary:
    """What was rendered."""

    material: str
    output: str
    files: tuple[str, ...]
    seconds: float
    turntable: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        turning = f", and {self.turntable}" if self.turntable else ""
        return f"{len(self.files)} renders in {self.output} ({self.seconds:.1f} s){turning}"


def relight_folder(
    material_folder: str | PathLike[str],
    cameras: str | PathLike[str],
    output: str | PathLike[str],
    *,
    environment: str | PathLike[str] | None = None,
    convention: str | None = None,
    rotation: tuple[str, float] | None = None,
    turntable: int = 0,
    samples: int = 2,
    progress: Progress = SILENT,
) -> RelightSummary:
    """Render a material from the cameras of a transforms.json, under its light or another.

    Args:
        environment: image to use instead of the file's own; ``convention`` is then required.
        rotation: world axis ("x", "y", "z") and degrees to turn the light by.
        turntable: also render so many frames of the light and camera fixed and the object turning.
        samples: samples along a pixel's side.

    Raises:
        InputError: material, cameras or light are wrong, or there is no light.
    """
    start = time.perf_counter()
    material = read_material(material_folder)
    capture = read_capture(cameras, require_images=False)
    if environment is not None and convention is None:
        raise InputError(
            "nothing says how its pixels stand for directions",
            file=environment,
            expected="--convention blender, mitsuba or debevec-angular",
        )
    folder = Path(output)
    lights = Lights(capture, environment, convention, rotation_matrix(rotation))
    for frame in capture.frames:
        lights.source_of(frame)
    written = []
    with progress.stage("relight", len(capture.frames)) as task:
        for frame in capture.frames:
            light = lights.of(frame)
            pixels = render(material, frame.camera, light, supersample=samples)
            written.append(_write(folder, frame, pixels, light))
            task.advance()
    gif = None
    if turntable:
        frame = capture.frames[0]
        gif = str(_turntable(folder, material, frame, lights.of(frame), turntable, samples, progress))
    return RelightSummary(str(material_folder), str(folder), tuple(written), time.perf_counter() - start, gif)


class Lights:
    """The light of each frame, each file read once."""

    def __init__(
        self,
        capture: Capture,
        environment: str | PathLike[str] | None,
        convention: str | None,
        rotation: F64,
    ) -> None:
        self._capture, self._rotation = capture, rotation
        self._given = (
            EnvironmentSource(Path(environment), convention or "") if environment is not None else None
        )
        self._read: dict[int, tuple[EnvironmentSource, Environment]] = {}

    def source_of(self, frame: Frame) -> EnvironmentSource:
        """The file that lights ``frame``; InputError where there is none."""
        source = self._given or frame.environment or self._capture.environment
        if source is None:
            raise InputError(
                "has no light",
                file=f"{self._capture.file}: frame {frame.name}",
                expected='an "environment", or --environment FILE --convention NAME',
            )
        return source

    def of(self, frame: Frame) -> Environment:
        """The light of ``frame``, turned."""
        source = self.source_of(frame)
        if id(source) not in self._read:
            self._read[id(source)] = (source, read_environment(source).rotated(self._rotation))
        return self._read[id(source)][1]


def rotation_matrix(rotation: tuple[str, float] | None) -> F64:
    """[3, 3] rotation about a world axis by degrees, right-handed; the identity for None."""
    if rotation is None:
        return np.eye(3)
    axis, degrees = rotation
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    i = "xyz".index(axis)
    matrix = np.eye(3)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix[j, j] = matrix[k, k] = c
    matrix[k, j], matrix[j, k] = s, -s
    return matrix


def render_name(frame: Frame) -> PurePosixPath:
    """Where a frame's render lies within the output: the frame's own file name, as EXR."""
    return PurePosixPath(PurePosixPath(frame.name.replace("\\", "/")).name).with_suffix(".exr")


def _write(folder: Path, frame: Frame, pixels: F32, light: Environment) -> str:
    path = folder / render_name(frame)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_exr(path, pixels)
        _save(Image.fromarray(preview(pixels, light)), path.with_suffix(".png"))
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
    return str(path)


def _save(image: Image.Image, path: Path, **how: Any) -> None:
    partial = path.with_name(f".{path.name}.partial")
    try:
        image.save(partial, format=path.suffix[1:].upper(), **how)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _turntable(
    folder: Path,
    material: Material,
    frame: Frame,
    light: Environment,
    count: int,
    samples: int,
    progress: Progress,
) -> Path:
    path = folder / "turntable.gif"
    with progress.stage("turntable", count) as task:

        def pictures() -> Iterator[Image.Image]:
            for i in range(count):
                # Turning camera and light together about the object is turning the object before them.
                turn = rotation_matrix(("z", -360.0 * i / count))
                pose = np.eye(4)
                pose[:3, :3] = turn
                camera = replace(frame.camera, world_from_camera=pose @ frame.camera.world_from_camera)
                yield Image.fromarray(
                    _on_grey(
                        preview(render(material, camera, light.rotated(turn), supersample=samples), light)
                    )
                )
                task.advance()

        images = list(pictures())
        _save(
            images[0], path, save_all=True, append_images=images[1:], duration=max(20, 4000 // count), loop=0
        )
    return path


def _on_grey(rgba: U8) -> U8:
    alpha = rgba[..., 3:].astype(np.float32) / 255
    return np.asarray(rgba[..., :3] * alpha + 24 * (1 - alpha), dtype=np.uint8)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Render the frames of a transforms.json into files of the same names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path, PurePosixPath

import numpy as np

from ..arrays import F64
from ..capture import IMAGE_SUFFIXES, Capture, EnvironmentSource, Frame, write_exr, write_png
from ..errors import InputError, OutputError
from ..interreflection import IndirectLight
from ..light import Environment, read_environment
from ..progress import SILENT, Progress
from ..whole import held, whole_file
from .preview import display_image
from .render import render
from .scene import RelitScene


@dataclass
class Lighting:
    """Which light a frame is under: one given, else the frame's own, else its capture's.

    ``rotation`` [3, 3] turns whichever it is in the world. Files are read once.
    """

    given: Environment | None = None
    rotation: F64 = field(default_factory=lambda: np.eye(3))
    _read: dict[tuple[str, str, bytes], Environment] = field(default_factory=dict, repr=False)

    def of(self, capture: Capture, frame: Frame) -> Environment:
        """The environment of a frame.

        Raises:
            InputError: there is none, or its file cannot be read.
        """
        if self.given is not None:
            return self._kept(("", "", b""), None)
        source = frame.environment or capture.environment
        if source is None:
            raise InputError(
                f"frame {frame.name} names no environment",
                file=capture.file,
                expected='an "environment" key',
                hint="Or give one with --environment and --convention",
            )
        return self._kept(
            (str(source.file), source.convention, source.world_from_environment.tobytes()), source
        )

    def _kept(self, key: tuple[str, str, bytes], source: EnvironmentSource | None) -> Environment:
        if key not in self._read:
            light = self.given if source is None else read_environment(source)
            assert light is not None
            turned = not np.array_equal(self.rotation, np.eye(3))
            self._read[key] = light.rotated(self.rotation) if turned else light
        return self._read[key]


@dataclass(frozen=True)
class RelitFrame:
    """A frame that was rendered, and its files."""

    name: str
    exr: Path
    png: Path | None


def relight(
    scene: RelitScene,
    cameras: Capture,
    folder: str | PathLike[str],
    *,
    lighting: Lighting | None = None,
    samples: int = 2,
    bounces: int = 0,
    previews: bool = True,
    progress: Progress = SILENT,
) -> tuple[RelitFrame, ...]:
    """Render every frame of ``cameras`` into ``folder``.

    One float EXR a frame under the frame's own file name: linear RGB premultiplied by alpha A, radiance (a
    frame's exposure is not applied); beside it a PNG to look at. Each file appears whole or not at all.
    ``bounces`` is how many times light may go on from the object to the object (`interreflection`).

    Raises:
        InputError: a frame without light, or two frames of one name.
        OutputError: a file cannot be written.
    """
    folder, lighting = Path(folder), lighting or Lighting()
    names = output_names([frame.name for frame in cameras.frames])
    # Ask for every light first: a missing one should not come to light after an hour.
    lights = [lighting.of(cameras, frame) for frame in cameras.frames]
    done = []
    # What the object sends to itself is large: a light's is kept until its last frame.
    last = {id(light): number for number, light in enumerate(lights)}
    indirect: dict[int, IndirectLight | None] = {}
    with _alone(folder), progress.stage("relight", len(cameras.frames)) as task:
        for number, (frame, name, light) in enumerate(zip(cameras.frames, names, lights, strict=True)):
            task.describe(frame.name)
            if id(light) not in indirect:
                indirect[id(light)] = scene.indirect(light, bounces, progress)
            image = render(scene, frame.camera, light, samples, indirect[id(light)])
            if number == last[id(light)]:
                del indirect[id(light)]
            exr, png = folder / f"{name}.exr", folder / f"{name}.png" if previews else None
            with whole_file(exr) as temporary:
                write_exr(temporary, image)
            if png is not None:
                with whole_file(png) as temporary:
                    write_png(temporary, display_image(image, light))
            done.append(RelitFrame(frame.name, exr, png))
            task.advance()
    return tuple(done)


def output_names(names: Sequence[str]) -> list[str]:
    """File names without suffix for frames' file_paths: the last part, or all of it where parts coincide.

    Raises:
        InputError: two frames have the very same path.
    """
    paths = [PurePosixPath(name.replace("\\", "/")) for name in names]
    # A name may lack a suffix, as NeRF-Blender's do: cut only what is one.
    bare = [p.with_suffix("") if p.suffix.lower() in IMAGE_SUFFIXES else p for p in paths]
    if len({p.name for p in bare}) == len(bare):
        return [p.name for p in bare]
    whole = ["/".join(part for part in p.parts if part not in ("..", ".", "/")) for p in bare]
    repeated = {name for name in whole if whole.count(name) > 1}
    if repeated:
        raise InputError(
            f"several frames are called {min(repeated)!r}", expected="a file_path of its own for each"
        )
    return whole


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Two runs into one folder would leave some files of each."""
    with ExitStack() as stack:
        try:
            stack.enter_context(held(folder))
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
        yield

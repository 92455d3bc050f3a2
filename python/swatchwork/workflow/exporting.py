# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a material folder to what other programs read."""

from __future__ import annotations

import time
import warnings
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from ..capture import read_capture
from ..errors import CaptureWarning, InputError
from ..export import (
    UP,
    Padding,
    StandardFit,
    Surroundings,
    Up,
    check_free,
    check_glb_free,
    export_folder,
    fit_standard,
    glb_file,
    write_blender,
    write_maps,
    write_materialx,
    write_mitsuba,
)
from ..material import Material, read_material
from ..progress import SILENT, Progress
from ..relight import Lighting
from .relighting import given_environment, rotation_matrix

FORMATS = ("gltf", "mitsuba", "blender", "materialx", "maps")

EXCLUDED = {"blender": "Blender's Fresnel, which follows n.o where the fitted model's follows o.h"}
"""By format, where the stated loss is not all: how the program's rendering departs from the fitted model."""


@dataclass(frozen=True)
class ExportSummary:
    """What was written, and what it lost."""

    material: str
    format: str
    output: str
    rendered_loss: float | None
    """NRMS of the fitted model's pictures against the material's, under a light it was not fitted to; None
    where nothing was fitted."""
    rendered_loss_excludes: str | None
    """What the program does otherwise than the fitted model, and that figure does not hold."""
    clipped: float | None
    """Share of texels whose base colour would have to be above 1."""
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        loss = ""
        if self.rendered_loss is not None:
            loss = f"; fitted to one lobe, which costs {100 * self.rendered_loss:.1f} % (NRMS, rendered)"
        if self.rendered_loss_excludes is not None:
            loss += f" before {self.rendered_loss_excludes}"
        if self.clipped:
            loss += f", {100 * self.clipped:.1f} % of the texels clipped at base colour 1"
        return f"{self.format} in {self.output}{loss} ({self.seconds:.1f} s)"


def export_material(
    material_folder: str | PathLike[str],
    output: str | PathLike[str],
    target: str,
    *,
    cameras: str | PathLike[str] | None = None,
    environment: str | PathLike[str] | None = None,
    convention: str | None = None,
    rotation: tuple[str, float] | None = None,
    up: Up | None = None,
    progress: Progress = SILENT,
) -> ExportSummary:
    """Write a material for another program.

    Args:
        material_folder: as ``reconstruct_folder`` writes it.
        output: folder of the export; for ``gltf`` it may be a file, NAME.glb.
        target: one of FORMATS.
        cameras: transforms.json whose frames a scene (``mitsuba``, ``blender``) is to hold; without it there
            is one made-up view under a made-up sky. Its images need not exist.
        environment: light to use instead of the file's own; ``convention`` is then required.
        rotation: world axis ("x", "y", "z") and degrees to turn the light by, right-handed.
        up: world axis that points up, "y" or "z" (the default, whatever the format): ``gltf`` lays it along
            its own, y, and the made-up view and sky are upright by it.

    Raises:
        InputError: material, cameras or light are wrong, the format is unknown or does not use an option
            that is given, or something that is not an export is in the way.
        OutputError: it cannot be written; what was there before is intact.
    """
    start = time.perf_counter()
    if target not in FORMATS:
        raise InputError(f"no format {target!r}", expected=f"one of {', '.join(FORMATS)}")
    scenes = target in ("mitsuba", "blender")
    _refuse_unused(target, scenes, cameras, environment, convention, rotation, up)
    upright: Up = up or UP
    as_file = target == "gltf" and Path(output).suffix.lower() == ".glb"
    if as_file:
        check_glb_free(Path(output))
    else:
        check_free(output)
    material = read_material(material_folder)
    frames = _surroundings(material, cameras, environment, convention, rotation, upright) if scenes else None
    padding = Padding.of(material)
    fit = fit_standard(material, progress) if target in ("gltf", "materialx", "blender") else None
    name = Path(material_folder).resolve().name
    if as_file:
        assert fit is not None
        glb_file(Path(output), material, fit, padding, up=upright, name=name)
    else:
        with export_folder(output, target) as (folder, head):
            if fit is not None:
                head |= _loss(fit, target)
            if target == "gltf" and fit is not None:
                glb_file(folder / "object.glb", material, fit, padding, up=upright, name=name)
            elif target == "mitsuba" and frames is not None:
                write_mitsuba(folder, material, padding, frames, progress)
            elif target == "blender" and fit is not None and frames is not None:
                write_blender(folder, material, fit, padding, frames)
            elif target == "materialx" and fit is not None:
                write_materialx(folder, material, fit, padding)
            else:
                write_maps(folder, material, padding, progress)
    return ExportSummary(
        str(material_folder),
        target,
        str(output),
        fit.loss_nrms if fit else None,
        EXCLUDED.get(target),
        fit.clipped if fit else None,
        time.perf_counter() - start,
    )


def _refuse_unused(
    target: str,
    scenes: bool,
    cameras: str | PathLike[str] | None,
    environment: str | PathLike[str] | None,
    convention: str | None,
    rotation: tuple[str, float] | None,
    up: Up | None,
) -> None:
    """Raise InputError where an option is given that the export would ignore."""
    if up not in (None, "y", "z"):
        raise InputError(f"up is {up!r}", expected="y or z")
    of_scenes = {
        "--cameras": cameras,
        "--environment": environment,
        "--convention": convention,
        "--environment-rotation": rotation,
    }
    given = [option for option, value in of_scenes.items() if value is not None and not scenes]
    if given:
        raise InputError(
            f"{target} holds neither cameras nor light, and {' and '.join(given)} would do nothing",
            expected=f"no {' or '.join(of_scenes)}",
        )
    if up is not None and target not in ("gltf", "mitsuba", "blender"):
        raise InputError(
            f"{target} keeps the world's own axes, and --up would do nothing", expected="no --up"
        )
    if up is not None and cameras is not None:
        raise InputError(
            "--up is for the made-up view and sky, and --cameras gives others", expected="one of the two"
        )


def _loss(fit: StandardFit, target: str) -> dict[str, float | str | None]:
    return {
        "rendered_loss_is_of": "the fitted model, that of glTF 2.0",
        "rendered_loss_excludes": EXCLUDED.get(target),
        "rendered_loss_nrms": fit.loss_nrms,
        "rendered_loss_nrms_of_fitted_lights": fit.fit_nrms,
        "base_colour_clipped": fit.clipped,
    }


def _surroundings(
    material: Material,
    cameras: str | PathLike[str] | None,
    environment: str | PathLike[str] | None,
    convention: str | None,
    rotation: tuple[str, float] | None,
    up: Up,
) -> Surroundings:
    given = given_environment(environment, convention)
    lighting = Lighting(given, rotation_matrix(rotation))
    if cameras is None:
        made_up = Surroundings.made_up(material, up)
        light = given or made_up.lights[0]
        return Surroundings.of(made_up.names, made_up.cameras, [light.rotated(lighting.rotation)])
    capture = read_capture(cameras, require_images=False)
    if capture.occluder_paths:
        warnings.warn(
            f"{len(capture.occluder_paths)} occluders of {capture.file} are not part of the export: their "
            "shadows will be missing",
            CaptureWarning,
            stacklevel=3,
        )
    lights = [lighting.of(capture, frame) for frame in capture.frames]
    return Surroundings.of(
        [frame.name for frame in capture.frames], [frame.camera for frame in capture.frames], lights
    )

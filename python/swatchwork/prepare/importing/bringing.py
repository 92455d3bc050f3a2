# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a foreign folder to a capture folder, whole or not at all."""

from __future__ import annotations

import os
import shutil
import time
import warnings
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.capture import (
    Capture,
    EnvironmentSource,
    Frame,
    read_capture,
    read_mask,
    write_capture,
    write_exr,
    write_png,
)
from swatchwork.capture.images import image_size
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.light import read_environment
from swatchwork.material import whole_folder
from swatchwork.prepare.importing import (
    colmap,
    metashape,
    nerf_blender,
    objects_with_lighting,
    stanford_orb,
)
from swatchwork.prepare.importing.found import Layout, Request, Shot
from swatchwork.progress import SILENT, Progress
from swatchwork.surface import buffers_of, mesh_from_arrays, read_mesh, write_mesh_obj
from swatchwork.surface.obj import read_obj

LAYOUTS = {
    layout.name: layout
    for layout in (
        colmap.LAYOUT,
        metashape.LAYOUT,
        nerf_blender.LAYOUT,
        stanford_orb.LAYOUT,
        objects_with_lighting.LAYOUT,
    )
}


@dataclass(frozen=True)
class ImportSummary:
    """What was imported."""

    capture: str
    layout: str
    photographs: int
    skipped: tuple[str, ...]
    """Photographs that the source names and has no camera for."""
    mesh: str
    environments: int
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        left = f", {len(self.skipped)} without a camera left out" if self.skipped else ""
        lights = f"{self.environments} light probe{'s' if self.environments != 1 else ''}"
        return (
            f"{self.photographs} photographs{left}, {self.mesh} and {lights} from {self.layout} "
            f"in {self.capture} ({self.seconds:.1f} s); next: swatchwork check {self.capture}"
        )


def import_capture(
    source: str | PathLike[str],
    output: str | PathLike[str],
    *,
    layout: str | None = None,
    mesh: str | PathLike[str] | None = None,
    environment: EnvironmentSource | None = None,
    images: str | PathLike[str] | None = None,
    masks: str | PathLike[str] | None = None,
    split: str | None = None,
    link: bool = False,
    progress: Progress = SILENT,
) -> ImportSummary:
    """Write a capture folder from another program's.

    Args:
        source: its folder or file.
        output: the capture folder; new or empty.
        layout: one of ``LAYOUTS``; by default the one that the source looks like.
        mesh: the object, in the source's world; by default the source's own.
        environment: the light, in the source's world; by default the source's own.
        images: folder of the photographs, where the source does not say.
        masks: folder of masks, NAME.png or STEM.png for each photograph.
        split: which part of a data set.
        link: hard links to the photographs instead of copies.

    Raises:
        InputError: the source is of no known layout, or wrong; there is no mesh or no light; the output
            holds something.
        OutputError: the output cannot be written; nothing of it is left.
    """
    start = time.perf_counter()
    source, output = Path(source), Path(output)
    if output.exists() and not (output.is_dir() and not any(output.iterdir())):
        raise InputError(
            "exists already",
            file=output,
            expected="a new folder, or an empty one",
            hint="Choose another name",
        )
    chosen = _layout(source, layout)
    request = Request(
        source,
        Path(images) if images is not None else None,
        Path(masks) if masks is not None else None,
        split,
        environment is not None,
    )
    found = chosen.read(request)
    if not found.shots:
        raise InputError("has no photograph with a camera", file=source, expected="at least one")
    shape = Path(mesh) if mesh is not None else found.mesh
    if shape is None:
        raise InputError(
            f"a {chosen.name} folder says nothing of the object's mesh",
            file=source,
            expected="--mesh FILE, in the same world as the cameras",
        )
    read_mesh(shape)
    shared = environment or found.environment
    dark = next((s.name for s in found.shots if s.environment is None and shared is None), None)
    if dark is not None:
        raise InputError(
            f"a {chosen.name} folder says nothing of the light",
            file=source,
            expected="--environment FILE --convention NAME, in the same world as the cameras",
        )
    for shot in found.shots:
        _check(shot)
    with whole_folder(output, replaceable=lambda _: False) as fresh:
        lights = _Lights(fresh)
        common = lights.copied(shared, "env") if shared is not None else None
        frames = []
        with progress.stage("import", len(found.shots)) as task:
            for shot in found.shots:
                own = shot.environment
                light = lights.copied(own, f"env/{own.file.stem}") if own is not None else common
                frames.append(_brought(shot, fresh, light, link))
                task.advance()
        own_mesh = mesh is None and found.normals_suspect
        placed = _brought_mesh(shape, fresh, own_mesh)
        write_capture(Capture(fresh, fresh / "transforms.json", placed, (), common, tuple(frames)), fresh)
        # What we wrote is what our own reader accepts, or nothing is left of it.
        read_capture(fresh)
    return ImportSummary(
        str(output),
        chosen.name,
        len(found.shots),
        found.skipped,
        shape.name,
        lights.count,
        time.perf_counter() - start,
    )


def _layout(source: Path, name: str | None) -> Layout:
    if not source.exists():
        raise InputError("no such file or folder", file=source, expected="the folder to import")
    if name is not None:
        if name not in LAYOUTS:
            raise InputError(f"no layout {name!r}", expected="one of " + ", ".join(LAYOUTS))
        return LAYOUTS[name]
    fitting = [layout for layout in LAYOUTS.values() if layout.matches(source)]
    # Stanford-ORB's cameras are in NeRF's layout.
    if stanford_orb.LAYOUT in fitting:
        fitting = [layout for layout in fitting if layout is not nerf_blender.LAYOUT]
    if len(fitting) != 1:
        names = ", ".join(layout.name for layout in fitting)
        raise InputError(
            f"looks like several layouts ({names})"
            if fitting
            else "looks like no layout that can be imported",
            file=source,
            expected="--format with one of " + ", ".join(LAYOUTS),
        )
    return fitting[0]


def _check(shot: Shot) -> None:
    """Sizes, before anything is written."""
    size, camera = image_size(shot.image), shot.camera
    if size != (camera.width, camera.height):
        raise InputError(
            f"the image is {size[0]} x {size[1]}",
            file=shot.image,
            expected=f"{camera.width} x {camera.height}, as its camera says",
            hint="Import the photographs that the cameras were made from, at their full size",
        )
    if shot.mask is not None and image_size(shot.mask) != size:
        width, height = image_size(shot.mask)
        raise InputError(
            f"the mask is {width} x {height}", file=shot.mask, expected=f"{size[0]} x {size[1]}, as the image"
        )


class _Lights:
    """Environment maps copied into the capture, each file once."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._copies = folder, dict[Path, Path]()

    @property
    def count(self) -> int:
        return len(self._copies)

    def copied(self, light: EnvironmentSource, stem: str) -> EnvironmentSource:
        source = light.file.resolve()
        if source not in self._copies:
            read_environment(light)
            target = self.folder / (stem + light.file.suffix.lower())
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
            self._copies[source] = target
        return EnvironmentSource(self._copies[source], light.convention, light.world_from_environment)


def _brought(shot: Shot, folder: Path, light: EnvironmentSource | None, link: bool) -> Frame:
    target = folder / "images" / shot.name
    if target.exists():
        raise InputError(
            f"two photographs are named {shot.name}", file=shot.image, expected="one of each name"
        )
    target.parent.mkdir(parents=True, exist_ok=True)
    mask = (folder / "masks" / shot.name).with_suffix(".png") if shot.mask is not None else None
    if shot.decode is not None:
        radiance, valid = shot.decode()
        write_exr(target, radiance)
        inside = valid if shot.mask is None else valid & read_mask(shot.mask)
        # EXR knows no clipping: what was clipped is left out by the mask.
        mask = (folder / "masks" / shot.name).with_suffix(".png")
        mask.parent.mkdir(parents=True, exist_ok=True)
        write_png(mask, np.repeat(np.uint8(255) * inside[..., None], 3, axis=-1))
    else:
        _place(shot.image, target, link)
        if shot.mask is not None and mask is not None:
            mask = mask.with_suffix(shot.mask.suffix)
            mask.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(shot.mask, mask)
    return Frame(f"images/{shot.name}", target, mask, shot.exposure, shot.camera, light)


def _place(source: Path, target: Path, link: bool) -> None:
    if not link:
        shutil.copyfile(source, target)
        return
    try:
        os.link(source.resolve(), target)
    except OSError as error:
        raise InputError(
            f"cannot be linked into the capture ({error.strerror})",
            file=source,
            expected="a capture on the same file system",
            hint="Leave out --link to copy the photographs",
        ) from error


def _brought_mesh(source: Path, folder: Path, normals_suspect: bool) -> Path:
    target = folder / f"mesh{source.suffix.lower()}"
    if normals_suspect and source.suffix.lower() == ".obj":
        vertices, faces, normals, uv = read_obj(source)
        mesh = mesh_from_arrays(vertices, faces, None, uv, file=source)
        if normals is not None and np.einsum("vx,vx->v", mesh.normals, normals).mean() < 0.8:
            warnings.warn(
                CaptureWarning(f"{source}: the normals are not those of the triangles; new ones are made"),
                stacklevel=3,
            )
            write_mesh_obj(target, mesh)
            return target
    shutil.copyfile(source, target)
    for buffer in buffers_of(source):
        inside = os.path.relpath(buffer, source.parent)
        if inside.startswith(".."):
            raise InputError(f"names {inside}, outside its folder", file=source, expected="buffers beside it")
        (folder / inside).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(buffer, folder / inside)
    return target

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a foreign folder to a capture folder, whole or not at all."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from swatchwork.capture import Capture, EnvironmentSource, read_capture, write_capture
from swatchwork.capture.images import image_size
from swatchwork.errors import InputError
from swatchwork.prepare.importing import (
    colmap,
    metashape,
    nerf_blender,
    objects_with_lighting,
    stanford_orb,
)
from swatchwork.prepare.importing.copying import Lights, bring_mesh, bring_photograph
from swatchwork.prepare.importing.found import Layout, Request, Shot, check_links
from swatchwork.progress import SILENT, Progress
from swatchwork.surface import read_mesh
from swatchwork.whole import whole_folder

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
    check_links(found, request)
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
    with whole_folder(output, lambda _: False, "empty") as fresh:
        lights = Lights(fresh)
        common = lights.copied(shared, "env") if shared is not None else None
        frames = []
        with progress.stage("import", len(found.shots)) as task:
            for shot in found.shots:
                own = shot.environment
                light = lights.copied(own, f"env/{own.file.stem}") if own is not None else common
                frames.append(bring_photograph(shot, fresh, light, link))
                task.advance()
        own_mesh = mesh is None and found.normals_suspect
        placed = bring_mesh(shape, fresh, own_mesh)
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

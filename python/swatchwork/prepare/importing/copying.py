# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs, masks, meshes and probes put into the new capture folder."""

from __future__ import annotations

import os
import shutil
import warnings
from pathlib import Path

import numpy as np

from swatchwork.capture import EnvironmentSource, Frame, read_mask, write_exr, write_png
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.light import read_environment
from swatchwork.prepare.importing.found import Shot
from swatchwork.surface import buffers_of, mesh_from_arrays, write_mesh_obj
from swatchwork.surface.obj import read_obj


class Lights:
    """Environment maps copied into the capture, each file once."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._copies = folder, dict[Path, Path]()

    @property
    def count(self) -> int:
        """How many files."""
        return len(self._copies)

    def copied(self, light: EnvironmentSource, stem: str) -> EnvironmentSource:
        """The light from its copy, named ``stem`` where it is the file's first; InputError if unreadable."""
        source = light.file.resolve()
        if source not in self._copies:
            read_environment(light)
            target = self.folder / (stem + light.file.suffix.lower())
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
            self._copies[source] = target
        return EnvironmentSource(self._copies[source], light.convention, light.world_from_environment)


def bring_photograph(shot: Shot, folder: Path, light: EnvironmentSource | None, link: bool) -> Frame:
    """Copy, link or decode one photograph and its mask into the capture ``folder``.

    Raises:
        InputError: another has its name, it cannot be linked, or it cannot be decoded.
    """
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


def bring_mesh(source: Path, folder: Path, normals_suspect: bool) -> Path:
    """Copy the mesh, with the buffers of a glTF; suspect normals that are not the triangles' are made anew.

    Raises:
        InputError: it cannot be read, or names buffers outside its folder.
    """
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

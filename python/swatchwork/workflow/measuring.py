# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Measure folders of renders; with a capture's mesh, tell the rim from the rest."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike

import numpy as np

from ..arrays import F64
from ..capture import Camera, Frame, read_capture
from ..errors import InputError
from ..evaluate import Evaluation, compare
from ..progress import SILENT, Progress
from ..surface import Mesh, RayScene, read_mesh


def evaluate_folders(
    renders: str | PathLike[str],
    references: str | PathLike[str],
    *,
    rim: bool = False,
    progress: Progress = SILENT,
) -> Evaluation:
    """As :func:`evaluate.compare`; with ``rim``, ``references`` is a capture whose mesh gives n.o.

    Raises:
        InputError: as ``compare``, or the capture names no mesh.
    """
    cosines = None
    if rim:
        capture = read_capture(references)
        if capture.mesh_path is None:
            raise InputError("names no mesh", file=capture.file, expected='a "mesh", to tell the rim')
        cosines = cosine_maps(read_mesh(capture.mesh_path))
    return compare(renders, references, cosines=cosines, progress=progress)


def cosine_maps(mesh: Mesh) -> Callable[[Frame], F64]:
    """A function that gives the n.o [H, W] of a frame's pixel centres, NaN off the object."""
    scene = RayScene([mesh])

    def of(frame: Frame) -> F64:
        return cosine_map(mesh, scene, frame.camera)

    return of


def cosine_map(mesh: Mesh, scene: RayScene, camera: Camera) -> F64:
    """Cosine [H, W] between the shading normal and the direction to the camera, NaN off the object."""
    direction = camera.rays(camera.pixel_centres())
    origin = np.broadcast_to(camera.position, direction.shape)
    hit = scene.first_hit(origin, direction)
    on = hit.mesh == 0
    normal = np.einsum("pi,pic->pc", hit.bary[on], mesh.normals[mesh.faces[hit.face[on]]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    cosine = np.full(len(direction), np.nan)
    cosine[on] = -(normal * direction[on]).sum(axis=1)
    return cosine.reshape(camera.height, camera.width)

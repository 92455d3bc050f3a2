# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Measure folders of renders; with a capture's mesh, tell the rim from the rest."""

from __future__ import annotations

from os import PathLike

from ..capture import read_capture
from ..errors import InputError
from ..evaluate import Evaluation, compare
from ..progress import SILENT, Progress
from ..relight import cosine_map
from ..surface import RayScene, read_mesh


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
    if not rim:
        return compare(renders, references, progress=progress)
    capture = read_capture(references)
    if capture.mesh_path is None:
        raise InputError("names no mesh", file=capture.file, expected='a "mesh", to tell the rim')
    scene = RayScene([read_mesh(capture.mesh_path), *map(read_mesh, capture.occluder_paths)])
    return compare(
        renders, references, cosines=lambda frame: cosine_map(scene, frame.camera), progress=progress
    )

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Pairs of points on photographs and mesh, clicked by a person on a page, to pairs.json."""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from ..capture import read_json
from ..capture.images import image_size
from ..errors import CaptureWarning, InputError
from ..prepare.registering import Pairs, read_pairs
from ..progress import SILENT, Progress
from ..surface import RayScene, read_mesh
from .pairs_desk import Desk
from .pairs_server import PairsServer
from .preparing_calibrate import read_intrinsics


@dataclass(frozen=True)
class PairsSummary:
    """What was saved last."""

    output: str
    saved: bool
    """Whether the file was written; it is left alone otherwise."""
    pairs: dict[str, int]
    """How many each photograph has, by file name."""
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """A line for a person."""
        if not self.saved:
            return f"Nothing was saved; {self.output} is as it was"
        listed = ", ".join(f"{name} {count}" for name, count in self.pairs.items())
        return f"{sum(self.pairs.values())} pairs in {self.output} ({listed})"


def prepare_pairs(
    photographs: Sequence[str | PathLike[str]],
    output: str | PathLike[str],
    *,
    mesh: str | PathLike[str],
    intrinsics: str | PathLike[str],
    port: int = 0,
    ready: Callable[[str], None] = lambda url: None,
    progress: Progress = SILENT,
) -> PairsSummary:
    """Serve the page until Ctrl-C (KeyboardInterrupt), and say what was saved by then.

    Args:
        photographs: of the object, all with the lens of ``intrinsics``; their names must differ, whatever
            the endings.
        output: pairs.json; where it is there already, its pairs are gone on from.
        mesh: the object.
        intrinsics: JSON of ``prepare calibrate``.
        port: of 127.0.0.1; 0 finds a free one.
        ready: called with the page's address once it can be opened.

    Raises:
        InputError: a file that is wrong, each by name, before anything is served.
    """
    start = time.perf_counter()
    with progress.stage("Reading the mesh"):
        desk = open_desk(photographs, output, mesh, intrinsics)
    with PairsServer(desk, port) as server:
        try:
            ready(server.url)
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            pass
    saved = desk.saved or {}
    return PairsSummary(
        str(output),
        desk.saved is not None,
        {p.photograph: len(p) for p in saved.values()},
        time.perf_counter() - start,
    )


def open_desk(
    photographs: Sequence[str | PathLike[str]],
    output: str | PathLike[str],
    mesh: str | PathLike[str],
    intrinsics: str | PathLike[str],
) -> Desk:
    """All that the page needs, read and checked.

    Raises:
        InputError: as `prepare_pairs`.
    """
    files, file, mesh_file = [Path(p) for p in photographs], Path(output), Path(mesh)
    if file.suffix.lower() != ".json" or file.is_dir():
        raise InputError(f"the output is {file}", expected="a file ending in .json")
    if not files:
        raise InputError("no photograph is given", expected="one or more of the object")
    name, count = Counter(f.stem for f in files).most_common(1)[0]
    if count > 1:
        raise InputError(
            f"{count} photographs are called {name}",
            expected="names that differ without folder and ending, since pairs.json goes by these",
        )
    if not file.parent.is_dir():
        raise InputError(
            "the folder does not exist", file=file.parent, expected=f"one to write {file.name} in"
        )
    lens = read_intrinsics(intrinsics)
    for photograph in files:
        width, height = image_size(photograph)
        if (width, height) != (lens.width, lens.height):
            raise InputError(
                f"is {width} x {height} pixels",
                file=photograph,
                expected=f"{lens.width} x {lens.height}, as {intrinsics} says",
                hint="Calibrate with photographs of this size, or give those that the calibration is of",
            )
    pairs = _begun(file, mesh_file.name) if file.exists() else {}
    return Desk(RayScene([read_mesh(mesh_file)]), mesh_file.name, files, lens, file, pairs)


def _begun(file: Path, mesh_name: str) -> dict[str, Pairs]:
    pairs = read_pairs(file)
    written_for = read_json(file).get("mesh", mesh_name)
    if written_for != mesh_name:
        warnings.warn(
            CaptureWarning(
                f"{file}: its points are of {written_for}, and the mesh is {mesh_name}; "
                "are they the same, in the same coordinates?"
            ),
            stacklevel=3,
        )
    return pairs

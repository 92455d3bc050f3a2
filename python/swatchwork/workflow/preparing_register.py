# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs and a mesh to a capture whose cameras are in the mesh's world, with a page to check by eye."""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from ..capture import Capture, EnvironmentSource, Frame, read_photograph, write_capture
from ..errors import CaptureWarning, InputError
from ..light import read_environment
from ..prepare import Board
from ..prepare.importing.copying import Lights, bring_mesh, bring_photograph
from ..prepare.importing.found import Shot
from ..prepare.registering import Clues, Others, Registered, read_pairs, register
from ..progress import SILENT, Progress
from ..report import write_sheet
from ..surface import RayScene, write_mesh_obj
from ..whole import whole_folder
from .check_shapes import FrameShape, frame_shape
from .preparing_calibrate import read_intrinsics
from .register_inputs import object_of, photographs_to_register, read_views
from .register_page import register_sheet

FIGURES, PAGE = "register.json", "register.html"


@dataclass(frozen=True)
class RegisteredPhotograph:
    """One photograph's figures of merit; None where there is nothing to say it by."""

    name: str
    placed_by: str
    """ "pairs", "board", "outline" (of a sphere), "silhouette", "features" or "structure from motion"."""
    board_px: float | None
    """rms distance of the board's corners from where its pose has them."""
    pairs_px: float | None
    """rms distance of the clicked pairs that agree."""
    pairs_left_out: tuple[int, ...]
    """Numbers of those that do not, counted from 1."""
    features: int
    """Points that it shares with other photographs."""
    features_px: float | None
    """rms distance of their sightings from the mesh's points."""
    iou: float | None
    """Intersection over union of mask and mesh."""
    degrees: float | None
    """Standard deviation of its direction."""
    share: float | None
    """Standard deviation of its place, over the distance to the object."""


@dataclass(frozen=True)
class RegisterSummary:
    """What was placed, and how well; but for ``capture`` and ``page`` the contents of register.json."""

    capture: str
    page: str
    photographs: tuple[RegisteredPhotograph, ...]
    missing: dict[str, str]
    """Why each of the others could not be placed."""
    suspicions: tuple[str, ...]
    status: str
    """Of the joint refinement."""
    lit: bool
    """Whether the capture has its light."""
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """Lines for a person."""
        count = len(self.photographs)
        text = f"{count} of {count + len(self.missing)} photographs placed in {self.capture}"
        rms = [p.features_px for p in self.photographs if p.features_px is not None]
        if rms:
            text += f"; points shared by photographs within {max(rms):.2f} px rms"
        clicked = [p for p in self.photographs if p.pairs_px is not None]
        if clicked:
            text += f", clicked pairs within {max(p.pairs_px or 0 for p in clicked):.1f} px"
        boards = [p.board_px for p in self.photographs if p.board_px is not None]
        if boards:
            text += f", the board's corners within {max(boards):.2f} px"
        ious = [p.iou for p in self.photographs if p.iou is not None]
        if ious:
            text += f"; silhouettes' intersection over union at least {min(ious):.3f}"
        lines = [text]
        lines += [f"{name} could not be placed: {why}" for name, why in self.missing.items()]
        lines.append(f"{self.page} shows it ({self.seconds:.0f} s)")
        if self.lit:
            lines.append(f"next: swatchwork check {self.capture}")
        else:
            first = self.photographs[0].name
            lines.append(
                f"next: swatchwork prepare probe BALL... --pose {self.capture}/transforms.json#{first} "
                f"--capture {self.capture} -o probe"
            )
        return "\n".join(lines)


def register_photographs(
    photographs: Sequence[str | PathLike[str]],
    output: str | PathLike[str],
    *,
    intrinsics: str | PathLike[str],
    mesh: str | PathLike[str] | None = None,
    sphere: float | None = None,
    board: Board | None = None,
    square: float | None = None,
    pairs: str | PathLike[str] | None = None,
    masks: str | PathLike[str] | None = None,
    others: Others = "features",
    scan_error: float = 0.0,
    environment: EnvironmentSource | None = None,
    link: bool = False,
    progress: Progress = SILENT,
) -> RegisterSummary:
    """Write a capture folder of photographs, mesh and, where it is known, the light.

    Args:
        photographs: images of one size, or folders of them.
        output: the capture folder; new or empty.
        mesh: the object; its coordinates are the capture's world.
        sphere: radius of the object instead of a mesh; one is made about the world's origin.
        board: a board in the photographs, fixed to the object; ``square`` is the side of its squares.
        intrinsics: JSON of ``prepare calibrate``, of all photographs.
        pairs: JSON of ``prepare pairs``.
        masks: folder of masks, NAME.png or STEM.png for each photograph.
        others: how photographs without pairs are placed.
        scan_error: standard deviation of the scan along its normal, in its unit.
        environment: light probe in the mesh's world; it may be added later.
        link: hard links to the photographs instead of copies.

    Raises:
        InputError: a file or number is missing or wrong, the pairs fit no pose, or the output holds
            something.
        OutputError: the output cannot be written; nothing of it is left.
    """
    start = time.perf_counter()
    folder = Path(output)
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise InputError("exists already", file=folder, expected="a new folder, or an empty one")
    if not (math.isfinite(scan_error) and scan_error >= 0):
        raise InputError(f"--scan-error is {scan_error:g}", expected="a finite length, 0 or more")
    lens = read_intrinsics(intrinsics)
    if environment is not None:
        read_environment(environment)
    files = photographs_to_register([Path(place) for place in photographs])
    if board is not None and square is None:
        raise InputError("a board is given without the size of its squares", expected="--square LENGTH too")
    if board is None and square is not None:
        raise InputError("--square is the size of a board's squares", expected="--board or --charuco too")
    clicked = read_pairs(Path(pairs)) if pairs is not None else {}
    clues = Clues(clicked, board, square or 0.0, sphere)
    thing = object_of(mesh, sphere)
    scene = RayScene([thing])
    views, mask_files = read_views(files, lens, Path(masks) if masks is not None else None, progress)
    found = register(
        scene, list(views.values()), clues, others=others, scan_error=scan_error, progress=progress
    )
    for words in found.suspicions:
        warnings.warn(CaptureWarning(words), stacklevel=2)
    with whole_folder(folder, lambda _: False, "empty") as fresh:
        light = Lights(fresh).copied(environment, "env") if environment is not None else None
        frames, shapes = [], []
        with progress.stage("Writing the capture", len(found.frames)) as task:
            for name, fit in found.frames.items():
                file = views[name].file
                shot = Shot(file.name, file, fit.camera, mask_files.get(name))
                frames.append(bring_photograph(shot, fresh, light, link))
                shapes.append(_shape(frames[-1], scene))
                task.advance()
        if mesh is not None:
            placed = bring_mesh(Path(mesh), fresh, False)
        else:
            placed = fresh / "mesh.obj"
            write_mesh_obj(placed, thing)
        write_capture(Capture(fresh, fresh / "transforms.json", placed, (), light, tuple(frames)), fresh)
        summary = _summary(folder, found, light is not None, time.perf_counter() - start)
        # Folders may be moved, and other machines have others.
        figures = {k: v for k, v in summary.as_dict().items() if k not in ("capture", "page")}
        text = json.dumps(figures, indent=1, allow_nan=False)
        (fresh / FIGURES).write_text(text + "\n", encoding="utf-8")
        write_sheet(fresh / PAGE, register_sheet(summary, shapes, found.missing, clicked))
    return summary


def _shape(frame: Frame, scene: RayScene) -> FrameShape:
    return frame_shape(frame, read_photograph(frame), scene)


def _summary(folder: Path, found: Registered, lit: bool, seconds: float) -> RegisterSummary:
    photographs = tuple(
        RegisteredPhotograph(
            name,
            fit.placed_by,
            fit.board_px,
            fit.pairs_px,
            tuple(i + 1 for i in fit.pairs_out),
            fit.features,
            fit.features_px,
            fit.iou,
            fit.degrees,
            fit.share,
        )
        for name, fit in found.frames.items()
    )
    return RegisterSummary(
        str(folder),
        str(folder / PAGE),
        photographs,
        found.missing,
        found.suspicions,
        found.status,
        lit,
        seconds,
    )

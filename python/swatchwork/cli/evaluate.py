# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""``swatchwork evaluate``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from .console import plain, session
from .options import AsJson, Quiet, Verbose

if TYPE_CHECKING:
    from ..evaluate import Evaluation, FrameEvaluation


def evaluate(
    renders: Annotated[Path, typer.Argument(help="Folder of renders: linear, RGB premultiplied by alpha.")],
    references: Annotated[
        Path, typer.Argument(help="Reference images of the same names, or a capture with its photographs.")
    ],
    *,
    capture: Annotated[
        bool,
        typer.Option(
            "--capture",
            help="REFERENCES is a capture with a mesh: tell the rim (n.o below 0.2) from the rest.",
        ),
    ] = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Measure renders against references: NRMS, PSNR-H, PSNR-L and SSIM, per frame and overall.

    NRMS is pooled over frames, on linear radiance where the reference's alpha is above 0.5. The others are
    means over frames: PSNR in dB, high (HDR) and low (sRGB) dynamic range, after a factor a channel.

    Examples:

    swatchwork evaluate renders my-capture/test

    swatchwork evaluate renders my-capture/test --capture --json
    """
    from ..workflow import evaluate_folders

    with session(as_json=as_json, quiet=quiet, verbose=verbose) as run:
        found = evaluate_folders(renders, references, rim=capture, progress=run.progress)
        run.show(_table(found))
        run.result(found.as_dict())


def _table(found: Evaluation) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("frame")
    rim = found.nrms_inner is not None
    names = ["NRMS %", *(["inner %", "rim %"] if rim else []), "PSNR-H dB", "PSNR-L dB", "SSIM"]
    for name in names:
        table.add_column(name, justify="right")
    rows: list[tuple[str, Evaluation | FrameEvaluation]] = [(frame.name, frame) for frame in found.frames]
    for name, frame in (*rows, ("overall", found)):
        split = [_percent(x) for x in (frame.nrms_inner, frame.nrms_rim)] if rim else []
        cells = [
            _percent(frame.nrms),
            *split,
            _number(frame.psnr_h, 2),
            _number(frame.psnr_l, 2),
            _number(frame.ssim, 4),
        ]
        if frame is found:
            table.add_section()
        table.add_row(Text(plain(name)), *cells, style="bold" if frame is found else None)
    return table


def _percent(x: float | None) -> str:
    return _number(None if x is None else 100 * x, 2)


def _number(x: float | None, digits: int) -> str:
    """A dash for what was not measured: a frame without rim, a foreground too thin to erode."""
    return "-" if x is None or math.isnan(x) else f"{x:.{digits}f}"

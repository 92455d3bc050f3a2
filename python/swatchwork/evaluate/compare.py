# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Compare a folder of renders with its references, frame by frame and pooled."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import F32, Bool, Float
from ..capture import IMAGE_SUFFIXES, Frame, read_capture, read_image, read_photograph
from ..errors import InputError
from ..progress import SILENT, Progress
from .metrics import SquaredError, psnr_hdr, psnr_ldr, squared_error, ssim

RIM_COSINE = 0.2
"""n.o at and below which a pixel belongs to the rim."""

Cosines = Callable[[Frame], Float | None]
"""The map of n.o [H, W] that a frame's camera sees (nan or <= 0 off the object)."""


@dataclass(frozen=True)
class FrameEvaluation:
    """Measures of one frame; the rim pair is None where no n.o map was given."""

    name: str
    nrms: float
    psnr_h: float
    psnr_l: float
    ssim: float
    ssim_11: float
    pixels: int
    nrms_inner: float | None = None
    nrms_rim: float | None = None


@dataclass(frozen=True)
class Evaluation:
    """Measures of a whole set.

    NRMS values are pooled: the sums run over all frames before the division. PSNR-H, PSNR-L and SSIM
    are means over the frames whose foreground survives the erosion (nan in the others). ``ssim`` has
    Stanford-ORB's 3 x 3 window, ``ssim_11`` the usual 11 x 11.
    ``rim_share`` is the part of the summed squared error that lies at n.o <= 0.2.
    """

    frames: tuple[FrameEvaluation, ...]
    nrms: float
    psnr_h: float
    psnr_l: float
    ssim: float
    ssim_11: float
    pixels: int
    nrms_inner: float | None = None
    nrms_rim: float | None = None
    rim_share: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; what is not finite (a perfect PSNR, an empty region) becomes None."""
        found = asdict(self)
        found["frames"] = [_finite(frame) for frame in found["frames"]]
        return _finite(found)


def compare(
    renders: str | PathLike[str],
    references: str | PathLike[str],
    *,
    cosines: Cosines | None = None,
    progress: Progress = SILENT,
) -> Evaluation:
    """Measure renders against references of the same file names.

    Args:
        renders: folder of linear images, RGB premultiplied by alpha.
        references: folder of images, or a capture (a transforms.json or a folder with one); its
            exposure is divided out, and its missing pixels (clipped, masked) are left out.
        cosines: gives a frame's n.o map; with it the errors of rim and inner pixels are told apart.
            Only for references that are a capture.

    Raises:
        InputError: no reference, a render missing, sizes that disagree, a render that is not finite,
            a reference without a foreground pixel.
    """
    renders, references = Path(renders), Path(references)
    if not renders.is_dir():
        raise InputError("no such folder", file=renders, expected="a folder of renders")
    if cosines is not None and not _is_capture(references):
        raise InputError(
            "has no cameras, so the rim cannot be told apart",
            file=references,
            expected="a transforms.json",
        )
    frames, sums, inner, rim = [], [], [], []
    with progress.stage("evaluate") as task:
        for name, b, foreground, frame in _references(references):
            path = _render_of(renders, name)
            a = _checked_render(path, b.shape, name)
            if not foreground.any():
                raise InputError(
                    f"the reference {name} has no pixel to compare: all are transparent, masked or clipped",
                    file=references,
                    expected="a foreground in every reference",
                    hint="Leave this frame out of the references",
                )
            sums.append(squared_error(a, b, foreground))
            split = None
            if cosines is not None and frame is not None and (cosine := cosines(frame)) is not None:
                facing = np.nan_to_num(np.asarray(cosine), nan=0.0) > RIM_COSINE
                split = squared_error(a, b, foreground & facing), squared_error(a, b, foreground & ~facing)
                inner.append(split[0])
                rim.append(split[1])
            frames.append(
                FrameEvaluation(
                    name,
                    sums[-1].nrms,
                    psnr_hdr(a, b, foreground),
                    psnr_ldr(a, b, foreground),
                    ssim(a, b, foreground, 3),
                    ssim(a, b, foreground),
                    sums[-1].pixels,
                    *((split[0].nrms, split[1].nrms) if split else ()),
                )
            )
            task.advance()
    return _pooled(frames, sums, inner, rim)


def _pooled(
    frames: list[FrameEvaluation],
    sums: list[SquaredError],
    inner: list[SquaredError],
    rim: list[SquaredError],
) -> Evaluation:
    nothing = SquaredError(0.0, 0.0, 0)
    total = sum(sums, nothing)
    inside, edge = sum(inner, nothing), sum(rim, nothing)
    whole = inside.difference + edge.difference

    def mean(key: str) -> float:
        values = np.array([getattr(frame, key) for frame in frames])
        measured = values[~np.isnan(values)]
        return float(measured.mean()) if len(measured) else float("nan")

    return Evaluation(
        frames=tuple(frames),
        nrms=total.nrms,
        psnr_h=mean("psnr_h"),
        psnr_l=mean("psnr_l"),
        ssim=mean("ssim"),
        ssim_11=mean("ssim_11"),
        pixels=total.pixels,
        nrms_inner=inside.nrms if inner else None,
        nrms_rim=edge.nrms if inner else None,
        rim_share=(edge.difference / whole if whole > 0 else 0.0) if inner else None,
    )


def _is_capture(references: Path) -> bool:
    return references.suffix == ".json" or (references / "transforms.json").is_file()


def _references(references: Path) -> Iterator[tuple[str, F32, Bool, Frame | None]]:
    """Each reference's name, linear image, foreground (A > 0.5 and measured) and frame, if it has one."""
    if _is_capture(references):
        for frame in read_capture(references).frames:
            photograph = read_photograph(frame)
            yield frame.name, photograph.radiance, (photograph.alpha > 0.5) & photograph.valid, frame
        return
    if not references.is_dir():
        raise InputError("no such folder or file", file=references, expected="references to compare with")
    found = sorted(p for p in references.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES)
    # A preview may lie beside an EXR: the more exact kind of each name counts.
    found.sort(key=lambda p: IMAGE_SUFFIXES.index(p.suffix.lower()))
    paths = sorted({p.stem: p for p in reversed(found)}.values())
    if not paths:
        raise InputError(
            "holds no image", file=references, expected=f"files named *{', *'.join(IMAGE_SUFFIXES)}"
        )
    for path in paths:
        image = read_image(path)
        foreground = ~image.clipped if image.alpha is None else (image.alpha > 0.5) & ~image.clipped
        yield path.name, image.linear, foreground, None


def _render_of(renders: Path, name: str) -> Path:
    """The render of the frame ``name``: by its relative path if there is one, else by its file name."""
    tried = []
    # A frame's name may lack a suffix, as NeRF-Blender's do: cut only what is one.
    bare = Path(name).with_suffix("") if Path(name).suffix.lower() in IMAGE_SUFFIXES else Path(name)
    for stem in dict.fromkeys((bare, Path(bare.name))):
        for suffix in IMAGE_SUFFIXES:
            path = renders / stem.with_name(stem.name + suffix)
            if path.is_file():
                return path
        tried.append(str(stem))
    raise InputError(
        f"no render of the reference {name}",
        file=renders,
        expected=f"a file {' or '.join(tried)} with one of {', '.join(IMAGE_SUFFIXES)}",
        hint="Renders are paired with references by file name",
    )


def _checked_render(path: Path, shape: tuple[int, ...], name: str) -> F32:
    a = read_image(path).linear
    if a.shape != shape:
        raise InputError(
            f"is {a.shape[1]} x {a.shape[0]} pixels",
            file=path,
            expected=f"{shape[1]} x {shape[0]} as its reference {name}",
        )
    if not np.isfinite(a).all():
        raise InputError("holds NaN or infinite values", file=path, expected="finite radiance")
    return a


def _finite(found: dict[str, Any]) -> dict[str, Any]:
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in found.items()
    }

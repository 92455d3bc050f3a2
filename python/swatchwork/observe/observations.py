# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From photographs to measurements: which radiance each texel shows to each view (s_hat, section 3)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swatchwork.arrays import F32, I32, I64, unit
from swatchwork.capture import Capture, Frame, Photograph, read_photograph
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.observe.pixels import PixelMap, pixel_map
from swatchwork.observe.sample import sample
from swatchwork.progress import SILENT, Progress
from swatchwork.surface import Atlas, RayScene, sees

# Intersection over union of mask and mesh silhouette; below it pose, scale or mesh are likely wrong.
SILHOUETTE_AGREEMENT = 0.9


@dataclass(frozen=True)
class Observations:
    """P visible (texel, view) pairs, ordered by texel, then frame; what is missing is not in the list.

    The pairs of texel x are ``offsets[x]:offsets[x + 1]``, I64[M + 1]. ``texel``, ``frame`` I32[P];
    ``radiance`` F32[P, 3], not premultiplied; ``to_viewer`` F32[P, 3], unit, world; ``cosine`` F32[P],
    shading normal with viewer; ``coverage`` I32[M], views of each texel.
    """

    atlas: Atlas
    offsets: I64
    texel: I32
    frame: I32
    radiance: F32
    to_viewer: F32
    cosine: F32
    coverage: I32

    def __len__(self) -> int:
        return len(self.texel)


def observe(
    capture: Capture,
    atlas: Atlas,
    scene: RayScene,
    *,
    read: Callable[[Frame], Photograph] = read_photograph,
    progress: Progress = SILENT,
) -> Observations:
    """Sample every photograph at the texels it shows.

    Args:
        capture: its frames; nothing else of it is read.
        atlas: of the mesh that comes first in ``scene``.
        scene: the object and its occluders.
        read: how a frame becomes a photograph (synthetic captures pass their own).

    Raises:
        InputError: a frame shows no texel, or there are no frames. Texels that no frame shows have
            ``coverage`` 0, which is no error.

    Warns:
        CaptureWarning: a mask or alpha channel that disagrees with the mesh's silhouette.
    """
    if not capture.frames:
        raise InputError("there are no frames", file=capture.file, expected="at least one photograph")
    texels: list[I64] = []
    radiances: list[F32] = []
    with progress.stage("Observing", len(capture.frames)) as task:
        for frame in capture.frames:
            task.describe(frame.name)
            photograph = read(frame)
            pixels = pixel_map(scene, frame.camera)
            texel = np.flatnonzero(sees(scene, atlas, frame.camera))
            radiance, kept = sample(atlas, texel, frame.camera, pixels, photograph)
            if not kept.any():
                raise _nothing_seen(capture, frame, len(texel))
            _check_silhouette(capture, frame, photograph, pixels)
            texels.append(texel[kept])
            radiances.append(radiance[kept])
            task.advance()
    return _gathered(capture, atlas, texels, radiances)


def _gathered(capture: Capture, atlas: Atlas, texels: list[I64], radiances: list[F32]) -> Observations:
    texel = np.concatenate(texels)
    frame = np.repeat(np.arange(len(texels)), [len(part) for part in texels])
    order = np.argsort(texel, kind="stable")
    texel, frame = texel[order], frame[order]
    coverage = np.bincount(texel, minlength=len(atlas))
    position = np.stack([f.camera.position for f in capture.frames])
    to_viewer = unit(position[frame] - atlas.position[texel])
    return Observations(
        atlas=atlas,
        offsets=np.concatenate([[0], np.cumsum(coverage)]).astype(np.int64),
        texel=texel.astype(np.int32),
        frame=frame.astype(np.int32),
        radiance=np.concatenate(radiances)[order],
        to_viewer=to_viewer.astype(np.float32),
        cosine=(to_viewer * atlas.normal[texel]).sum(axis=1).astype(np.float32),
        coverage=coverage.astype(np.int32),
    )


def _check_silhouette(capture: Capture, frame: Frame, photograph: Photograph, pixels: PixelMap) -> None:
    if (photograph.alpha < 1).any():
        shown = photograph.alpha.ravel() > 0.5
    elif photograph.mask is not None:
        # Not `valid`: clipped highlights lie on the object all the same.
        shown = photograph.mask.ravel()
    else:
        return
    # Whether a mask includes the occluders is the photographer's choice.
    compared = ~pixels.blocked
    union = ((shown | pixels.centre) & compared).sum()
    overlap = (shown & pixels.centre & compared).sum() / max(union, 1)
    if overlap < SILHOUETTE_AGREEMENT:
        message = (
            f"{capture.file}: frame {frame.name}: its mask and the mesh's silhouette overlap by "
            f"{overlap:.2f} (intersection over union); expected at least {SILHOUETTE_AGREEMENT}. "
            "Check pose, scale and mesh."
        )
        warnings.warn(CaptureWarning(message), stacklevel=3)


def _nothing_seen(capture: Capture, frame: Frame, facing: int) -> InputError:
    found = "no texel is visible" if not facing else f"none of {facing} visible texels lies on valid pixels"
    return InputError(
        f"frame {frame.name}: {found}",
        file=capture.file,
        expected="the object inside the image, unmasked and unclipped",
        hint="Check its transform_matrix (OpenGL axes: x right, y up, looking along -z) and its mask.",
    )

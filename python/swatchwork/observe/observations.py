# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From photographs to measurements: which radiance each texel shows to each view (s_hat, section 3)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from swatchwork.arrays import F32, F64, I32, I64, U16, Bool, dot, unit
from swatchwork.capture import Capture, Frame, Photograph, read_photograph
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.keeping import IN_MEMORY, Array, Keeper, Kept
from swatchwork.observe.noise import NoiseModel, fitted_noise, noise_levels
from swatchwork.observe.pixels import PixelMap, pixel_map
from swatchwork.observe.sample import sample
from swatchwork.observe.small import SmallPicture
from swatchwork.progress import SILENT, Progress
from swatchwork.surface import Atlas, RayScene, sees

# Intersection over union of mask and mesh silhouette; below it pose, scale or mesh are likely wrong.
SILHOUETTE_AGREEMENT = 0.9


BLOCK = 1024
"""Texels between the places that are remembered in a frame's samples."""
SURVEYED = 1 << 20
"""Samples, at most, that the typical energy is the median of."""


@dataclass(frozen=True)
class SeenPairs:
    """The P visible (texel, view) pairs of some texels, ordered by texel, then frame.

    ``texels`` I64[T]; those of texel t are ``offsets[t]:offsets[t + 1]``, I64[T + 1]. ``texel`` I64[P] in the
    atlas; ``frame`` I32[P]; ``radiance`` F32[P, 3], not premultiplied; ``normal``, of shading, and
    ``to_viewer`` F32[P, 3], unit, world; ``cosine`` F32[P] between the two.
    """

    texels: I64
    offsets: I64
    texel: I64
    frame: I32
    radiance: F32
    normal: F32
    to_viewer: F32
    cosine: F32

    def __len__(self) -> int:
        return len(self.texel)


@dataclass(frozen=True)
class Observations:
    """What each frame shows of each texel. Samples stay where the keeper put them, frame by frame.

    ``viewer`` F64[k, 3], camera positions; ``samples``, a frame each: ``texel`` I32[S], rising, and
    ``radiance`` F32[S, 3]; ``coverage`` U16[M], views of each texel; ``starts`` I64[k, blocks + 1], where
    each block of texels begins in each frame's samples.
    """

    atlas: Atlas
    viewer: F64
    samples: tuple[Kept, ...]
    coverage: U16
    starts: I64
    noise: NoiseModel | None = None
    """Of the photographs, given or estimated; None where they are too small or too busy to tell."""

    def __len__(self) -> int:
        return int(self.starts[:, -1].sum())

    def corrected(self, scale: F64, left_out: Bool) -> Observations:
        """The observations with each frame's radiance over its ``scale`` [k], those ``left_out`` [k] empty.

        Frames keep their numbers.

        Raises:
            InputError: no frame is left.
        """
        if left_out.all():
            raise InputError("all photographs are left out", expected="at least one that counts")
        samples = tuple(
            kept if factor == 1 and not out else _Corrected(kept, float(factor), bool(out))
            for kept, factor, out in zip(self.samples, scale, left_out, strict=True)
        )
        coverage = self.coverage.copy()
        for kept in (kept for kept, out in zip(self.samples, left_out, strict=True) if out):
            coverage[kept.rows("texel")] -= 1
        starts = np.where(left_out[:, None], 0, self.starts)
        return Observations(self.atlas, self.viewer, samples, coverage, starts, self.noise)

    @property
    def seen(self) -> I32:
        """Texels that some view sees."""
        return np.flatnonzero(self.coverage).astype(np.int32)

    def pairs(self, texels: I64) -> SeenPairs:
        """The pairs of ``texels`` [T], which must rise."""
        low, high = (int(texels[0]), int(texels[-1]) + 1) if len(texels) else (0, 0)
        place = np.full(high - low, -1, dtype=np.int64)
        place[texels - low] = np.arange(len(texels))
        first, last = low // BLOCK, -(-high // BLOCK)
        places, frames, radiances = (
            [np.zeros(0, np.int64)],
            [np.zeros(0, np.int32)],
            [np.zeros((0, 3), np.float32)],
        )
        for frame, (kept, starts) in enumerate(zip(self.samples, self.starts, strict=True)):
            begin, end = int(starts[first]), int(starts[last])
            texel = kept.rows("texel", begin, end)
            inside = np.flatnonzero((texel >= low) & (texel < high))
            at = place[texel[inside] - low]
            wanted = at >= 0
            places.append(at[wanted])
            frames.append(np.full(len(places[-1]), frame, dtype=np.int32))
            radiances.append(kept.rows("radiance", begin, end)[inside[wanted]])
        at = np.concatenate(places)
        order = np.argsort(at, kind="stable")
        at, frame_of = at[order], np.concatenate(frames)[order]
        position, normal = (of_texel[at] for of_texel in self.atlas.points(texels))
        to_viewer = unit(self.viewer[frame_of] - position)
        return SeenPairs(
            texels=texels,
            offsets=np.concatenate([[0], np.cumsum(np.bincount(at, minlength=len(texels)))]).astype(np.int64),
            texel=texels[at],
            frame=frame_of,
            radiance=np.concatenate(radiances)[order],
            normal=normal,
            to_viewer=to_viewer.astype(np.float32),
            cosine=dot(to_viewer, normal).astype(np.float32),
        )

    @cached_property
    def typical(self) -> float:
        """Median of |radiance|^2 over (an even share of) all pairs."""
        stride = -(-len(self) // SURVEYED)
        energy = [
            (kept.rows("radiance")[::stride].astype(np.float64) ** 2).sum(axis=1) for kept in self.samples
        ]
        return max(float(np.median(np.concatenate(energy))), 1e-30)


@dataclass(frozen=True)
class _Corrected:
    """A frame's samples over a scale, or none of them."""

    kept: Kept
    scale: float
    left_out: bool

    def rows(self, name: str, first: int = 0, last: int | None = None) -> Array:
        if self.left_out:
            first, last = 0, 0
        rows = self.kept.rows(name, first, last)
        return rows / np.float32(self.scale) if name == "radiance" else rows


def observe(
    capture: Capture,
    atlas: Atlas,
    scene: RayScene,
    *,
    read: Callable[[Frame], Photograph] = read_photograph,
    progress: Progress = SILENT,
    keeper: Keeper = IN_MEMORY,
    noise: NoiseModel | None = None,
) -> Observations:
    """Sample every photograph at the texels it shows.

    Args:
        capture: its frames; nothing else of it is read.
        atlas: of the mesh that comes first in ``scene``.
        scene: the object and its occluders.
        read: how a frame becomes a photograph (synthetic captures pass their own).
        keeper: where samples are kept, by frame.
        noise: of the photographs; estimated from them by default.

    Raises:
        InputError: a frame shows no texel, or there are no frames. Texels that no frame shows have
            ``coverage`` 0, which is no error.

    Warns:
        CaptureWarning: a mask or alpha channel that disagrees with the mesh's silhouette.
    """
    if not capture.frames:
        raise InputError("there are no frames", file=capture.file, expected="at least one photograph")
    samples = []
    with progress.stage("Observing", len(capture.frames)) as task:
        for number, frame in enumerate(capture.frames):
            task.describe(frame.name)
            make = partial(_sampled, capture, frame, atlas, scene, read)
            kept = keeper.kept(f"observe-{number:04d}", make)
            _check_silhouette(capture, frame, float(kept.rows("overlap")[0]))
            samples.append(kept)
            task.advance()
    coverage = np.zeros(len(atlas), dtype=np.uint16)
    edges = np.arange(0, len(atlas) + BLOCK, BLOCK)
    starts = np.zeros((len(samples), len(edges)), dtype=np.int64)
    for kept, start in zip(samples, starts, strict=True):
        texel = kept.rows("texel")
        coverage[texel] += 1
        start[:] = np.searchsorted(texel, edges)
    viewer = np.stack([frame.camera.position for frame in capture.frames])
    noise = noise or fitted_noise([kept.rows("noise") for kept in samples])
    return Observations(atlas, viewer, tuple(samples), coverage, starts, noise)


def _sampled(
    capture: Capture, frame: Frame, atlas: Atlas, scene: RayScene, read: Callable[[Frame], Photograph]
) -> dict[str, Array]:
    """A frame's ``texel`` I32[S], ``radiance`` F32[S, 3], its silhouette's overlap with the mesh's, noise."""
    photograph = read(frame)
    pixels = pixel_map(scene, frame.camera)
    texel = np.flatnonzero(sees(scene, atlas, frame.camera))
    radiance, kept = sample(atlas, texel, frame.camera, pixels, photograph)
    if not kept.any():
        raise _nothing_seen(capture, frame, len(texel))
    overlap = np.array([_overlap(photograph, pixels)])
    small = SmallPicture.of(photograph, frame.camera, pixels, scene.meshes[0].vertices)
    found: dict[str, Array] = {"texel": texel[kept].astype(np.int32), "radiance": radiance[kept]}
    return found | {"overlap": overlap, "noise": noise_levels(photograph)} | small.arrays()


def _overlap(photograph: Photograph, pixels: PixelMap) -> float:
    """Intersection over union of mask (or alpha) and the mesh's silhouette; NaN where there is no mask."""
    if (photograph.alpha < 1).any():
        shown = photograph.alpha.ravel() > 0.5
    elif photograph.mask is not None:
        # Not `valid`: clipped highlights lie on the object all the same.
        shown = photograph.mask.ravel()
    else:
        return float("nan")
    # Whether a mask includes the occluders is the photographer's choice.
    compared = ~pixels.blocked
    union = ((shown | pixels.centre) & compared).sum()
    return float((shown & pixels.centre & compared).sum() / max(union, 1))


def _check_silhouette(capture: Capture, frame: Frame, overlap: float) -> None:
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

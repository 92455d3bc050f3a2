# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Spoil photographs by what no material explains: blobs of another colour, and bright spikes.

Blobs stand for hands, labels, flies, reflections of the photographer; spikes for hot pixels and sparkle.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ..arrays import F32, Bool
from ..capture import read_capture, read_exr_channels, write_exr

SPIKES = 0.25
"""Share of the outliers that are spikes."""
SPIKE = 10.0
"""A spike's brightness, over the object's own at its typical pixel."""
BLOB_RADIUS = (0.02, 0.08)
"""Of blobs, in the image's longer side."""
BLOB_BRIGHTNESS = (0.5, 2.0)
"""Of blobs, over the object's typical pixel."""


def spoiled(image: F32, share: float = 0.2, seed: int = 0) -> tuple[F32, Bool]:
    """A photograph with a share of its object's pixels replaced by outliers.

    Args:
        image: [H, W, 4], RGB premultiplied by alpha; alpha stays.
        share: of the pixels with alpha above 0.

    Returns:
        The image, and which pixels were replaced [H, W].

    Raises:
        ValueError: a share outside [0, 1), or an image without an object.
    """
    on = image[..., 3] > 0
    if not 0 <= share < 1:
        raise ValueError(f"share is {share!r}; expected at least 0 and below 1")
    if not on.any():
        raise ValueError("the image shows no object: alpha is 0 everywhere; expected some pixels above 0")
    rng = np.random.default_rng([seed, 6])
    out, replaced = image.copy(), np.zeros(on.shape, dtype=bool)
    typical = float(np.median(image[on][:, :3].mean(axis=1) / image[on][:, 3]))
    rows, columns = np.indices(on.shape)
    places = np.argwhere(on)
    blobs, all_of_them = round(share * (1 - SPIKES) * len(places)), round(share * len(places))
    while replaced.sum() < blobs:
        row, column = places[rng.integers(len(places))]
        radius = rng.uniform(*BLOB_RADIUS) * max(on.shape)
        colour = rng.dirichlet([0.5, 0.5, 0.5]) * 3 * typical * rng.uniform(*BLOB_BRIGHTNESS)
        new = ((rows - row) ** 2 + (columns - column) ** 2 <= radius**2) & on & ~replaced
        # The last blob is cut to size, so that the share is what was asked for.
        new = _first(new, blobs - int(replaced.sum()))
        out[new, :3] = colour * image[new, 3:]
        replaced |= new
    free = np.argwhere(on & ~replaced)
    spikes = tuple(free[rng.choice(len(free), all_of_them - int(replaced.sum()), replace=False)].T)
    white = SPIKE * typical * rng.uniform(0.5, 1.5, size=(len(spikes[0]), 1))
    out[*spikes, :3] = white * image[*spikes, 3:]
    replaced[spikes] = True
    return out.astype(np.float32), replaced


def spoil_capture(folder: str | PathLike[str], share: float = 0.2, seed: int = 0) -> tuple[Bool, ...]:
    """Spoil a capture's photographs (EXR files with alpha) in place; which pixels [H, W] of each frame."""
    masks = []
    for number, frame in enumerate(read_capture(Path(folder)).frames):
        channels = read_exr_channels(frame.image_path)
        image = np.stack([channels[name] for name in "RGBA"], axis=-1)
        image, replaced = spoiled(image, share, seed * 1000 + number)
        write_exr(frame.image_path, image)
        masks.append(replaced)
    return tuple(masks)


def _first(mask: Bool, count: int) -> Bool:
    """The first ``count`` pixels of a mask, row by row."""
    kept = np.zeros(mask.size, dtype=bool)
    kept[np.flatnonzero(mask)[:count]] = True
    return kept.reshape(mask.shape)

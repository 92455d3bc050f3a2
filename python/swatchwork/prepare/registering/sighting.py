# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What posed photographs see of tracks, and where on the mesh the tracks are to begin with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swatchwork.arrays import F64, I64, Bool, unit
from swatchwork.capture import Camera
from swatchwork.prepare.registering.lifting import finite, lifted
from swatchwork.prepare.registering.tracks import Tracks, coarseness
from swatchwork.surface import RayScene


@dataclass(frozen=True, eq=False)
class Sightings:
    """Sightings of the tracks that two or more of some frames see, sorted by track.

    Attributes:
        number: I64[O], of the tracks' own sightings.
        track: I64[O], 0 to T - 1; ``track_number`` I64[T], which of all tracks that is.
        frame: I64[O], of the k frames asked for.
        uv_px: F64[O, 2]; ``deviation_px`` F64[O], standard deviations along each axis.
        frames: k.
    """

    number: I64
    track: I64
    track_number: I64
    frame: I64
    uv_px: F64
    deviation_px: F64
    frames: int

    @classmethod
    def of(cls, tracks: Tracks, names: Sequence[str], least: int = 2) -> Sightings:
        """The sightings in the frames ``names``, of tracks with at least ``least`` of them."""
        place = {name: i for i, name in enumerate(names)}
        renumbered = np.array([place.get(name, -1) for name in tracks.names], dtype=np.int64)
        frame = renumbered[tracks.frame] if len(tracks.names) else np.zeros(0, np.int64)
        count = np.bincount(tracks.track[frame >= 0], minlength=tracks.count)
        number = np.flatnonzero((frame >= 0) & (count[tracks.track] >= least))
        track_number, track = np.unique(tracks.track[number], return_inverse=True)
        return cls(
            number,
            track.astype(np.int64),
            track_number.astype(np.int64),
            frame[number],
            tracks.uv_px[number],
            tracks.deviation_px[number],
            len(names),
        )

    def __len__(self) -> int:
        return len(self.number)

    @cached_property
    def rows(self) -> list[I64]:
        """The sightings of each frame."""
        return [np.flatnonzero(self.frame == f) for f in range(self.frames)]

    def only(self, keep: Bool) -> Sightings:
        """Without the tracks where Bool[T] is false."""
        rows = np.flatnonzero(keep[self.track])
        renumbered = np.cumsum(keep) - 1
        return Sightings(
            self.number[rows],
            renumbered[self.track[rows]],
            self.track_number[keep],
            self.frame[rows],
            self.uv_px[rows],
            self.deviation_px[rows],
            self.frames,
        )


def first_points(
    scene: RayScene, cameras: Sequence[Camera], seen: Sightings, near_px: float
) -> tuple[F64, F64, Bool]:
    """Where each track meets the mesh: of the lifts of its sightings, the one that agrees with most others.

    Args:
        near_px: how far off a sighting is that counts half.

    Returns:
        points F64[T, 3] and unit normals F64[T, 3] (towards the camera), and Bool[T], whether there is one:
        no sighting's ray may meet the mesh surely.
    """
    count, rows = len(seen.track_number), len(seen)
    x, normal, sure = np.full((rows, 3), np.nan), np.zeros((rows, 3)), np.zeros(rows, dtype=bool)
    for f, mine in enumerate(seen.rows):
        lift = lifted(scene, cameras[f], seen.uv_px[mine])
        x[mine], normal[mine], sure[mine] = lift.x, lift.normal, lift.sure
    one, other = pairs_of(seen.track)
    worth = np.zeros(rows)
    keep = sure[one]
    one, other = one[keep], other[keep]
    squares = np.full(len(one), np.inf)
    for f in range(seen.frames):
        at = np.flatnonzero(seen.frame[other] == f)
        error = cameras[f].project(x[one[at]])[0] - seen.uv_px[other[at]]
        squares[at] = np.where(finite(error), (error**2).sum(axis=1), np.inf) / coarseness(cameras[f]) ** 2
    # A wide Lorentzian: agreement counts, and small distances beat large ones even where all are large.
    np.add.at(worth, one, 1 / (1 + squares / near_px**2))
    worth = np.where(sure, worth + 1e-9, -1.0)
    order = np.lexsort((worth, seen.track))
    last = np.flatnonzero(np.diff(np.append(seen.track[order], count)))
    best = order[last]
    if not count:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=bool)
    return x[best], normal[best], sure[best]


def pairs_of(track: I64) -> tuple[I64, I64]:
    """All ordered pairs of different rows of the same track; ``track`` I64[O] is sorted."""
    size = np.bincount(track) if len(track) else np.zeros(0, np.int64)
    start = np.cumsum(size) - size
    one = np.repeat(np.arange(len(track)), size[track])
    offset = np.arange(len(one)) - np.repeat(np.cumsum(size[track]) - size[track], size[track])
    other = start[track[one]] + offset
    different = one != other
    return one[different], other[different]


def tangents(normal: F64) -> F64:
    """Axes [T, 3, 3] in columns: two along the surface, then its unit normal [T, 3]."""
    least = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = unit(np.cross(normal, least))
    return np.stack([first, np.cross(normal, first), normal], axis=-1)

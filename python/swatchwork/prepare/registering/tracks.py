# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The same spots of the object in many photographs: SIFT features, matched in pairs, joined into tracks.

Features are sought inside the region, a little away from its edge: what a silhouette makes does not stick to
the surface. Descriptors are RootSIFT [Arandjelovic and Zisserman 2012], so that a highlight's few strong
gradients do not outweigh the rest. A pair of photographs counts where an essential matrix agrees with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from swatchwork.arrays import F32, F64, I32, I64, U8, Bool
from swatchwork.capture import Camera
from swatchwork.prepare.registering.view import View
from swatchwork.progress import SILENT, Progress

LONGEST_PX = 2400
"""Features are sought in photographs made this small: SIFT takes a gigabyte for one. Tolerances in pixels
are of such a photograph (`coarseness`)."""
LIMIT = 4000
"""Features kept a photograph, those of the strongest contrast."""
CONTRAST = 0.01
"""SIFT's contrast threshold, a quarter of Lowe's: dark, glossy objects show little."""
DEVIATION_PX, DEVIATION = 0.2, 0.07
"""Of a feature's place: the least, and over its diameter (squares add). Rendered ones, seen from 20 degrees
aside, are off by 0.25 px at a diameter of 3, 0.45 at 6 and 0.8 at 10, along both axes together."""
EDGE_PX = 5
"""Features nearer than this to the region's edge are left out."""
RATIO = 0.8
"""Largest distance to the nearest descriptor over that to the second; Lowe's."""
ERROR_PX = 2.0
"""How far from its epipolar line a match may be."""
AGREEING, CHANCE = 14, 1 / 12
"""Of n matches, ``AGREEING + CHANCE n`` must share an essential matrix. Of n random ones about 9 + n / 20 do,
at most 12 + n / 20 in ten trials each of n = 20 to 800."""
DARK_CODE, MOST_GAIN = 220, 6.0
"""A photograph whose object is darker than this code is brightened to it, by no more than this: contrast
thresholds are absolute, and glossy objects are often black."""


@dataclass(frozen=True, eq=False)
class Features:
    """Spots of one photograph, each place once.

    Attributes:
        uv_px: F64[N, 2], places in the image, pixel centres at +0.5.
        deviation_px: F64[N], standard deviation of each along each axis.
        descriptor: F32[D, 128], RootSIFT of unit length; a place has one for each of its directions.
        place: I32[D], which place each descriptor is of.
    """

    uv_px: F64
    deviation_px: F64
    descriptor: F32
    place: I32

    def __len__(self) -> int:
        return len(self.uv_px)


@dataclass(frozen=True, eq=False)
class Tracks:
    """T spots of the object, and their O sightings in photographs, sorted by spot.

    Attributes:
        names: the photographs.
        count: T.
        track, frame: I32[O], of each sighting; a track has at most one in a photograph, and two or more.
        uv_px: F64[O, 2], pixel centres at +0.5; ``deviation_px`` F64[O], their standard deviations.
        features: of each photograph; none, where tracks come from elsewhere.
        agreeing: I32[k, k], how many matches of two photographs share an essential matrix.
    """

    names: tuple[str, ...]
    count: int
    track: I32
    frame: I32
    uv_px: F64
    deviation_px: F64
    features: tuple[Features, ...]
    agreeing: I32

    def __len__(self) -> int:
        return self.count


def features(view: View, limit: int = LIMIT) -> Features:
    """SIFT features of a photograph inside its region (everywhere, where it has none)."""
    coarse = coarseness(view.lens)
    gray, mask = view.gray, None
    if view.region is not None:
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * EDGE_PX + 1,) * 2)
        mask = _smaller(view.region.astype(np.uint8) * 255, coarse)
        mask = cv2.erode((mask > 127).astype(np.uint8), disc, borderValue=0)
    gray = _smaller(gray, coarse)
    # Upscaling that maps pixel x to 2 x: OpenCV's other way puts features a quarter of a pixel off.
    # OpenCV 5's own annotations lack it.
    make: Any = vars(cv2)["SIFT_create"]
    sift = make(nfeatures=limit, contrastThreshold=CONTRAST, enable_precise_upscale=True)
    points, raw = sift.detectAndCompute(_brightened(gray, mask), mask)
    if raw is None or not len(points):
        return Features(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 128), np.float32), np.zeros(0, np.int32))
    # Sides are rounded to whole pixels, each by itself.
    scale = np.array([view.gray.shape[1] / gray.shape[1], view.gray.shape[0] / gray.shape[0]])
    uv_px = (np.array([point.pt for point in points]) + 0.5) * scale
    places, first, place = np.unique(uv_px, axis=0, return_index=True, return_inverse=True)
    deviation_px = np.hypot(DEVIATION_PX, DEVIATION * np.array([points[i].size for i in first])) * coarse
    descriptor = raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-9)
    return Features(
        places,
        deviation_px,
        np.sqrt(descriptor, dtype=np.float32),
        place.ravel().astype(np.int32),
    )


def coarseness(lens: Camera) -> float:
    """Pixels of a photograph in one of those that its features are sought in; 1 up to `LONGEST_PX`."""
    return max(1.0, max(lens.width, lens.height) / LONGEST_PX)


def _smaller(image: U8, coarse: float) -> U8:
    if coarse == 1.0:
        return image
    size = (round(image.shape[1] / coarse), round(image.shape[0] / coarse))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _brightened(gray: U8, mask: U8 | None) -> U8:
    inside = gray if mask is None else gray[mask > 0]
    if not inside.size:
        return gray
    # Highlights may well be cut off: what is seen in them does not stick to the surface.
    gain = np.clip(DARK_CODE / max(float(np.percentile(inside, 98)), 1.0), 1.0, MOST_GAIN)
    return np.asarray(np.minimum(gray * gain + 0.5, 255), dtype=np.uint8)


def matches(a: Features, b: Features, ratio: float = RATIO) -> tuple[I64, F64]:
    """Places of two photographs that look alike: each other's nearest, and clearly nearer than the second.

    Returns:
        their numbers I64[m, 2], best first, and F64[m], the ratio of the distances to nearest and second.
    """
    if len(a.descriptor) < 2 or len(b.descriptor) < 2:
        return np.zeros((0, 2), np.int64), np.zeros(0)
    alike = a.descriptor @ b.descriptor.T
    rows = np.arange(len(alike))
    nearest, back = alike.argmax(axis=1), alike.argmax(axis=0)
    best = alike[rows, nearest]
    alike[rows, nearest] = -1
    # Descriptors have unit length: |d - e|^2 = 2 - 2 d.e.
    of = np.sqrt(np.maximum(1 - best, 0) / np.maximum(1 - alike.max(axis=1), 1e-9))
    good = np.flatnonzero((back[nearest] == rows) & (of < ratio))
    good = good[np.argsort(of[good], kind="stable")]
    pairs = np.column_stack([a.place[good], b.place[nearest[good]]]).astype(np.int64)
    _, first = np.unique(pairs, axis=0, return_index=True)
    keep = np.sort(first)
    return pairs[keep], of[good][keep].astype(np.float64)


def agreeing(view_a: View, view_b: View, uv_a_px: F64, uv_b_px: F64, error_px: float = ERROR_PX) -> Bool:
    """Bool[m]: which matches (image points [m, 2] of each) share an essential matrix; none, where few do."""
    none = np.zeros(len(uv_a_px), dtype=bool)
    if len(uv_a_px) < AGREEING:
        return none
    a, b = flat(view_a, uv_a_px), flat(view_b, uv_b_px)
    focal = np.mean([(v.lens.fx + v.lens.fy) / 2 / coarseness(v.lens) for v in (view_a, view_b)])
    inlier: Any
    _, inlier = cv2.findEssentialMat(
        a,
        b,
        np.eye(3),
        method=cv2.USAC_ACCURATE,
        prob=0.9999,
        threshold=float(error_px / focal),
        maxIters=10000,
    )
    if inlier is None or int(inlier.sum()) < AGREEING + CHANCE * len(a):
        return none
    return np.asarray(inlier.ravel() > 0)


def flat(view: View, uv_px: F64) -> F64:
    """Image points [P, 2] on the plane z = 1 of axes x right, y down, z forward: OpenCV's, without a lens."""
    d = view.lens.rays(uv_px) @ view.lens.world_from_camera[:3, :3]
    return np.ascontiguousarray(np.column_stack([d[:, 0], -d[:, 1]]) / -d[:, 2:])


def find_tracks(views: Sequence[View], limit: int = LIMIT, progress: Progress = SILENT) -> Tracks:
    """Features of all photographs, matched each with each, and joined."""
    with progress.stage("Features", len(views)) as task:
        found = []
        for view in views:
            task.describe(view.name)
            found.append(features(view, limit))
            task.advance()
    links: list[tuple[int, int, I64, F64]] = []
    with progress.stage("Matches", len(views) * (len(views) - 1) / 2) as task:
        for i, a in enumerate(found):
            for j, b in enumerate(found[:i]):
                pairs, ratio = matches(a, b)
                keep = agreeing(views[i], views[j], a.uv_px[pairs[:, 0]], b.uv_px[pairs[:, 1]])
                links.append((i, j, pairs[keep], ratio[keep]))
                task.advance()
    return joined(tuple(view.name for view in views), found, links)


def joined(
    names: tuple[str, ...], found: Sequence[Features], links: Sequence[tuple[int, int, I64, F64]]
) -> Tracks:
    """Tracks of the matches (two photographs' numbers, places I64[m, 2], ratios F64[m]) between features.

    The surest matches join first; one that would put two places of a photograph into a track is left out, so
    that a wrong match splits the chain that it would have fused.
    """
    start = np.concatenate([[0], np.cumsum([len(f) for f in found], dtype=np.int64)]).astype(np.int64)
    of_frame = np.repeat(np.arange(len(found)), np.diff(start))
    count = np.zeros((len(found), len(found)), dtype=np.int32)
    ends, ratios = [np.zeros((0, 2), np.int64)], [np.zeros(0)]
    for i, j, pairs, ratio in links:
        count[i, j] = count[j, i] = len(pairs)
        ends.append(pairs + start[[i, j]])
        ratios.append(ratio)
    edge = np.concatenate(ends)[np.argsort(np.concatenate(ratios), kind="stable")]
    parent, frames = list(range(start[-1])), [1 << int(f) for f in of_frame]

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    for one, other in edge.tolist():
        r, s = root(one), root(other)
        if r != s and not frames[r] & frames[s]:
            parent[s] = r
            frames[r] |= frames[s]
    node = np.unique(edge)
    group = np.array([root(n) for n in node.tolist()], dtype=np.int64)
    _, track, size = np.unique(group, return_inverse=True, return_counts=True)
    node, track = node[size[track] > 1], track[size[track] > 1]
    _, track = np.unique(track, return_inverse=True)
    order = np.argsort(track, kind="stable")
    node, track = node[order], track[order]
    uv_px = np.concatenate([np.zeros((0, 2)), *(f.uv_px for f in found)])
    deviation_px = np.concatenate([np.zeros(0), *(f.deviation_px for f in found)])
    return Tracks(
        names,
        int(track.max(initial=-1)) + 1,
        track.astype(np.int32),
        of_frame[node].astype(np.int32),
        uv_px[node],
        deviation_px[node],
        tuple(found),
        count,
    )

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A sphere under light probes, by one dense quadrature for measured materials and candidate kernels alike.

An isotropic reflectance depends on the view only through n.o, so directions are tabulated for a few values of
n.o (bins) and every pixel of a bin reads the same table against its own, turned, light:

    radiance[pixel] = sum over samples of f(i, o) cos_i * L(i) * 4 (o.h) dh.

Samples are half-vectors on log-polar rings, several times denser than the package's own.
Because materials and kernels share the samples and the filtered light, what quadrature error is left cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

BASE = 1024  # side of the octahedral square at the finest level
# n.o of the bins: fine at the rim, where reflectance changes fastest; 0.03 is where captures are cut off.
BIN_EDGES = np.concatenate([[0.03, 0.04, 0.055, 0.075], np.linspace(0.1, 1.0, 37)])
BINS = 0.5 * (BIN_EDGES[1:] + BIN_EDGES[:-1])


# ---- light ---------------------------------------------------------------------------------------
def square_from_direction(d: np.ndarray) -> np.ndarray:
    """Equal-area octahedral square [..., 2] of unit directions [..., 3] (Clarberg 2008)."""
    x, y, z = np.abs(d[..., 0]), np.abs(d[..., 1]), np.minimum(np.abs(d[..., 2]), 1)
    r = np.sqrt(1 - z)
    b = np.arctan2(y, x) * (2 / np.pi) * r
    a = r - b
    below = d[..., 2] < 0
    a, b = np.where(below, 1 - b, a), np.where(below, 1 - a, b)
    return np.stack([(np.copysign(a, d[..., 0]) + 1) / 2, (np.copysign(b, d[..., 1]) + 1) / 2], axis=-1)


def direction_from_square(ab: np.ndarray) -> np.ndarray:
    """Inverse of `square_from_direction`."""
    u, v = 2 * ab[..., 0] - 1, 2 * ab[..., 1] - 1
    s = 1 - (np.abs(u) + np.abs(v))
    r = 1 - np.abs(s)
    phi = np.where(r > 0, ((np.abs(v) - np.abs(u)) / np.where(r > 0, r, 1) + 1) * (np.pi / 4), 0)
    z = np.copysign(1 - r * r, s)
    k = r * np.sqrt(np.maximum(2 - r * r, 0))
    return np.stack([np.copysign(np.cos(phi) * k, u), np.copysign(np.sin(phi) * k, v), z], axis=-1)


def light_pyramid(file: Path) -> list[np.ndarray]:
    """Area means [S, S, 3] of a lat-long probe for S = BASE, BASE/2, ... 4."""
    image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)[..., ::-1].astype(np.float32)
    height, width = image.shape[:2]
    centres = (np.arange(2 * BASE) + 0.5) / (2 * BASE)
    d = direction_from_square(np.stack(np.meshgrid(centres, centres), axis=-1))
    # The data folder's convention: d = (sin t sin p, cos t, -sin t cos p), p from -pi at the left edge.
    u = (np.arctan2(d[..., 0], -d[..., 2]) / np.pi + 1) / 2 * width - 0.5
    v = np.arccos(np.clip(d[..., 1], -1, 1)) / np.pi * height - 0.5
    wrapped = cv2.copyMakeBorder(image, 0, 0, 1, 1, cv2.BORDER_WRAP)
    fine = cv2.remap(
        wrapped,
        (u + 1).astype(np.float32),
        v.astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    levels = [_halved(fine)]
    while len(levels[-1]) > 4:
        levels.append(_halved(levels[-1]))
    return levels


def _halved(a: np.ndarray) -> np.ndarray:
    return (a[::2, ::2] + a[1::2, ::2] + a[::2, 1::2] + a[1::2, 1::2]) / 4


def filtered(pyramid: list[np.ndarray], d: np.ndarray, solid_angle: np.ndarray) -> np.ndarray:
    """Light [..., 3] around directions [..., 3], a mean over about `solid_angle` [...]."""
    level = 0.5 * np.log2(np.maximum(solid_angle, 1e-12) * BASE**2 / (4 * np.pi)) - 0.5
    level = np.clip(level, 0, len(pyramid) - 1.001)
    square = square_from_direction(d).astype(np.float32)
    out = np.zeros((*d.shape[:-1], 3), np.float32)
    for k, image in enumerate(pyramid):
        share = np.maximum(1 - np.abs(level - k), 0)
        chosen = share > 0
        if not chosen.any():
            continue
        at = square[chosen] * len(image) - 0.5
        looked_up = (
            cv2.remap(
                image, at[None, :, 0], at[None, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )
            if at.shape[0] < 32767
            else _remap_long(image, at)
        )
        out[chosen] += share[chosen, None].astype(np.float32) * looked_up.reshape(-1, 3)
    return out


def _remap_long(image: np.ndarray, at: np.ndarray) -> np.ndarray:
    """cv2.remap takes at most 32767 columns: fold the list into rows."""
    rows = -(-len(at) // 16384)
    padded = np.zeros((rows * 16384, 2), np.float32)
    padded[: len(at)] = at
    grid = padded.reshape(rows, 16384, 2)
    return cv2.remap(
        image, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).reshape(-1, 3)[: len(at)]


# ---- directions ----------------------------------------------------------------------------------
@dataclass(frozen=True)
class Samples:
    """Half-vector samples for one n.o: local directions and measures; only those with i above the horizon."""

    o: np.ndarray  # [3], in the xz plane
    i: np.ndarray  # [S, 3]
    h: np.ndarray  # [S, 3]
    o_h: np.ndarray  # [S]
    solid_angle: np.ndarray  # [S], of i: 4 (o.h) dh


def ring_samples(cos_o: float, density: float = 1.0) -> Samples:
    """Rings in t = tan(alpha) from 3e-4 to 60 at a ratio of 1.1 (density 1), 8 to 64 azimuths each."""
    rings = round(128 * density)
    t = np.concatenate([[0.0], np.geomspace(3e-4, 60, rings), [np.inf]])
    alpha = np.arctan(t)
    h, measure = [], []
    for a0, a1 in pairwise(alpha):
        middle = np.tan((a0 + a1) / 2)
        count = round((8 if middle < 0.01 else 16 if middle < 0.05 else 32 if middle < 0.2 else 64) * density)
        phi = (np.arange(count) + 0.5) * (2 * np.pi / count)
        c = (np.cos(a0) + np.cos(a1)) / 2  # splits the ring's area in two
        s = np.sqrt(1 - c * c)
        h.append(np.stack([s * np.cos(phi), s * np.sin(phi), np.full(count, c)], axis=-1))
        measure.append(np.full(count, (np.cos(a0) - np.cos(a1)) * 2 * np.pi / count))
    half, dh = np.concatenate(h), np.concatenate(measure)
    o = np.array([np.sqrt(1 - cos_o**2), 0.0, cos_o])
    o_h = half @ o
    i = 2 * o_h[:, None] * half - o
    keep = (o_h > 0) & (i[:, 2] > 0)
    return Samples(o, i[keep], half[keep], o_h[keep], (4 * o_h * dh)[keep])


# ---- pixels --------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Pixels:
    """Points on the sphere seen by views: their frames (columns: tangent of the view, bitangent, normal)."""

    frame: np.ndarray  # [P, 3, 3] world_from_local
    bin: np.ndarray  # [P]
    texel: np.ndarray  # [P]
    view: np.ndarray  # [P]

    @property
    def cosine(self) -> np.ndarray:
        return BINS[self.bin]


def directions(count: int, seed: int) -> np.ndarray:
    """Directions [count, 3] on a randomly turned Fibonacci sphere, so surface area is sampled evenly."""
    k = np.arange(count) + 0.5
    z, phi = 1 - 2 * k / count, k * np.pi * (3 - np.sqrt(5))
    points = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], axis=-1)
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return points @ (q * np.sign(np.diag(r))).T


def seen(normals: np.ndarray, views: np.ndarray) -> Pixels:
    """All (normal, view) pairs but the rim's last, by texel; o moves, in its plane, to the bin's n.o."""
    cosine = normals @ views.T
    texel, view = np.nonzero(cosine > BIN_EDGES[0])
    c = cosine[texel, view]
    n = normals[texel]
    tangent = views[view] - c[:, None] * n
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(n, tangent), n], axis=-1)
    return Pixels(frame, np.digitize(c, BIN_EDGES[1:-1]), texel, view)


def views_around(axis: np.ndarray, angles_deg: list[float], seed: int) -> np.ndarray:
    """Views [V, 3] at given angles from `axis`, at random azimuths."""
    rng = np.random.default_rng(seed)
    side = np.cross(axis, rng.normal(size=(len(angles_deg), 3)))
    side /= np.linalg.norm(side, axis=-1, keepdims=True)
    angle = np.deg2rad(np.array(angles_deg))[:, None]
    return np.cos(angle) * axis + np.sin(angle) * side


def light_on(samples: Samples, frames: np.ndarray, pyramid: list[np.ndarray]) -> np.ndarray:
    """Filtered light times solid angle, [P, S, 3] float32, on the samples of pixels with these frames."""
    world = np.einsum("pab,sb->psa", frames, samples.i)
    light = filtered(pyramid, world, np.broadcast_to(samples.solid_angle, world.shape[:-1]))
    return light * samples.solid_angle[:, None].astype(np.float32)

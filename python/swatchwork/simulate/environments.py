# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Procedural environments of high dynamic range, with hard edges as a real room or sky has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import F64, unit
from ..light import Environment, direction_from_uv

KINDS = ("room", "sky", "studio", "atelier", "overcast")
CONVENTION = "blender"


def procedural_environment(kind: str, seed: int = 0, height: int = 128) -> Environment:
    """An environment of 2 x height by height pixels, z up, of mean radiance 1.

    ``room`` has dim tinted walls, sharp bright windows and small lamps; ``sky`` a gradient, clouds, a
    small sun and a ground; ``studio`` softboxes of several colours on near black; ``atelier`` large
    windows in pale walls; ``overcast`` a sky whose sun is a wide glow. Peaks reach some hundred times the
    mean, in the last two ten times. The same kind and seed give the same light at every height.
    """
    if kind not in KINDS:
        raise ValueError(f"no procedural environment {kind!r}; expected one of {', '.join(KINDS)}")
    painters: dict[str, Callable[[F64, np.random.Generator], F64]] = {
        "room": _room,
        "sky": _sky,
        "studio": _studio,
        "atelier": _atelier,
        "overcast": _overcast,
    }
    paint = painters[kind]
    # Four samples a pixel, so that windows and lamps keep their energy at every height.
    fine = 2 * height
    v, u = np.meshgrid(
        (np.arange(fine) + 0.5) / fine, (np.arange(2 * fine) + 0.5) / (2 * fine), indexing="ij"
    )
    radiance = paint(
        direction_from_uv(CONVENTION, np.stack([u, v], axis=-1)),
        np.random.default_rng([seed, KINDS.index(kind)]),
    )
    radiance = radiance.reshape(height, 2, 2 * height, 2, 3).mean(axis=(1, 3))
    solid_angle = np.sin(np.pi * (np.arange(height) + 0.5) / height)[:, None, None]
    mean = (radiance * solid_angle).sum() / (solid_angle.sum() * radiance.shape[1] * 3)
    return Environment((radiance / mean).astype(np.float32), CONVENTION)


def _room(d: F64, rng: np.random.Generator) -> F64:
    walls = rng.uniform(0.05, 0.25, 3) * (1 + 0.4 * d[..., 2:])
    found = np.where(d[..., 2:] < -0.5, rng.uniform(0.03, 0.12, 3), walls)
    for _ in range(5):
        centre = unit(rng.normal(size=3) * [1, 1, 0.3])
        tint = np.array([0.85, 0.95, 1.1]) * rng.uniform(6, 25)
        pane = _rectangle(d, centre, rng.uniform(0.15, 0.3), rng.uniform(0.2, 0.45), panes=True)
        found = np.where(pane[..., None], tint * (0.6 + 0.4 * d[..., 2:]), found)
    for _ in range(4):
        centre = unit(rng.normal(size=3) * [1, 1, 0.4] + [0, 0, 1])
        lamp = d @ centre > np.cos(rng.uniform(0.03, 0.07))
        found = np.where(lamp[..., None], np.array([1.2, 0.95, 0.6]) * rng.uniform(80, 250), found)
    return found


def _sky(d: F64, rng: np.random.Generator) -> F64:
    up = np.clip(d[..., 2:], 0, 1)
    sky = np.array([0.9, 0.95, 1.0]) * (1 - up) + np.array([0.25, 0.45, 0.9]) * up
    cloud = waves(d * [1, 1, 3], rng, frequency=3.0)[..., None]
    sky = np.where(cloud > 0.4, 1.8 * np.clip(cloud, 0, 1.5), sky)
    azimuth, height = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.1)
    sun = np.array([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)])
    sky = np.where((d @ sun > np.cos(0.04))[..., None], np.array([1.1, 1.0, 0.85]) * 600, sky)
    ground = np.array([0.22, 0.19, 0.14]) * np.clip(1 + 0.5 * waves(d, rng, frequency=6.0)[..., None], 0.2, 2)
    # Buildings: a skyline of hard edges around the horizon.
    skyline = 0.12 * np.abs(np.round(2 * waves(unit(d * [1, 1, 0]), rng, frequency=4.0)))
    dark = np.broadcast_to(rng.uniform(0.05, 0.3, 3), d.shape)
    return np.where(d[..., 2:] < 0, ground, np.where(d[..., 2:] < skyline[..., None], dark, sky))


def _atelier(d: F64, rng: np.random.Generator) -> F64:
    found = rng.uniform(0.25, 0.5, 3) * (1 + 0.4 * d[..., 2:])
    for _ in range(6):
        centre = unit(rng.normal(size=3) * [1, 1, 0.5] + [0, 0, 0.3])
        tint = np.array([0.85, 0.95, 1.1]) * rng.uniform(0.8, 1.2, 3) * rng.uniform(4, 14)
        pane = _rectangle(d, centre, rng.uniform(0.2, 0.4), rng.uniform(0.2, 0.45), panes=True)
        found = np.where(pane[..., None], tint * (0.8 + 0.2 * d[..., 2:]), found)
    return found


def _overcast(d: F64, rng: np.random.Generator) -> F64:
    up = np.clip(d[..., 2:], 0, 1)
    sky = np.array([0.8, 0.9, 1.05]) * (0.4 + 0.6 * up)
    sky = sky * np.clip(1 + 0.35 * waves(d * [1, 1, 3], rng, frequency=3.0)[..., None], 0.3, 2)
    azimuth, height = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.1)
    sun = np.array([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)])
    glow = np.exp(-(1 - d @ sun) / 0.04)[..., None] * np.array([1.15, 1.0, 0.8]) * 14
    ground = rng.uniform([0.15, 0.12, 0.06], [0.3, 0.25, 0.16])
    return np.where(d[..., 2:] < 0, ground, sky + glow)


def _studio(d: F64, rng: np.random.Generator) -> F64:
    found = np.full_like(d, 0.03) + 0.03 * np.clip(d[..., 2:], 0, 1)
    for i in range(7):
        width, height = rng.uniform(0.05, 0.5, 2)
        box = _rectangle(d, unit(rng.normal(size=3)), width, height, panes=False)
        tint = 0.5 + rng.dirichlet([1.0, 1.0, 1.0]) * 1.5
        found = np.where(box[..., None], tint * [4, 12, 40][i % 3], found)
    return found


def _rectangle(d: F64, centre: F64, half_width: float, half_height: float, panes: bool) -> np.ndarray:
    """Directions that pass a rectangle at distance 1; ``panes`` leaves a cross of frame bars."""
    right = unit(np.cross([0.0, 0.0, 1.0], centre))
    up = np.cross(centre, right)
    ahead = d @ centre
    x, y = (d @ right) / np.maximum(ahead, 1e-3), (d @ up) / np.maximum(ahead, 1e-3)
    inside = (ahead > 0) & (np.abs(x) < half_width) & (np.abs(y) < half_height)
    return inside & (~panes | ((np.abs(x) > 0.02) & (np.abs(y) > 0.02))) if panes else inside


def waves(x: F64, rng: np.random.Generator, frequency: float, count: int = 24) -> F64:
    """A smooth random field over points [..., 3]: sinusoids of random direction, variance 1."""
    k = unit(rng.normal(size=(count, 3))) * frequency * rng.uniform(0.5, 1.5, (count, 1))
    phase = rng.uniform(0, 2 * np.pi, count)
    return np.asarray(np.sqrt(2 / count) * np.cos(x @ k.T + phase).sum(axis=-1), dtype=np.float64)

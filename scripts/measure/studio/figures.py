# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How far each step's result is from the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F64, Bool, Float
from swatchwork.capture import Camera
from swatchwork.light import Environment, direction_from_uv, solid_angles
from swatchwork.prepare.registering import apart
from swatchwork.prepare.response_curve import TRUSTED, given_response

from . import lens
from .camera_model import CameraKind

WIDTHS = (64, 128, 256)
"""Of the maps on which probes are compared."""
FINE = 1024


def of_lens(true: Camera, found: Camera) -> dict[str, float]:
    """Numbers of the lens, and where it puts what the true one sees: largest distance over the picture."""
    v, u = np.mgrid[0.5 : true.height : 25, 0.5 : true.width : 25]
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    xy = lens.slopes(true, uv)
    d = np.column_stack([xy[:, 0], -xy[:, 1], -np.ones(len(xy))])

    def off(rotvec: F64) -> F64:
        return np.asarray(found.project(d @ Rotation.from_rotvec(rotvec).as_matrix().T)[0] - uv)

    best = least_squares(lambda r: off(r).ravel(), np.zeros(3), x_scale=1e-3)
    return {
        "focal": float(np.sqrt(found.fx * found.fy / (true.fx * true.fy)) - 1),
        "centre_px": float(np.hypot(found.cx - true.cx, found.cy - true.cy)),
        "k1": found.k1 - true.k1,
        "worst_px": float(np.linalg.norm(off(np.zeros(3)), axis=1).max()),
        "worst_after_turn_px": float(np.linalg.norm(off(best.x), axis=1).max()),
    }


def of_response(kind: CameraKind, document: str) -> float:
    """Rms of the log of the recovered response over the true one, over the codes that the package trusts."""
    signal = np.linspace(0, 1, 100_001)
    codes = np.arange(256) / 255
    true = np.interp(codes, kind.coded(signal), signal)
    table = given_response(document).table

    def logs(values: F64) -> F64:
        middle = (values[127] + values[128]) / 2
        return np.asarray(np.log(values[TRUSTED] / middle))

    difference = [logs(table[:, c]) - logs(true) for c in range(3)]
    return float(np.sqrt(np.mean(np.square(difference))))


def factor(found: Sequence[Float], true: Sequence[Float], where: Sequence[Bool]) -> F64:
    """Least-squares factor F64[3] from true to found radiance, a channel."""
    a = np.concatenate([f[w] for f, w in zip(found, where, strict=True)]).astype(np.float64)
    b = np.concatenate([t[w] for t, w in zip(true, where, strict=True)]).astype(np.float64)
    return np.asarray((a * b).sum(axis=0) / (b * b).sum(axis=0))


def nrms(found: Float, true: Float, weight: Float | None = None) -> float:
    """Root of the summed squared differences over that of the squares."""
    w = np.ones(true.shape[:-1]) if weight is None else weight
    difference = (w[..., None] * (found.astype(np.float64) - true) ** 2).sum()
    return float(np.sqrt(difference / (w[..., None] * true.astype(np.float64) ** 2).sum()))


def of_radiance(found: Sequence[Float], true: Sequence[Float], where: Sequence[Bool], scale: F64) -> float:
    """NRMS of linear photographs over pixels ``where``, after a factor a channel."""
    a = np.concatenate([f[w] / scale for f, w in zip(found, where, strict=True)])
    b = np.concatenate([t[w] for t, w in zip(true, where, strict=True)])
    return nrms(a, b)


def of_blocks(
    found: Sequence[Float], true: Sequence[Float], where: Sequence[Bool], scale: F64, side: int = 4
) -> float:
    """The same of means over squares of pixels that lie wholly in ``where``: what noise and coding leave."""

    def means(image: Float) -> F64:
        height, width = (length // side * side for length in image.shape[:2])
        blocks = image[:height, :width].reshape(height // side, side, width // side, side, -1)
        return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float64))

    whole = [means(w[..., None])[..., 0] == 1 for w in where]
    return of_radiance([means(f) for f in found], [means(t) for t in true], whole, scale)


# ---- light ---------------------------------------------------------------------------------------
def on_map(light: Environment, width: int) -> F64:
    """Area means of a light on a map in Mitsuba's convention: what is finer than its texels is averaged."""
    v, u = np.mgrid[0 : FINE // 2, 0:FINE] + 0.5
    d = direction_from_uv("mitsuba", np.stack([u / FINE, v / (FINE // 2)], axis=-1))
    return coarse(light.lookup(d), width)


def coarse(values: Float, width: int) -> F64:
    """Area means of a map [H, W, C] on one of another width."""
    height, step = values.shape[0], values.shape[1] // width
    area = np.sin(np.pi * (np.arange(height) + 0.5) / height)[:, None, None]
    block = (height // step, step, width, step, values.shape[2])
    total = (values * area).reshape(block).sum(axis=(1, 3))
    return np.asarray(total / np.broadcast_to(area, values.shape).reshape(block).sum(axis=(1, 3)))


def of_probe(found: Environment, true: Environment, unseen: Float, scale: F64) -> dict[str, float]:
    """NRMS of area means where a ball shows the light, by the width of the map; and of irradiance."""
    figures = {}
    hidden = np.kron(unseen > 0, np.ones((FINE // 2 // len(unseen),) * 2)) > 0
    for width in WIDTHS:
        seen = coarse(hidden[..., None].astype(np.float64), width)[..., 0] == 0
        weight = solid_angles("mitsuba", width // 2, width) * seen
        figures[f"nrms_{width}"] = nrms(on_map(found, width) / scale, on_map(true, width), weight)
    irradiance = [of_normals(on_map(light, 64)) for light in (found, true)]
    figures["irradiance_nrms"] = nrms(irradiance[0] / scale, irradiance[1])
    figures["energy"] = float((found.mean_radiance / scale).sum() / true.mean_radiance.sum())
    figures["unseen"] = float(unseen.mean())
    return figures


def of_normals(radiance: F64, count: int = 400) -> F64:
    """Irradiance F64[count, 3] of surfaces that face evenly spread directions."""
    height, width = radiance.shape[:2]
    v, u = np.mgrid[0:height, 0:width] + 0.5
    d = direction_from_uv("mitsuba", np.stack([u / width, v / height], axis=-1)).reshape(-1, 3)
    area = solid_angles("mitsuba", height, width).reshape(-1)
    i = np.arange(count) + 0.5
    z, phi = 1 - 2 * i / count, np.pi * (1 + np.sqrt(5)) * i
    across = np.sqrt(1 - z * z)
    n = np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=-1)
    return np.asarray(np.maximum(n @ d.T, 0) @ (area[:, None] * radiance.reshape(-1, 3)))


# ---- poses ---------------------------------------------------------------------------------------
def of_poses(found: Sequence[Camera], true: Sequence[Camera], about: F64) -> dict[str, Any]:
    """Angles in degrees and distances as a share, of each frame."""
    pairs = [apart(t, f, about) for t, f in zip(true, found, strict=True)]
    return {"degrees": [a for a, _ in pairs], "distance": [b for _, b in pairs]}


def turned_apart(a: F64, b: F64) -> float:
    """Angle between two rotations in degrees."""
    return float(np.degrees(Rotation.from_matrix(a.T @ b).magnitude()))


def with_lens(poses: Sequence[Camera], of: Camera) -> tuple[Camera, ...]:
    """The same places with another lens."""
    return tuple(replace(of, world_from_camera=camera.world_from_camera) for camera in poses)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The frames to render an exported material in: cameras, and light in the layouts that programs read.

Latitude-longitude maps of the three layouts hold the same pixels in the same order, and differ in how their
axes lie in the world: with (u, v) as in `light.conventions`, a direction in Blender's axes is that in
Mitsuba's with the coordinates passed on by one, (x, y, z)_blender = (z, x, y)_mitsuba. That is a rotation;
nothing is mirrored.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import F32, F64
from ..capture import Camera
from ..errors import CaptureWarning
from ..light import Environment, direction_from_uv
from ..material import Material
from ..simulate import camera_towards, look_at, procedural_environment

BLENDER_FROM_MITSUBA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

Up = Literal["y", "z"]
"""World axis that points up."""
UP: Up = "z"
"""Where nobody says: as in nerfstudio's and NeRF-Blender's files, and in Blender."""
Y_UP_FROM_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Frames: a name, a camera, and which of the lights it is under."""

    names: tuple[str, ...]
    cameras: tuple[Camera, ...]
    lights: tuple[Environment, ...]
    light_of_frame: tuple[int, ...]

    @classmethod
    def of(
        cls, names: Sequence[str], cameras: Sequence[Camera], light_of_each: Sequence[Environment]
    ) -> Surroundings:
        """Frames with a light each; equal objects are kept once."""
        lights = list({id(light): light for light in light_of_each}.values())
        number = {id(light): i for i, light in enumerate(lights)}
        return cls(
            tuple(names), tuple(cameras), tuple(lights), tuple(number[id(light)] for light in light_of_each)
        )

    @classmethod
    def made_up(cls, material: Material, up: Up = UP) -> Surroundings:
        """One view of the object under a made-up overcast sky, where nobody says better."""
        low, high = material.vertices.min(axis=0), material.vertices.max(axis=0)
        centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        towards = np.array([0.55, -0.75, 0.45]) / np.linalg.norm([0.55, -0.75, 0.45])
        seen = camera_towards(towards, 512, radius)
        turn = np.eye(3) if up == "z" else Y_UP_FROM_Z_UP
        pose = look_at(towards * np.linalg.norm(seen.position))
        pose[:3] = turn @ pose[:3]
        pose[:3, 3] += centre
        camera = Camera(512, 512, seen.fx, seen.fy, seen.cx, seen.cy, pose)
        sky = procedural_environment("overcast", 0, 256).rotated(turn)
        return cls(("view",), (camera,), (sky,), (0,))


def latitude_longitude(light: Environment) -> tuple[Environment, F64]:
    """The light as a latitude-longitude map, and the rotation world_from_mitsuba of its axes.

    An angular map is looked up anew at twice its pixels; others stay as they are.
    """
    if light.convention == "debevec-angular":
        side = light.radiance.shape[0]
        v, u = np.mgrid[0:side, 0 : 2 * side] + 0.5
        d = direction_from_uv("mitsuba", np.stack([u / (2 * side), v / side], axis=-1))
        turn = light.world_from_environment
        found = Environment(light.lookup(d @ turn.T).astype(np.float32), "mitsuba", turn, light.name)
        return found, turn
    turn = light.world_from_environment
    return light, turn @ BLENDER_FROM_MITSUBA if light.convention == "blender" else turn


def with_rows_at_poles(light: Environment) -> F32:
    """A latitude-longitude map in rows at v = i / (2 H), [2 H + 1, W, 3], as Mitsuba reads one.

    Bilinear between them is what is bilinear between ours, whose rows have their centres at (i + 1/2) / H.
    """
    raster = light.radiance
    beyond = np.roll(raster, raster.shape[1] // 2, axis=1)
    above, below = np.concatenate([beyond[:1], raster]), np.concatenate([raster, beyond[-1:]])
    found = np.empty((2 * len(raster) + 1, *raster.shape[1:]), np.float32)
    found[1::2], found[::2] = raster, (above + below) / 2
    return found


def warn_of_lenses(cameras: Sequence[Camera], *, square: bool) -> None:
    """Say which cameras a program's pinholes are not; ``square``: its pixels are squares, too."""
    bent = sum(any((c.k1, c.k2, c.p1, c.p2)) for c in cameras)
    uneven = sum(square and abs(c.fx / c.fy - 1) > 1e-4 for c in cameras)
    found = [f"{bent} of {len(cameras)} cameras have lens distortion"] if bent else []
    found += [f"{uneven} of {len(cameras)} cameras have pixels that are not square"] if uneven else []
    if found:
        warnings.warn(
            f"{' and '.join(found)}: the exported ones are pinholes{' of square pixels' if square else ''}, "
            "and their pictures shift against yours",
            CaptureWarning,
            stacklevel=4,
        )

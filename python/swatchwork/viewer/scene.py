# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a viewer shows, as plain data: a material on its mesh, lights, photographs, maps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ..arrays import F32, F64, U8
from ..capture import Camera, Frame, read_photograph
from ..errors import InputError
from ..light import Environment
from ..light.sampling import halved, shrunk
from ..relight import RelitScene

LIGHT_PX = 1024
"""Widest light a page carries; wider ones are halved, or shrunk where a side is odd."""
PHOTOGRAPH_PX = 640
"""Longest side of a photograph on the page."""


@dataclass(frozen=True, eq=False)
class Light:
    """An environment under a name."""

    name: str
    environment: Environment

    @classmethod
    def of(cls, name: str, environment: Environment) -> Light:
        """``environment``, no wider than the page carries."""
        radiance = environment.radiance
        while radiance.shape[1] > LIGHT_PX and not any(side % 2 for side in radiance.shape[:2]):
            radiance = halved(radiance, environment.convention)
        if radiance.shape[1] > LIGHT_PX:
            radiance = shrunk(radiance, environment.convention, LIGHT_PX)
        return cls(name, replace(environment, radiance=radiance))


@dataclass(frozen=True, eq=False)
class Shot:
    """A photograph, its camera without lens distortion, and the light it was taken under."""

    name: str
    pixels: U8
    """[H, W, 4]: 255 times (radiance / white) to the power of 1 / 2.2, of premultiplied radiance; alpha."""
    white: float
    camera: Camera
    light: int
    """Which of the page's lights."""
    turn: F64
    """[3, 3] rotation that takes that light, as the page has it, to where it stood."""


@dataclass(frozen=True, eq=False)
class TexelMap:
    """A number for each atlas pixel, to be shown in false colours."""

    name: str
    values: F32
    """[H, W]; NaN where there is none."""
    top: float
    """What the last colour stands for."""
    unit: str = ""
    """What follows the number in a read-out; ``%`` means that it is a fraction."""


@dataclass(frozen=True, eq=False)
class ViewerScene:
    """All that a page holds."""

    title: str
    scene: RelitScene
    lights: tuple[Light, ...]
    shots: tuple[Shot, ...] = ()
    maps: tuple[TexelMap, ...] = ()
    colours: tuple[str, ...] = ("#3b6fb6", "#e08b2c", "#4a9c6d", "#c8504b")
    """Of the representatives, over and over."""
    notes: tuple[str, ...] = field(default=())
    """Of each representative, a few words."""
    version: str = ""

    def __post_init__(self) -> None:
        if not self.lights:
            raise InputError("a viewer without light", expected="at least one environment")


def shot_of(frame: Frame, white: float, light: int, turn: F64, scale: float = 1.0) -> Shot:
    """A frame's photograph at page size, its lens distortion taken out, its radiance divided by ``scale``.

    Raises:
        InputError: the image cannot be read.
    """
    photograph, camera = read_photograph(frame), frame.camera
    shrunken = min(1.0, PHOTOGRAPH_PX / max(camera.width, camera.height))
    width, height = max(1, round(camera.width * shrunken)), max(1, round(camera.height * shrunken))
    x, y = width / camera.width, height / camera.height
    small = replace(
        camera, width=width, height=height, fx=camera.fx * x, fy=camera.fy * y, cx=camera.cx * x,
        cy=camera.cy * y, k1=0.0, k2=0.0, p1=0.0, p2=0.0,
    )  # fmt: skip
    radiance = np.concatenate([photograph.radiance, photograph.alpha[..., None]], axis=-1).astype(np.float32)
    if photograph.mask is not None:
        # Radiance too: what surrounds the object would be mixed into its rim where the photograph shrinks.
        radiance *= photograph.mask[..., None]
    if any((camera.k1, camera.k2, camera.p1, camera.p2)):
        radiance = _undistorted(radiance, camera)
    fitted = np.asarray(cv2.resize(radiance, (width, height), interpolation=cv2.INTER_AREA), np.float32)
    fitted[..., :3] = np.clip(fitted[..., :3] / (white * scale), 0, 1) ** (1 / 2.2)
    return Shot(frame.name, np.round(255 * np.clip(fitted, 0, 1)).astype(np.uint8), white, small, light, turn)


def _undistorted(radiance: F32, camera: Camera) -> F32:
    """The photograph that a lens without distortion would have taken with the same intrinsics."""
    straight = replace(camera, k1=0.0, k2=0.0, p1=0.0, p2=0.0)
    uv, _ = camera.project(camera.position + straight.rays(camera.pixel_centres()))
    at = np.nan_to_num(uv - 0.5, nan=-1e6).astype(np.float32).reshape(camera.height, camera.width, 2)
    return np.asarray(cv2.remap(radiance, at[..., 0], at[..., 1], cv2.INTER_LINEAR), np.float32)

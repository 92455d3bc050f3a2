# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Light from infinitely far away, as a function of direction."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import cv2
import numpy as np

from swatchwork.arrays import F32, F64, Float
from swatchwork.capture import EnvironmentSource, check_radiance, read_image
from swatchwork.capture.images import image_size
from swatchwork.errors import InputError
from swatchwork.light import sampling
from swatchwork.light.conventions import check_convention, direction_from_uv, solid_angles, uv_from_direction
from swatchwork.octahedral import pixel_directions

if TYPE_CHECKING:
    from swatchwork._native import Pyramid

LARGEST_BASE = 2048
"""Cap on the default size of the octahedral base (48 MB).

Bilinear lookups in a base of 1024 differ from those in its 1024 x 512 raster by an NRMS of 0.7 % (Uffizi),
1.5 % (Grove), 3.1 % (Grace) and 4.9 % (St. Peter's), over uniform directions; with 2048 by 0.2 to 1.8 %.
"""

FINEST = 8192
"""Lookups across the square that `octahedral` makes at most (half a minute); wider rasters are halved."""


@dataclass(frozen=True, eq=False)
class Environment:
    """Distant light: a raster, what its pixels mean, and how it is turned.

    Attributes:
        radiance: F32[H, W, 3], linear; a latitude-longitude map is twice as wide as high, an angular
            map square.
        convention: "blender", "mitsuba" or "debevec-angular" (see `light.conventions`).
        world_from_environment: F64[3, 3] rotation.
        name: what messages call it, such as its file.

    Raises:
        InputError: unknown convention, wrong shape, all black, or negative, infinite or NaN pixels
            (an angular map's outside of the disc is not looked at).
    """

    radiance: F32
    convention: str
    world_from_environment: F64 = field(default_factory=lambda: np.eye(3))
    name: str = "environment"

    def __post_init__(self) -> None:
        check_convention(self.convention)
        radiance = np.ascontiguousarray(self.radiance, dtype=np.float32)
        object.__setattr__(self, "radiance", radiance)
        _check_shape(radiance.shape, self.convention, self.name)
        part_of_sphere = self.solid_angles > 0
        check_radiance(radiance, part_of_sphere, self.name)
        if not radiance[part_of_sphere].any():
            raise InputError(
                "the environment is all black",
                file=self.name,
                expected="some light",
                hint="Nothing can be told about a material in the dark: is it the right file?",
            )

    def lookup(self, d_in_world: Float) -> F64:
        """Radiance F64[..., 3] from directions [..., 3] (of any length), bilinear in the raster."""
        d = np.asarray(d_in_world, dtype=np.float64)
        uv = uv_from_direction(self.convention, d.reshape(-1, 3) @ self.world_from_environment)
        return sampling.bilinear(self._bordered, uv).reshape(d.shape)

    def directions(self) -> F64:
        """World directions F64[H, W, 3] of the raster's pixel centres; NaN outside an angular map's disc."""
        height, width = self.radiance.shape[:2]
        v, u = np.mgrid[0:height, 0:width] + 0.5
        uv = np.stack([u / width, v / height], axis=-1)
        return np.asarray(direction_from_uv(self.convention, uv) @ self.world_from_environment.T)

    @cached_property
    def solid_angles(self) -> F64:
        """Steradians F64[H, W] of the raster's pixels, 4 pi in all."""
        return solid_angles(self.convention, *self.radiance.shape[:2])

    @cached_property
    def mean_radiance(self) -> F64:
        """Mean over the sphere, F64[3]; times 4 pi it is the integral."""
        weight = self.solid_angles[..., None]
        lit = np.where(weight > 0, self.radiance, 0)
        return np.asarray((lit * weight).sum(axis=(0, 1)) / (4 * np.pi))

    def rotated(self, rotation: F64) -> Environment:
        """The same light turned in the world by a rotation F64[3, 3]."""
        return replace(self, world_from_environment=np.asarray(rotation) @ self.world_from_environment)

    @property
    def base_size(self) -> int:
        """Default size of the octahedral raster: the power of two from twice the raster's width up, capped.

        Sharp lobes see its texels at grazing views: their NRMS over 1200 pairs is 0.5 % with it, and 1.2 %
        with the raster's width.
        """
        return int(min(LARGEST_BASE, 2 ** int(np.ceil(np.log2(2 * self.radiance.shape[1])))))

    def octahedral(self, size: int | None = None) -> F32:
        """Area means F32[size, size, 3] in the world frame on the equal-area octahedral square.

        Each pixel is the mean of at least 2 x 2 bilinear lookups, 3 x 3 where pixels are not smaller than the
        raster's, and of more than the raster has pixels there, so that the integral over the sphere is kept
        (to 0.2 % on real probes). With 2 x 2, in a base as wide as the raster, the response of a mirror-like
        lobe was off by 1.1 % under one of them, with 3 x 3 by 0.6 %.
        """
        size = self.base_size if size is None else size
        radiance = self.radiance
        while radiance.shape[1] > FINEST and not any(length % 4 for length in radiance.shape[:2]):
            radiance = sampling.halved(radiance, self.convention)
        bordered = (
            self._bordered if radiance is self.radiance else sampling.with_border(radiance, self.convention)
        )
        height, width = radiance.shape[:2]
        # Twice as many lookups across as pixels, for as long as that is cheap; never fewer than pixels.
        across = max(width, min(2 * width, FINEST // 2))
        samples = max(3 if size < 2 * width else 2, -(-min(across, FINEST) // size))
        turn = self.world_from_environment.astype(np.float32)
        result = np.empty((size, size, 3), dtype=np.float32)
        # About a million lookups at a time stay in cache and bound the memory.
        block = max(1, 2**20 // (size * samples * samples))
        for start in range(0, size, block):
            stop = min(size, start + block)
            d = pixel_directions(size * samples, slice(start * samples, stop * samples), np.float32)
            uv = uv_from_direction(self.convention, d @ turn)
            x = uv[..., 0] * np.float32(width) + np.float32(0.5)
            y = uv[..., 1] * np.float32(height) + np.float32(0.5)
            fine = cv2.remap(bordered, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            result[start:stop] = fine.reshape(stop - start, samples, size, samples, 3).mean(axis=(1, 3))
        return result

    def pyramid(self, size: int | None = None) -> Pyramid:
        """The native mip pyramid over `octahedral(size)`, built at the first call."""
        size = self.base_size if size is None else size
        if size not in self._pyramids:
            from swatchwork._native import Pyramid

            self._pyramids[size] = Pyramid(self.octahedral(size))
        return self._pyramids[size]

    @cached_property
    def _pyramids(self) -> dict[int, Pyramid]:
        return {}

    @cached_property
    def _bordered(self) -> F32:
        return sampling.with_border(self.radiance, self.convention)


def read_environment(source: EnvironmentSource) -> Environment:
    """Read an environment map.

    Raises:
        InputError: the file is missing or damaged, not HDR, of the wrong shape for its convention, all
            black, or has pixels that are negative, infinite or NaN.
    """
    if source.file.suffix.lower() not in (".exr", ".hdr"):
        raise InputError(
            f"an environment of type {source.file.suffix!r}",
            file=source.file,
            expected="an HDR image, .exr or .hdr",
            hint="Lamps and windows are clipped in 8-bit images",
        )
    # Before the pixels: an EXR file of uniform pixels is short, and may ask for gigabytes.
    width, height = image_size(source.file)
    _check_shape((height, width, 3), source.convention, str(source.file))
    radiance = read_image(source.file).linear
    return Environment(radiance, source.convention, source.world_from_environment, name=str(source.file))


def _check_shape(shape: tuple[int, ...], convention: str, name: str) -> None:
    if len(shape) != 3 or shape[2] != 3:
        raise InputError(f"an array of shape {list(shape)}", file=name, expected="[H, W, 3]")
    height, width = shape[:2]
    square = convention == "debevec-angular"
    if width != (height if square else 2 * height):
        raise InputError(
            f"the environment is {width} x {height}",
            file=name,
            expected=f"{'a square' if square else 'twice as wide as high'}, by its convention {convention!r}",
            hint="Is the convention right?",
        )

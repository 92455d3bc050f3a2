# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A material made ready to render: rays, texels, self-shadowing, blends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import F32, F64, I32, I64, U8, U32
from ..errors import InputError
from ..interreflection import IndirectLight, Reflecting, Surroundings, bounces_of, surroundings
from ..light import Environment
from ..material import Material
from ..observe import Lights
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..surface import Atlas, Mesh, RayScene, SkyMasks, build_atlas, fill_gutter, padded, sky_masks

SKY_SAMPLES = 64_000
"""Surface samples that share their self-shadow masks with the texels around them."""


@dataclass(frozen=True, eq=False)
class RelitScene:
    """What all frames of one material share."""

    mesh: Mesh
    rays: RayScene
    basis: GenericBasis
    representatives: F64
    """[N, J, 3]"""
    texel_of_pixel: I32
    """[H, W]: the texel at each atlas pixel, in the gutter the nearest one."""
    index: U8 | U32
    """[H, W, n], each pixel of the gutter as its nearest texel"""
    weight: F32
    """[H, W, n]"""
    sky: SkyMasks

    @classmethod
    def of(
        cls, material: Material, occluders: Sequence[Mesh] = (), progress: Progress = SILENT
    ) -> RelitScene:
        """Build from a material; ``occluders`` block light and sight but are not shown.

        Raises:
            InputError: the atlas is not square, or its texels are not those of the mesh's UVs.
        """
        mesh = Mesh(material.vertices, material.faces, material.normals, material.uv)
        height, width = material.coverage.shape
        if height != width:
            raise InputError(f"the atlas is {width} x {height}", expected="a square one")
        atlas = build_atlas(mesh, height)
        if not material.on_atlas.ravel()[atlas.pixel].all():
            raise InputError(
                "the blend does not cover the mesh's texels",
                expected="blend.exr and the mesh of one reconstruction",
            )
        rays = RayScene([mesh, *occluders])
        record = material.basis
        texel_of_pixel = padded(atlas)
        index, weight = material.index.copy(), material.weight.copy()
        for image in (index, weight):
            fill_gutter(image, atlas, texel_of_pixel)
        return cls(
            mesh=mesh,
            rays=rays,
            basis=GenericBasis.of(record),
            representatives=material.representatives,
            texel_of_pixel=texel_of_pixel,
            index=index,
            weight=weight,
            sky=sky_masks(rays, atlas, SKY_SAMPLES, progress),
        )

    @cached_property
    def atlas(self) -> Atlas:
        """The texels."""
        return build_atlas(self.mesh, self.texel_of_pixel.shape[0])

    @cached_property
    def around(self) -> Surroundings:
        """What of the object its points see."""
        return surroundings(self.rays, self.atlas, self.sky, self.texel_of_pixel)

    def indirect(
        self, environment: Environment, bounces: int, progress: Progress = SILENT
    ) -> IndirectLight | None:
        """What the object sends to itself under a light, of light reflected so many times; None for 0."""
        if bounces == 0:
            return None
        lights = Lights((environment,), np.zeros(1, np.int32), np.eye(3)[None])
        of_all = self.atlas, self.basis, self.representatives, self.index, self.weight, self.sky, lights
        return bounces_of(Reflecting(*of_all), self.around, bounces, progress)

    def blend_at(self, uv: F64) -> F32:
        """Representatives' weights [S, N] at UVs [S, 2], bilinear between texel centres.

        In the gutter the nearest texel stands in, so nothing bleeds in from beyond a chart's edge.
        """
        size = self.texel_of_pixel.shape[0]
        x, y = uv[:, 0] * size - 0.5, (1 - uv[:, 1]) * size - 0.5
        col, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        fx, fy = x - col, y - row
        found = np.zeros((len(uv), len(self.representatives)), np.float32)
        at = np.arange(len(uv))
        for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
            share = (fy if dy else 1 - fy) * (fx if dx else 1 - fx)
            pixel = np.clip(row + dy, 0, size - 1), np.clip(col + dx, 0, size - 1)
            index, weight = self.index[pixel], self.weight[pixel]
            for i in range(index.shape[1]):
                found[at, index[:, i]] += (share * weight[:, i]).astype(np.float32)
        return found

    def texel_at(self, uv: F64) -> I64:
        """The nearest texel [S] of UVs [S, 2]."""
        size = self.texel_of_pixel.shape[0]
        col = np.clip((uv[:, 0] * size).astype(np.int64), 0, size - 1)
        row = np.clip(((1 - uv[:, 1]) * size).astype(np.int64), 0, size - 1)
        return np.asarray(self.texel_of_pixel[row, col], dtype=np.int64)

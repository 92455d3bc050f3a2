# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One bounce: what the surface, as it is known, sends to the places that see it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np

from ..arrays import F32, F64, I32, I64, U8, U32, Float, dot, unit
from ..keeping import IN_MEMORY, Array, Keeper
from ..observe import Lights
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..response import Quadrature, log_rings, representative_responses
from ..surface import Atlas, SkyMasks, facing
from .light import IndirectLight
from .surroundings import SIDE, Surroundings

COARSE = Quadrature(
    layers=(log_rings(1e-3, 0.12, 10, 8), log_rings(0.007, 0.32, 8, 12), log_rings(0.025, 1.5, 8, 16)),
    bounds=(0.036, 0.125),
    bins=np.geomspace(0.006, 2.0, 60),
)
"""An eighth of the operator's lookups: a sky so blurred has no detail for more."""
SKY_BLUR = 16
"""Pixels along the side of the sky that the surface is lit by: what a cell mirrors is blurred as much."""
CELLS_AT_ONCE = 1 << 15
COSINES = np.array([0.03, 0.08, 0.15, 0.25, 0.35, 0.5, 0.7, 0.85, 1.0])
"""At which albedos are tabulated."""
STEEP = 0.7
"""Cosine from which on photographs determine what a material reflects."""
LOOKS = 4
"""Directions from which the light of the bounce before is looked at."""
LOOKED_AT = 0.6
"""Their cosine to the normal, near the mean over the hemisphere."""


@dataclass(frozen=True)
class Reflecting:
    """The surface as it is known: representatives blended at texels, under shadowed light."""

    atlas: Atlas
    basis: GenericBasis
    representatives: F64
    """[N, J, 3]"""
    index: U8 | U32
    """[H, W, n] representatives blended at each pixel of the atlas."""
    weight: F32
    """[H, W, n]"""
    sky: SkyMasks
    lights: Lights

    def blend(self, texel: I32 | I64) -> F32:
        """Weights [T, N] of texels."""
        pixel = self.atlas.pixel[texel]
        n = self.index.shape[-1]
        index, weight = self.index.reshape(-1, n)[pixel], self.weight.reshape(-1, n)[pixel]
        found = np.zeros((len(texel), len(self.representatives)), np.float32)
        at = np.arange(len(texel))
        for i in range(n):
            found[at, index[:, i]] += weight[:, i]
        return found

    @cached_property
    def trusted(self) -> F64:
        """Factors [N, C, 3] at COSINES, to hold representatives to the possible where no photograph looked.

        Most of the light that parts of an object lend each other leaves at a slant that no camera sees, and
        there a fit puts what it likes: kernels that are Fresnel's rise alone may be as large as they please.
        A representative's albedo is held to its largest at steep angles and that rise once; and to 1.
        """
        albedo = np.einsum("aj,njc->nac", albedos(self.basis), self.representatives)
        steep = albedo[:, COSINES >= STEEP].max(axis=1)[:, None]
        possible = np.minimum(steep + (1 - COSINES[:, None]) ** 5, 1)
        return np.asarray(np.minimum(possible / np.maximum(albedo, 1e-30), 1))

    def held(self, responses: F32, cosine: Float) -> F32:
        """Responses [P, N, 3] times those factors, at cosines [P] of normal and direction."""
        at = np.clip(np.interp(cosine, COSINES, np.arange(len(COSINES))), 0, len(COSINES) - 1)
        low = np.minimum(at.astype(np.int64), len(COSINES) - 2)
        part = (at - low)[:, None, None]
        factors = self.trusted.transpose(1, 0, 2)
        return np.asarray(responses * (factors[low] * (1 - part) + factors[low + 1] * part), np.float32)

    def respond(self, *where: object, quadrature: Quadrature) -> F32:
        """Responses of the representatives, as the operator takes its arguments."""
        return representative_responses(self.basis, self.representatives, *where, quadrature=quadrature)  # type: ignore[arg-type]


@lru_cache(maxsize=4)
def albedos(basis: GenericBasis) -> F64:
    """Of the kernels at COSINES, [C, J]."""
    return np.stack([basis.albedo(float(c)) for c in COSINES])


def bounced(
    surface: Reflecting,
    around: Surroundings,
    before: IndirectLight | None = None,
    progress: Progress = SILENT,
    keeper: Keeper = IN_MEMORY,
) -> IndirectLight:
    """Light from the surface: what the sky makes it show and, of the bounces before, what it reflects on.

    The latter is taken as the same towards all sides, from the mean over a few directions at each place.
    """

    def make() -> dict[str, Array]:
        return {"radiance": _sent(surface, around, before, progress)}

    kept = keeper.kept("light", make)
    of_frame = np.zeros(len(surface.lights.of_frame), np.int32)
    for g, (_, _, frames) in enumerate(surface.lights.groups()):
        of_frame[frames] = g
    return IndirectLight(around, kept.rows("radiance"), of_frame)


def _sent(surface: Reflecting, around: Surroundings, before: IndirectLight | None, progress: Progress) -> F32:
    """[G, E, 3]: what each cell receives under each light."""
    groups = list(surface.lights.groups())
    radiance = np.empty((len(groups), len(around.cell), 3), np.float32)
    parts = [slice(i, i + CELLS_AT_ONCE) for i in range(0, len(around.cell), CELLS_AT_ONCE)]
    with progress.stage("Bouncing light", len(groups) * len(parts)) as task:
        for g, (_, _, frames) in enumerate(groups):
            frame = int(np.argmax(frames))
            glow = None if before is None else _glow(surface, around, before, frame)
            for part in parts:
                radiance[g, part] = _shown(surface, around, part, frame, glow)
                task.advance()
        radiance[g] = _evened(around, radiance[g])
    return radiance


def bounces_of(
    surface: Reflecting, around: Surroundings, count: int, progress: Progress = SILENT
) -> IndirectLight:
    """Light from the surface after up to ``count`` reflections of the sky's, ``count`` from 1 on."""
    light = bounced(surface, around, None, progress)
    for _ in range(1, count):
        light = bounced(surface, around, light, progress)
    return light


def _shown(surface: Reflecting, around: Surroundings, part: slice, frame: int, glow: F32 | None) -> F32:
    """Radiance [E, 3] that cells receive in a frame's light."""
    seen, towards = around.seen[part], -around.direction[part]
    normal = facing(around.normal[part].astype(np.float64), towards.astype(np.float64)).astype(np.float32)
    responses = surface.lights.each(
        np.full(len(seen), frame, np.int32),
        normal,
        towards,
        surface.sky,
        seen,
        len(surface.representatives),
        partial(surface.respond, quadrature=COARSE),
        sky_size=SKY_BLUR,
    )
    responses = surface.held(responses, dot(normal, towards))
    if glow is not None:
        place = around.place_of[seen]
        lit = np.flatnonzero(place >= 0)
        responses[lit] += glow[place[lit]]
    # Rounding leaves what is black a hair below 0.
    shown = np.einsum("en,enc->ec", surface.blend(seen), responses)
    return np.asarray(np.maximum(shown, 0), np.float32)


def _evened(around: Surroundings, radiance: F32) -> F32:
    """Radiance of cells [E, 3] as the mean over the places beside, weighted by how much is hidden there."""
    size = SIDE * SIDE
    place = np.repeat(np.arange(len(around)), np.diff(around.offsets))
    dense = np.zeros((len(around) * size, 4), np.float32)
    dense[place * size + around.cell, :3] = radiance * around.share[:, None]
    dense[place * size + around.cell, 3] = around.share
    total = np.zeros((len(place), 4), np.float32)
    for beside in around.beside.T:
        total += dense[beside[place].astype(np.int64) * size + around.cell]
    return np.asarray(total[:, :3] / total[:, 3:])


def _glow(surface: Reflecting, around: Surroundings, before: IndirectLight, frame: int) -> F32:
    """What each representative would show of the light before [C, N, 3], as a mean over LOOKS directions."""
    normal = surface.atlas.normal(around.texel).astype(np.float64)
    across = unit(np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.7, [1.0, 0, 0], [0, 1.0, 0])))
    beside = np.cross(normal, across)
    angle = 2 * np.pi * (np.arange(LOOKS) + 0.5) / LOOKS
    sine = np.sqrt(1 - LOOKED_AT**2)
    ring = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * beside[:, None]
    towards = LOOKED_AT * normal[:, None] + sine * ring
    count = len(around) * LOOKS
    found = before.responses(
        np.full(count, frame, np.int32),
        np.repeat(around.texel, LOOKS),
        np.repeat(normal, LOOKS, axis=0),
        towards.reshape(-1, 3),
        len(surface.representatives),
        surface.respond,
    )
    by_place = found.reshape(len(around), LOOKS, len(surface.representatives), 3)
    return surface.held(by_place.mean(axis=1), np.full(len(around), LOOKED_AT))

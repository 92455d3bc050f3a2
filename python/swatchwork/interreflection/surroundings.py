# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What of the object a point of its surface sees: the cells of its sky that the object hides, and with what.

It depends on the shape alone, and is found once for all lights, materials and rounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import F32, F64, I32, I64, Bool, dot, unit
from ..keeping import IN_MEMORY, Array, Keeper
from ..octahedral import pixel_directions
from ..progress import SILENT, Progress
from ..surface import LIFT, SKY_SIDE, Atlas, RayScene, SkyMasks, each_of, places_of, shared_samples, unpacked

SIDE = 16
"""Cells along the octahedral square in which light from the object is kept; each is 4 x 4 cells of a mask."""
PLACES = 16_000
"""Points of the surface whose surroundings texels nearby share."""
LEAST = 0.003
"""Share of the cosine-weighted sky below which what the object hides of it counts as nothing."""
BESIDE = 4
"""Nearest places whose rays into a cell count as well, for one ray is a noisy mean."""
AT_ONCE = 128
"""Places that a thread looks around from at once: a bit of a mask takes a byte on the way."""


@dataclass(frozen=True)
class Surroundings:
    """What C places see of the object, cell by cell: E cells in all, those of place c from ``offsets[c]`` on.

    ``place_of`` I32[M]: the place whose surroundings a texel shares, -1 where hardly anything of the object
    is in its sky. ``texel`` I64[C] where the places lie; ``beside`` I32[C, B] each one and its nearest
    others; ``offsets`` I64[C + 1]. Of each cell: ``cell`` I32[E], row * SIDE + column of the octahedral
    square; ``share`` F32[E], how much of it the object hides; ``direction`` F32[E, 3], unit, from the place
    to what is seen there; ``seen`` I32[E], that point's texel, and ``normal`` F32[E, 3], its shading normal.
    """

    place_of: I32
    texel: I64
    beside: I32
    offsets: I64
    cell: I32
    share: F32
    direction: F32
    seen: I32
    normal: F32

    def __len__(self) -> int:
        return len(self.texel)


def surroundings(
    scene: RayScene,
    atlas: Atlas,
    sky: SkyMasks,
    texel_of_pixel: I32,
    *,
    places: int = PLACES,
    progress: Progress = SILENT,
    keeper: Keeper = IN_MEMORY,
) -> Surroundings:
    """Look around from about ``places`` texels, into the cells that their sky masks say are hidden.

    One ray a cell. Occluders hide, but what they reflect is not known and counts as nothing.

    Args:
        texel_of_pixel: I32[H, W] the texel at each pixel of the atlas, in the gutter the nearest one.
    """

    def make() -> dict[str, Array]:
        with progress.stage("Looking around"):
            return vars(_looked(scene, atlas, sky, texel_of_pixel, places))

    kept = keeper.kept("surroundings", make)
    return Surroundings(**{name: kept.rows(name) for name in Surroundings.__dataclass_fields__})


def _looked(scene: RayScene, atlas: Atlas, sky: SkyMasks, texel_of_pixel: I32, places: int) -> Surroundings:
    chosen, owner = shared_samples(scene, atlas, places)
    shut = sky.of_texel[chosen] >= 0
    texel = chosen[shut]
    number = np.full(len(chosen), -1, np.int32)

    def look(part: slice) -> dict[str, Array]:
        return _cells(scene, atlas, sky, texel_of_pixel, texel[part], part.start)

    parts = each_of(look, len(texel), AT_ONCE)
    none = _cells(scene, atlas, sky, texel_of_pixel, texel[:0], 0)
    found = {name: np.concatenate([part[name] for part in (none, *parts)]) for name in none}
    # Places that see next to nothing are left out.
    place = found.pop("place")
    cosine = np.maximum(dot(atlas.normal(texel)[place], found["direction"]), 0)
    hidden = np.bincount(place, found["share"] * cosine * 4 / SIDE**2, minlength=len(texel))
    kept = hidden >= LEAST
    found = {name: values[kept[place]] for name, values in found.items()}
    counts = np.bincount(place, minlength=len(texel))[kept]
    number[shut] = np.where(kept, np.cumsum(kept) - 1, -1)
    texel = texel[kept]
    return Surroundings(
        place_of=number[owner],
        texel=texel,
        beside=_beside(scene, atlas, texel),
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        **found,
    )


def _beside(scene: RayScene, atlas: Atlas, texel: I64) -> I32:
    """Each place and its nearest others [C, B], in position and normal."""
    if not len(texel):
        return np.zeros((0, 1), np.int32)
    where = places_of(scene, atlas, texel)
    nearest = np.arange(1, min(BESIDE + 1, len(texel)) + 1)
    return np.asarray(cKDTree(where).query(where, nearest)[1], np.int32)


def _cells(
    scene: RayScene, atlas: Atlas, sky: SkyMasks, texel_of_pixel: I32, texel: I64, first: int
) -> dict[str, Array]:
    """The hidden cells of some places, numbered from ``first`` on, and what a ray into each meets."""
    place, cell, share, fine = _hidden(~unpacked(sky.words[sky.of_texel[texel]]), first)
    at = texel[place]
    upright = atlas.geometric_normal(at)
    direction = pixel_directions(SKY_SIDE).reshape(-1, 3)[fine]
    # As the masks' own rays: what points below the triangle's plane is bent up to it.
    sine = dot(direction, upright)
    low = np.flatnonzero(sine < LIFT)
    direction[low] += (LIFT - sine[low])[:, None] * upright[low]
    direction = unit(direction)
    hit = scene.first_hit(atlas.position(at) + scene.epsilon * upright, direction)
    # Masks are shared, so that a ray may slip past; and the back of an open mesh is not known.
    met = np.flatnonzero(hit.mesh == 0)
    met = met[dot(scene.face_normal[hit.face[met]], direction[met]) < 0]
    face, bary, mesh = hit.face[met], hit.bary[met], scene.meshes[0]
    corners = mesh.faces[face]
    assert mesh.uv is not None, "the atlas was made from them"
    seen = _texel_at(np.einsum("ec,ecx->ex", bary, mesh.uv[corners]), texel_of_pixel)
    normal = unit(np.einsum("ec,ecx->ex", bary, mesh.normals[corners]))
    return {
        "place": place[met] + first,
        "cell": cell[met].astype(np.int32),
        "share": share[met],
        "direction": direction[met].astype(np.float32),
        "seen": seen.astype(np.int32),
        "normal": normal.astype(np.float32),
    }


def _hidden(hidden: Bool, first: int) -> tuple[I64, I64, F32, I64]:
    """Place, cell and hidden share of cells of SIDE x SIDE, and the mask's cell that a ray is sent into."""
    per_side = SKY_SIDE // SIDE
    blocks = hidden.reshape(-1, SIDE, per_side, SIDE, per_side).swapaxes(2, 3)
    blocks = blocks.reshape(len(hidden), SIDE * SIDE, per_side**2)
    count = blocks.sum(axis=2)
    place, cell = np.nonzero(count)
    # Of a cell's hidden parts one place takes this and the next that, so that neighbours even it out.
    turn = (5 * (place + first) + 3 * cell) % count[place, cell]
    part = (np.cumsum(blocks[place, cell], axis=1) > turn[:, None]).argmax(axis=1)
    row = cell // SIDE * per_side + part // per_side
    column = cell % SIDE * per_side + part % per_side
    return place, cell, (count[place, cell] / per_side**2).astype(np.float32), row * SKY_SIDE + column


def _texel_at(uv: F64, texel_of_pixel: I32) -> I32:
    size = texel_of_pixel.shape[0]
    col = np.clip((uv[:, 0] * size).astype(np.int64), 0, size - 1)
    row = np.clip(((1 - uv[:, 1]) * size).astype(np.int64), 0, size - 1)
    return np.asarray(texel_of_pixel[row, col])

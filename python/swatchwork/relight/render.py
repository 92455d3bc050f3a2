# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Shading: every sample's representatives under the light, blended (Eqs. 3 and 14)."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..arrays import F32, unit
from ..capture import Camera
from ..interreflection import IndirectLight
from ..light import Environment
from ..response import representative_responses
from ..surface import facing
from .scene import RelitScene
from .view import View, see, surface_at

CELLS_AT_ONCE = 1 << 15


def render(
    scene: RelitScene,
    camera: Camera,
    environment: Environment,
    samples: int = 2,
    indirect: IndirectLight | None = None,
) -> F32:
    """An image [H, W, 4]: linear RGB premultiplied by coverage A, background 0.

    Args:
        scene: the material.
        camera: pinhole with or without lens distortion.
        environment: distant light.
        samples: shadings along a pixel's side at edges; inside, half as many.
        indirect: what ``scene.indirect`` gives for that light, to render interreflections.
    """
    return shade(scene, see(scene.rays, camera, samples), environment, indirect)


def shade(
    scene: RelitScene, view: View, environment: Environment, indirect: IndirectLight | None = None
) -> F32:
    """Light a view, as `render`; the view may be kept for another light."""
    size = view.camera.width * view.camera.height
    image = np.zeros((size, 3))
    for start in range(0, len(view.pixel), CELLS_AT_ONCE):
        cells = slice(start, min(start + CELLS_AT_ONCE, len(view.pixel)))
        radiance = _radiance(scene, view, cells, environment, indirect) * view.share[cells, None]
        for c in range(3):
            image[:, c] += np.bincount(view.pixel[cells], radiance[:, c], minlength=size)
    colour = image.reshape(view.camera.height, view.camera.width, 3).astype(np.float32)
    return np.concatenate([colour, view.alpha[..., None]], axis=-1)


def _radiance(
    scene: RelitScene, view: View, cells: slice, environment: Environment, indirect: IndirectLight | None
) -> F32:
    """Radiance [G, 3] of cells: one shading each, of the mean of its hits."""
    offsets = view.offsets[cells.start : cells.stop + 1]
    hits, first = slice(offsets[0], offsets[-1]), offsets[:-1] - offsets[0]
    face, bary = view.face[hits], view.bary[hits]
    _, normal, to_viewer = surface_at(scene.mesh, view.camera, face, bary)
    assert scene.mesh.uv is not None
    uv = np.einsum("sc,scx->sx", bary, scene.mesh.uv[scene.mesh.faces[face]])
    viewer = unit(np.add.reduceat(to_viewer, first))
    upright = facing(unit(np.add.reduceat(normal, first)), viewer)
    texel = scene.texel_at(uv[first])
    respond = partial(representative_responses, scene.basis, scene.representatives)
    sky = scene.sky
    responses = respond(environment.pyramid(), upright, viewer, sky.words, sky.of_texel[texel])
    if indirect is not None:
        light = np.zeros(len(texel), np.int32)
        responses += indirect.responses(light, texel, upright, viewer, len(scene.representatives), respond)
    blend = np.add.reduceat(scene.blend_at(uv), first) / np.diff(offsets)[:, None]
    return np.asarray(np.einsum("gn,gnc->gc", blend, responses), dtype=np.float32)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Pictures of a material and of what it should look like, ready for the page."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from .. import report as page
from ..arrays import F32, F64, U8, Bool, unit
from ..capture import Camera, Photograph
from ..light import Environment
from ..material import Material, expected_error, material_maps
from ..reflectance import GenericBasis
from ..response import representative_responses
from ..surface import Mesh

PICTURE_PX = 300
SPHERE_PX = 168
MAP_PX = 512
WORST = 0.3
"""Expected relative error that the top colour of its map stands for."""
ERROR_SCALE = 0.3
"""Error, as a fraction of the reference's RMS, that the top colour of a heat map stands for."""


def compare_pictures(
    name: str,
    reference: F32,
    alpha: F32,
    rendered: F32,
    *,
    valid: Bool | None = None,
    words: tuple[str, str] = ("photograph", "recovered"),
) -> tuple[page.Comparison, float]:
    """Both pictures at one exposure, cropped to the object, with their difference; and that exposure.

    ``reference`` [H, W, 3] and ``rendered`` [H, W, 4] are linear and premultiplied; ``alpha`` [H, W] is the
    reference's, or 1 everywhere where it has none.
    """
    coverage = np.minimum(alpha, rendered[..., 3])
    mask = coverage > 0.5
    if valid is not None:
        mask &= valid
    exposure = page.exposure_for(reference, coverage)
    rows, columns = page.crop_box(np.asarray(coverage, dtype=np.float32))
    error = page.relative_error(rendered, reference, mask)
    b = reference[mask].astype(np.float64)
    nrms = float(np.sqrt(((rendered[..., :3][mask] - b) ** 2).sum() / max(float((b**2).sum()), 1e-30)))

    def picture(caption: str, pixels: U8) -> page.Picture:
        return page.Picture(caption, page.shrink(pixels[rows, columns], PICTURE_PX))

    comparison = page.Comparison(
        name,
        picture(words[0], page.display(reference, alpha, exposure)),
        picture(words[1], page.display(rendered[..., :3], rendered[..., 3], exposure)),
        picture("difference", page.heat(error, mask, ERROR_SCALE)),
        nrms,
    )
    return comparison, exposure


def alone(caption: str, rendered: F32) -> page.Picture:
    """A picture [H, W, 4], linear and premultiplied, at its own exposure, cropped to the object."""
    colour, alpha = rendered[..., :3], rendered[..., 3]
    rows, columns = page.crop_box(alpha)
    pixels = page.display(colour, alpha, page.exposure_for(colour, alpha))
    return page.Picture(caption, page.shrink(pixels[rows, columns], PICTURE_PX))


def at_page_size(photograph: Photograph, camera: Camera, mesh: Mesh) -> tuple[Photograph, Camera]:
    """A photograph and its camera, area-averaged until the object is no wider than the page shows it."""
    uv, depth = camera.project(mesh.vertices)
    side = float(np.ptp(uv, axis=0).max()) if (depth > 0).all() else max(camera.width, camera.height)
    scale = PICTURE_PX / (1.1 * side) if np.isfinite(side) else 1.0
    if scale >= 1:
        return photograph, camera
    width, height = round(camera.width * scale), round(camera.height * scale)
    x, y = width / camera.width, height / camera.height

    def smaller(image: F32) -> F32:
        return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), dtype=np.float32)

    small = Photograph(
        np.nan_to_num(smaller(np.where(photograph.valid[..., None], photograph.radiance, 0))),
        smaller(photograph.alpha),
        smaller(photograph.valid.astype(np.float32)) > 0.999,
    )
    return small, replace(
        camera,
        width=width,
        height=height,
        fx=camera.fx * x,
        fy=camera.fy * y,
        cx=camera.cx * x,
        cy=camera.cy * y,
    )


def spheres(
    basis: GenericBasis, material: Material, camera: Camera, light: Environment, exposure: float
) -> tuple[page.Picture, ...]:
    """Each representative on an unshadowed sphere, seen from afar along the camera's axis."""
    axis = (np.arange(SPHERE_PX) + 0.5) / (SPHERE_PX / 2) - 1
    x, y = np.meshgrid(axis, -axis)
    r = np.hypot(x, y)
    # Coverage falls from 1 to 0 over the pixel at the rim; shading is one sample a pixel.
    alpha = np.clip((1 - r) * SPHERE_PX / 2 + 0.5, 0, 1)
    inside, shrunk = alpha > 0, np.minimum(1, 0.999 / np.maximum(r, 1e-9))
    x, y = x * shrunk, y * shrunk
    n_in_camera = unit(np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)[inside])
    world_from_camera: F64 = camera.world_from_camera[:3, :3]
    normal = np.asarray(n_in_camera @ world_from_camera.T, dtype=np.float32)
    viewer = np.ascontiguousarray(np.broadcast_to(world_from_camera[:, 2], normal.shape), dtype=np.float32)
    shaded = representative_responses(basis, material.representatives, light.pyramid(), normal, viewer)
    share = material.shares
    pictures = []
    for i in range(material.N):
        pixels = np.zeros((*inside.shape, 4), dtype=np.float32)
        pixels[inside, :3], pixels[..., 3] = shaded[:, i] * alpha[inside, None], alpha
        caption = f"{i + 1}: {100 * share[i]:.0f} % of the surface"
        if material.spread is not None:
            caption += f", known to {100 * material.spread[i]:.1f} %"
        pictures.append(page.Picture(caption, page.display(pixels[..., :3], pixels[..., 3], exposure)))
    return tuple(pictures)


def thinned(material: Material) -> Material:
    """Every s-th texel along both sides, s as large as leaves no fewer than the page shows."""
    s = max(1, min(material.coverage.shape) // MAP_PX)
    # Its error model is of whole atlases, whose neighbours are neighbours.
    return replace(
        material,
        trust=None,
        index=material.index[::s, ::s],
        weight=material.weight[::s, ::s],
        coverage=material.coverage[::s, ::s],
        residual=material.residual[::s, ::s],
    )


def blend_picture(material: Material) -> page.Picture:
    """Which representative is where, in the colours of the page's dots."""
    weight = np.where(material.on_atlas[..., None], material.weight, 0)
    pixels = page.blend_colours(material.index, weight, material.N)
    return page.Picture("which material is where", page.shrink(pixels, MAP_PX), crisp=True)


def coverage_picture(material: Material) -> page.Picture:
    """How many views saw each texel."""
    most = max(int(material.coverage.max()), 1)
    pixels = page.heat(np.maximum(material.coverage, 0), material.on_atlas, most)
    return page.Picture(
        f"photographs of each point, 0 (dark) to {most}", page.shrink(pixels, MAP_PX), crisp=True
    )


def trust_picture(material: Material) -> page.Picture:
    """The error to expect, of a whole material."""
    s = max(1, min(material.coverage.shape) // MAP_PX)
    coverage = material.coverage[::s, ::s]
    error = expected_error(material, s)
    pixels = page.heat(error, coverage >= 0, WORST)
    caption = f"error to expect in another view, 0 (dark) to {100 * WORST:.0f} % or never seen (bright)"
    return page.Picture(caption, page.shrink(pixels, MAP_PX), crisp=True)


def map_pictures(material: Material) -> tuple[page.Picture, ...]:
    """The maps of the paper's Fig. 15."""
    maps, here = material_maps(material), material.on_atlas
    pictures = []
    for name, values in (("diffuse albedo", maps.diffuse), ("specular albedo", maps.specular)):
        pixels = page.display(values, here.astype(np.float32), 1.0)
        pictures.append(page.Picture(name, page.shrink(pixels, MAP_PX), crisp=True))
    for name, plain in (("roughness, 0 to 0.5", maps.roughness / 0.5), ("Fresnel tau, 0 to 1", maps.tau)):
        pixels = page.display(np.repeat(plain[..., None] ** 2.2, 3, axis=-1), here.astype(np.float32), 1.0)
        pictures.append(page.Picture(name, page.shrink(pixels, MAP_PX), crisp=True))
    return tuple(pictures)

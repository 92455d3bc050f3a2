# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Arrays as blocks of text: quantised, ordered so that they deflate well, deflated, base64.

``web/src/data.js`` reads what this writes; a block says by its ``coding`` what was done to it.
"""

from __future__ import annotations

import base64
import io
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from ..arrays import F32, F64, I32, U8, U16, U64, Bool
from ..capture import Camera
from ..errors import InputError
from ..light import Environment
from ..reflectance import DIFFUSE_KERNELS, DIFFUSE_SHAPES, GenericBasis
from ..relight import RelitScene
from ..surface import SkyMasks, build_atlas
from .scene import Shot, TexelMap, ViewerScene

Array = npt.NDArray[Any]

MOST_REPRESENTATIVES = 65536
"""The page keeps a representative's number in half of a word of 32 bits, the weight in the other."""


@dataclass
class Blocks:
    """Named blocks, and what a reader must know of each."""

    text: dict[str, str] = field(default_factory=dict)
    about: dict[str, dict[str, Any]] = field(default_factory=dict)

    def add(self, name: str, array: Array, coding: str = "plain") -> str:
        """Keep an array; ``delta`` keeps differences along the first axis."""
        array = np.ascontiguousarray(array)
        coded = array
        if coding == "delta":
            coded = np.diff(array, axis=0, prepend=np.zeros_like(array[:1]))
        self.about[name] = {"type": array.dtype.name, "shape": list(array.shape), "coding": coding}
        self.text[name] = base64.b64encode(deflated(planes(coded))).decode("ascii")
        return name

    def add_file(self, name: str, data: bytes) -> str:
        """Keep a file that is compressed already."""
        self.about[name] = {"type": "file"}
        self.text[name] = base64.b64encode(data).decode("ascii")
        return name


def planes(array: Array) -> bytes:
    """First all first bytes of the numbers, then all second ones: high bytes repeat and deflate well."""
    little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    return np.ascontiguousarray(little.view(np.uint8).reshape(-1, array.itemsize).T).tobytes()


def deflated(data: bytes) -> bytes:
    """Raw deflate, as browsers' DecompressionStream reads it."""
    packer = zlib.compressobj(6, zlib.DEFLATED, -15)
    return packer.compress(data) + packer.flush()


def pack(viewer: ViewerScene) -> tuple[dict[str, Any], Blocks]:
    """The page's head, as JSON holds it, and its blocks."""
    scene, blocks = viewer.scene, Blocks()
    on = on_atlas(scene)
    centre = np.asarray(scene.rays.centre, np.float64)
    head: dict[str, Any] = {
        "title": viewer.title,
        "version": viewer.version,
        "up": up_axis([shot.camera for shot in viewer.shots]),
        "centre": centre.tolist(),
        "radius": float(np.linalg.norm(scene.mesh.vertices - centre, axis=1).max()),
        "mesh": _mesh(blocks, scene),
        "atlas": _atlas(blocks, scene, on),
        "material": _material(scene) | {"colours": list(viewer.colours), "notes": list(viewer.notes)},
        "lights": [_light(blocks, i, light.name, light.environment) for i, light in enumerate(viewer.lights)],
        "shots": [_shot(blocks, i, shot) for i, shot in enumerate(viewer.shots)],
        "maps": [_map(blocks, i, found, on) for i, found in enumerate(viewer.maps)],
    }
    head["blocks"] = blocks.about
    return head, blocks


def up_axis(cameras: list[Camera]) -> list[float]:
    """The world's axis that cameras agree is up: the one nearest to the mean of theirs; z for none."""
    mean = np.sum([camera.world_from_camera[:3, 1] for camera in cameras], axis=0) if cameras else [0, 0, 1]
    axis = np.zeros(3)
    largest = int(np.argmax(np.abs(mean)))
    axis[largest] = 1.0 if mean[largest] >= 0 else -1.0
    return [float(x) for x in axis]


def _mesh(blocks: Blocks, scene: RelitScene) -> dict[str, Any]:
    """Positions to 1/65535 of the bounding box, UVs to 1/65535, normals to 1/32767 of each component."""
    mesh = scene.mesh
    assert mesh.uv is not None
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    size = np.maximum(high - low, 1e-30)
    position = np.round((mesh.vertices - low) / size * 65535).astype(np.uint16)
    uv = np.round(np.clip(mesh.uv, 0, 1) * 65535).astype(np.uint16)
    blocks.add("position", position, "delta")
    blocks.add("normal", np.round(mesh.normals * 32767).astype(np.int16), "delta")
    blocks.add("uv", uv, "delta")
    blocks.add("faces", mesh.faces.astype(np.int32).reshape(-1, 3), "delta")
    return {"low": low.tolist(), "size": size.tolist()}


def _atlas(blocks: Blocks, scene: RelitScene, on: Bool) -> dict[str, Any]:
    """Blends of texels and their shadow masks, texel after texel; the page fills the gutter itself."""
    size, n = scene.texel_of_pixel.shape[0], scene.index.shape[-1]
    index, weight = scene.index[on], scene.weight[on]
    N = len(scene.representatives)
    if N > MOST_REPRESENTATIVES:
        raise InputError(
            f"{N} representatives are too many for a page", expected=f"at most {MOST_REPRESENTATIVES}"
        )
    blocks.add("on", np.packbits(on, bitorder="little"))
    for i in range(n):
        blocks.add(f"index.{i}", index[:, i].astype(np.uint8 if N <= 256 else np.uint16))
        # The last weight is what the others leave of 1.
        if i < n - 1:
            blocks.add(f"weight.{i}", quantised(weight[:, i]), "delta")
    sky: SkyMasks = scene.sky
    used, row = mask_bytes(sky)
    blocks.add("sky", used)
    texel = scene.texel_of_pixel[on]
    blocks.add("sky_row", (row[texel] + 1).astype(np.int32), "delta")
    return {"size": size, "n": n, "texels": int(on.sum()), "masks": len(used)}


def on_atlas(scene: RelitScene) -> Bool:
    """Which pixels [H, W] of the atlas are texels; the others repeat one."""
    size = scene.texel_of_pixel.shape[0]
    on = np.zeros(size * size, dtype=bool)
    on[build_atlas(scene.mesh, size).pixel] = True
    return on.reshape(size, size)


def quantised(weight: F32) -> U16:
    """Weights in [0, 1] as 16 bits."""
    return np.round(np.clip(weight, 0, 1) * 65535).astype(np.uint16)


def mask_bytes(sky: SkyMasks) -> tuple[U8, I32]:
    """The masks as bytes [Q, 512], and each texel's row of them or -1."""
    words: U64 = sky.words
    return np.ascontiguousarray(words.astype("<u8")).view(np.uint8).reshape(len(words), 512), sky.of_texel


def _material(scene: RelitScene) -> dict[str, Any]:
    """Representatives folded as far as no ring is needed: by masking, Fresnel term, roughness; by shapes."""
    basis: GenericBasis = scene.basis
    N, lobes = len(scene.representatives), len(basis.lobes)
    albedo = basis.albedo(1.0)
    specular = scene.representatives[:, :lobes].reshape(
        N, len(basis.maskings) * len(basis.fresnel), len(basis.sigmas), 3
    )
    return {
        "basis": basis.name,
        "N": N,
        "sigmas": basis.sigmas.tolist(),
        "maskings": list(basis.maskings),
        "fresnel": list(basis.fresnel),
        "specular": specular.tolist(),
        "diffuse": diffuse_by_shape(basis, scene.representatives[:, lobes:]).tolist(),
        "albedo": {
            "diffuse": np.einsum("j,njc->nc", albedo[lobes:], scene.representatives[:, lobes:]).tolist(),
            "specular": np.einsum("j,njc->nc", albedo[:lobes], scene.representatives[:, :lobes]).tolist(),
        },
    }


def diffuse_by_shape(basis: GenericBasis, weights: F64) -> F64:
    """[N, A, A, 3]: coefficients over products of a shape of n.i and a shape of n.o (`DIFFUSE_SHAPES`)."""
    shapes = list(DIFFUSE_SHAPES)
    found = np.zeros((len(weights), len(shapes), len(shapes), 3))
    for k, name in enumerate(basis.diffuse):
        for of_light, of_viewer in DIFFUSE_KERNELS[name]:
            found[:, shapes.index(of_light), shapes.index(of_viewer)] += weights[:, k]
    return found


def _light(blocks: Blocks, number: int, name: str, light: Environment) -> dict[str, Any]:
    """Half precision after division by a power of two that brings the brightest pixel just below 2^15."""
    height, width = light.radiance.shape[:2]
    lit = np.where(light.solid_angles[..., None] > 0, np.nan_to_num(light.radiance), 0)
    unit = float(2.0 ** (np.ceil(np.log2(max(float(lit.max()), 1e-30))) - 15))
    blocks.add(f"light.{number}", (lit / unit).astype(np.float16).view(np.uint16), "delta")
    return {
        "name": name,
        "block": f"light.{number}",
        "width": width,
        "height": height,
        "unit": unit,
        "convention": light.convention,
        "turn": light.world_from_environment.tolist(),
        "mean": float(light.mean_radiance.mean()),
    }


def _shot(blocks: Blocks, number: int, shot: Shot) -> dict[str, Any]:
    c = shot.camera
    return {
        "name": shot.name,
        "block": blocks.add_file(f"shot.{number}", webp(shot.pixels)),
        "white": shot.white,
        "light": shot.light,
        "turn": np.asarray(shot.turn).tolist(),
        "camera": {
            "width": c.width, "height": c.height, "fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy,
            "pose": c.world_from_camera.tolist(),
        },
    }  # fmt: skip


def webp(pixels: U8) -> bytes:
    """A WebP of quality 88."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "WEBP", quality=88, alpha_quality=88)
    return file.getvalue()


def _map(blocks: Blocks, number: int, found: TexelMap, on: Bool) -> dict[str, Any]:
    """8 bits a texel: 0 is none, 1 to 255 are 0 to the top and above."""
    values = found.values[on]
    shown = np.round(1 + 254 * np.clip(np.nan_to_num(values) / found.top, 0, 1))
    blocks.add(f"map.{number}", np.where(np.isfinite(values), shown, 0).astype(np.uint8))
    return {"name": found.name, "block": f"map.{number}", "top": found.top, "unit": found.unit}

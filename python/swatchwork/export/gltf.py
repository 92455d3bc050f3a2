# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A binary glTF 2.0 file: mesh, and textures of the fitted metallic-roughness parameters.

Row 0 of an image is v = 0 in glTF, of our atlas v = 1: v is flipped, images are not. Base colour and specular
colour are sRGB-coded, everything else is linear; roughness is perceptual, its square is GGX's alpha. Numbers
are what 8 bits hold.
"""

from __future__ import annotations

import json
import struct
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import F64, unit
from ..errors import InputError, OutputError
from ..keeping import Array
from ..material import Material
from ..whole import whole_file
from .fitting import StandardFit
from .standard import IOR
from .surroundings import UP, Up
from .textures import Padding, eight_bits, png_bytes, srgb_coded

FLOAT, UNSIGNED_INT = 5126, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071
GENERATOR = "swatchwork"
Z_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Rotation (x, y, z, w) that lays a world whose z is up into glTF's, whose y is."""


def glb_bytes(
    material: Material, fit: StandardFit, padding: Padding, *, up: Up = UP, name: str = "object"
) -> bytes:
    """The file's content; ``up`` is the world's axis that points up, as glTF's y does."""
    made = _Builder()
    position = made.array(material.vertices, "VEC3", ARRAY_BUFFER, bounds=True)
    normal = unit(material.normals)
    normal[~(np.abs(np.linalg.norm(normal, axis=1) - 1) < 1e-6)] = [0, 0, 1]
    uv = np.stack([material.uv[:, 0], 1 - material.uv[:, 1]], axis=-1)
    primitive = {
        "attributes": {
            "POSITION": position,
            "NORMAL": made.array(normal, "VEC3", ARRAY_BUFFER),
            "TEXCOORD_0": made.array(uv, "VEC2", ARRAY_BUFFER),
        },
        "indices": made.array(material.faces, "SCALAR", ELEMENT_ARRAY_BUFFER),
        "material": 0,
    }
    images, specular_scale = coded_textures(fit, padding)
    textures = {key: made.texture(key, pixels) for key, pixels in images.items()}
    node: dict[str, Any] = {"mesh": 0, "name": name} | ({"rotation": Z_UP} if up == "z" else {})
    specular = {
        "specularFactor": 1.0,
        "specularTexture": {"index": textures["specular"]},
        "specularColorFactor": [specular_scale] * 3,
        "specularColorTexture": {"index": textures["specular"]},
    }
    document = {
        "asset": {"version": "2.0", "generator": f"{GENERATOR} {version('swatchwork')}"},
        "extensionsUsed": ["KHR_materials_ior", "KHR_materials_specular"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"primitives": [primitive], "name": name}],
        "materials": [
            {
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": textures["base_colour"]},
                    "metallicRoughnessTexture": {"index": textures["metallic_roughness"]},
                },
                "extensions": {"KHR_materials_ior": {"ior": IOR}, "KHR_materials_specular": specular},
                "extras": {"rendered_loss_nrms": fit.loss_nrms, "base_colour_clipped": fit.clipped},
            }
        ],
        **made.tables(),
    }
    return _container(document, bytes(made.binary))


def glb_file(path: Path, material: Material, fit: StandardFit, padding: Padding, **how: Any) -> None:
    """Write NAME.glb, whole or not at all, where nothing is or an older one of ours; see `glb_bytes`.

    Raises:
        InputError: another file is in the way.
        OutputError: it cannot be written.
    """
    check_glb_free(path)
    content = glb_bytes(material, fit, padding, **how)
    with whole_file(path) as made:
        made.write_bytes(content)


def check_glb_free(path: Path) -> None:
    """Raise InputError where something else than an older .glb of ours is in the way.

    Raises:
        InputError: so it is.
        OutputError: it cannot be read to find out.
    """
    try:
        free = not path.exists() or (path.is_file() and written_by_us(path.read_bytes()))
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be replaced, for whether swatchwork wrote it cannot be read ({error.strerror})"
        ) from error
    if not free:
        raise InputError(
            "exists and was not written by swatchwork",
            file=path,
            expected="a new file, or an older export",
            hint="Nothing was written: choose another name, or move it away",
        )


def coded_textures(fit: StandardFit, padding: Padding) -> tuple[dict[str, Array], float]:
    """Images by name in 8 bits, and the factor of the specular colour: the image's largest value is 1."""
    p, of = fit.parameters, fit.blend_of_texel
    # Where there is no specular part, its colour means nothing and must not set the scale.
    colour = np.where(p.specular[:, None] > 1e-3, p.specular_colour, 0)
    scale = max(float(colour.max()), 1e-6)
    base = srgb_coded(p.base_colour)
    # Red is for occlusion, where a program packs it there: none.
    rough = eight_bits(np.stack([np.ones_like(p.roughness), p.roughness, p.metallic], axis=-1))
    specular = np.concatenate([srgb_coded(colour / scale), eight_bits(p.specular)[:, None]], axis=1)
    images = {"base_colour": base, "metallic_roughness": rough, "specular": specular}
    return {key: padding.image(pixels[of]) for key, pixels in images.items()}, scale


class _Builder:
    """Collects what the binary part holds, and the tables that say where."""

    def __init__(self) -> None:
        self.binary = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.images: list[dict[str, Any]] = []

    def _view(self, content: bytes, **more: Any) -> int:
        self.binary += bytes(-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(content)}
        self.views.append(view | more)
        self.binary += content
        return len(self.views) - 1

    def array(self, values: Array, kind: str, target: int, *, bounds: bool = False) -> int:
        """An accessor's number."""
        whole = np.issubdtype(values.dtype, np.integer)
        stored = np.ascontiguousarray(values, "<u4" if whole else "<f4")
        view = self._view(stored.tobytes(), target=target)
        count = stored.size if kind == "SCALAR" else len(stored)
        accessor = {
            "bufferView": view,
            "componentType": UNSIGNED_INT if whole else FLOAT,
            "count": count,
            "type": kind,
        }
        if bounds:
            low: F64 = stored.min(axis=0).astype(np.float64)
            high: F64 = stored.max(axis=0).astype(np.float64)
            accessor |= {"min": low.tolist(), "max": high.tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def texture(self, name: str, pixels: Array) -> int:
        """A texture's number."""
        view = self._view(png_bytes(pixels))
        self.images.append({"name": name, "mimeType": "image/png", "bufferView": view})
        return len(self.images) - 1

    def tables(self) -> dict[str, Any]:
        sampler = {
            "magFilter": LINEAR,
            "minFilter": LINEAR_MIPMAP_LINEAR,
            "wrapS": CLAMP_TO_EDGE,
            "wrapT": CLAMP_TO_EDGE,
        }
        return {
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.binary)}],
            "images": self.images,
            "samplers": [sampler],
            "textures": [{"source": i, "sampler": 0} for i in range(len(self.images))],
        }


def _container(document: dict[str, Any], binary: bytes) -> bytes:
    """Header, JSON chunk padded with spaces, binary chunk padded with zeros."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def written_by_us(content: bytes) -> bool:
    """Whether a file's content is a binary glTF that this module wrote."""
    try:
        magic, _, _ = struct.unpack_from("<4sII", content)
        length, kind = struct.unpack_from("<I4s", content, 12)
        asset = json.loads(content[20 : 20 + length])["asset"]
        return magic == b"glTF" and kind == b"JSON" and str(asset["generator"]).startswith(GENERATOR)
    except (struct.error, ValueError, KeyError, TypeError, RecursionError):
        return False

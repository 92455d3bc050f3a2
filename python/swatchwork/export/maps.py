# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Maps as images: EXR with exact linear numbers, PNG to paint with, and maps.json that says what each is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import U8, Float
from ..capture import write_exr_channels, write_png
from ..keeping import Array
from ..material import Material, material_maps
from ..progress import SILENT, Progress
from .folder import write_json
from .textures import Padding, dense_weights, eight_bits, padded_image, srgb_coded

CONVENTIONS = {
    "uv": "row 0 is v = 1; mesh.obj of the material folder has the UVs",
    "gutter": "every pixel off the atlas has its nearest texel's value",
    "colour": "linear Rec. 709 in EXR; PNG as each map says",
}


@dataclass(frozen=True)
class _Map:
    """One map: what it means, and how its PNG codes it."""

    meaning: str
    png: str | None
    """``srgb``: a colour; ``linear``: a number in [0, 1]; None: EXR only."""


MAPS = {
    "diffuse": _Map("Lambertian albedo at normal incidence", "srgb"),
    "specular": _Map("directional albedo of the specular kernels at normal incidence", "srgb"),
    "roughness_sigma": _Map(
        "Beckmann sigma of the nearest single lobe, which is a Beckmann or GGX renderer's alpha", "linear"
    ),
    "roughness_perceptual": _Map(
        "square root of that: what glTF, Blender, Disney's model and Mitsuba's principled call roughness",
        "linear",
    ),
    "tau": _Map("reflectance of the specular part at normal incidence over that at grazing", "linear"),
    "confidence": _Map("1 where no error is expected, 1/2 at 10 %, 0 where nothing is known", "linear"),
    "expected_error": _Map("relative error to expect in a view that was not taken, up to 1", "linear"),
    "blend_weights": _Map(
        "weight of each representative of svbrdf.json, channels w0, w1, ...; may be filtered",
        None,
    ),
    "blend_index": _Map(
        "which representatives a texel blends, channels index.0, index.1, ... (integers; never filter them)",
        None,
    ),
    "coverage": _Map("views that saw a texel plus 1; 0 off the atlas, not padded (integers)", None),
}


def write_maps(folder: Path, material: Material, padding: Padding, progress: Progress = SILENT) -> None:
    """Write NAME.exr and, of what fits into 8 bits, NAME.png, and maps.json."""
    found = material_maps(material)
    images: dict[str, Float] = {
        "diffuse": found.diffuse,
        "specular": found.specular,
        "roughness_sigma": found.roughness,
        "roughness_perceptual": np.sqrt(found.roughness),
        "tau": found.tau,
        "confidence": found.confidence,
        "expected_error": found.expected_error,
    }
    listed: dict[str, Any] = {}
    with progress.stage("maps", len(images) + 3) as task:
        for name, image in images.items():
            padded: Float = padded_image(padding, material, image)
            write_exr_channels(folder / f"{name}.exr", _channels(padded))
            entry: dict[str, Any] = {"meaning": MAPS[name].meaning, "exr": f"{name}.exr, linear"}
            if MAPS[name].png is not None:
                coded, scale = _coded(padded, MAPS[name].png == "srgb")
                write_png(folder / f"{name}.png", coded)
                coding = "sRGB" if MAPS[name].png == "srgb" else "linear (raw, non-colour data)"
                entry |= {"png": f"{name}.png, {coding}", "png_scale": scale}
            listed[name] = entry
            task.advance()
        weights = dense_weights(material, padding)
        channels = {f"w{i}": weights[..., i] for i in range(material.N)}
        write_exr_channels(folder / "blend_weights.exr", channels)
        task.advance()
        index = padded_image(padding, material, material.index).astype(np.uint32)
        write_exr_channels(
            folder / "blend_index.exr", {f"index.{i}": index[..., i] for i in range(material.n)}
        )
        task.advance()
        coverage = {"Y": (material.coverage.astype(np.int64) + 1).astype(np.uint32)}
        write_exr_channels(folder / "coverage.exr", coverage)
        task.advance()
    for name in ("blend_weights", "blend_index", "coverage"):
        listed[name] = {"meaning": MAPS[name].meaning, "exr": f"{name}.exr"}
    write_json(folder / "maps.json", {"conventions": CONVENTIONS, "maps": listed})


def _channels(image: Float) -> dict[str, Array]:
    stored = np.asarray(image, np.float32)
    return {"Y": stored} if stored.ndim == 2 else {"RGB"[i]: stored[..., i] for i in range(3)}


def _coded(image: Float, colour: bool) -> tuple[U8, float]:
    """The 8-bit image, and what its values (decoded) are to be multiplied by: 1 unless some exceed 1."""
    scale = max(1.0, float(image.max(initial=0.0)))
    return (srgb_coded if colour else eight_bits)(image / scale), scale

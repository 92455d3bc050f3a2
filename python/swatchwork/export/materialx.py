# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A MaterialX 1.38 document of the fitted parameters, on ``gltf_pbr``: the model they were fitted to.

``gltf_pbr`` is a graph of MaterialX's own physically-based nodes, so that every renderer that has these
renders it; ``standard_surface`` would tint the rim too, and cannot fade it. Textures are
linear half-float EXR, row 0 at v = 1 as MaterialX has it; roughness is perceptual.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np

from ..capture import write_exr_channels
from ..keeping import Array
from ..material import Material
from ..surface import Mesh, write_mesh_obj
from .fitting import StandardFit
from .standard import IOR
from .textures import Padding

INPUTS = {
    "base_color": ("color3", "lin_rec709"),
    "metallic": ("float", None),
    "roughness": ("float", None),
    "specular": ("float", None),
    "specular_color": ("color3", "lin_rec709"),
}
"""Inputs of ``gltf_pbr`` with an image each: its type and colour space; numbers have none."""


def write_materialx(folder: Path, material: Material, fit: StandardFit, padding: Padding) -> None:
    """Write material.mtlx, its textures, and mesh.obj."""
    p = fit.parameters
    values = {
        "base_color": p.base_colour,
        "metallic": p.metallic,
        "roughness": p.roughness,
        "specular": p.specular,
        "specular_color": np.where(p.specular[:, None] > 1e-3, p.specular_colour, 0),
    }
    for name, found in values.items():
        image = padding.image(found[fit.blend_of_texel].astype(np.float16))
        channels: dict[str, Array] = {"Y": image}
        if image.ndim == 3:
            channels = {"RGB"[i]: image[..., i] for i in range(3)}
        write_exr_channels(folder / f"{name}.exr", channels)
    (folder / "material.mtlx").write_text(document(), encoding="utf-8")
    write_mesh_obj(
        folder / "mesh.obj", Mesh(material.vertices, material.faces, material.normals, material.uv)
    )


def document() -> str:
    """The XML: a node graph of images, a surface shader, a material."""
    root = Xml.Element("materialx", version="1.38", colorspace="lin_rec709")
    graph = Xml.SubElement(root, "nodegraph", name="swatchwork_maps")
    shader = Xml.Element("gltf_pbr", name="swatchwork_surface", type="surfaceshader")
    for name, (kind, space) in INPUTS.items():
        image = Xml.SubElement(graph, "image", name=f"{name}_image", type=kind)
        file = Xml.SubElement(image, "input", name="file", type="filename", value=f"{name}.exr")
        if space is not None:
            file.set("colorspace", space)
        for axis in "uv":
            Xml.SubElement(image, "input", name=f"{axis}addressmode", type="string", value="clamp")
        Xml.SubElement(graph, "output", name=f"{name}_out", type=kind, nodename=f"{name}_image")
        Xml.SubElement(
            shader, "input", name=name, type=kind, nodegraph="swatchwork_maps", output=f"{name}_out"
        )
    Xml.SubElement(shader, "input", name="ior", type="float", value=f"{IOR:g}")
    root.append(shader)
    surface = Xml.SubElement(root, "surfacematerial", name="swatchwork_material", type="material")
    Xml.SubElement(
        surface, "input", name="surfaceshader", type="surfaceshader", nodename="swatchwork_surface"
    )
    Xml.indent(root)
    return '<?xml version="1.0"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mitsuba's view of an exported .glb: its 8-bit textures, and glTF's BRDF anew from the specification.

    python scripts/measure/gltf_bsdf.py SCENE OBJECT.glb --spp 64 --seed 1 --output DIR

SCENE is an exported Mitsuba folder, whose cameras, mesh and light are used, with this BSDF in place of ours.
"""

from __future__ import annotations

import argparse
import io
import json
import struct
import xml.etree.ElementTree as Xml
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from PIL import Image

mi.set_variant("llvm_ad_rgb")
NAMES = ("base", "rough", "colour", "factor")


class Gltf(mi.BSDF):
    """Appendix B of glTF 2.0 with KHR_materials_specular; sampled by its GGX lobe and the cosine."""

    def __init__(self, props: Any) -> None:
        mi.BSDF.__init__(self, props)
        self.maps = [props[name] for name in NAMES]
        flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.SpatiallyVarying
        self.m_components, self.m_flags = [flags], flags

    def lobe(self, si: Any, wo: Any, active: Any) -> tuple[Any, ...]:
        base, rough, colour, factor = (m.eval_3(si, active) for m in self.maps)
        a2 = dr.maximum(rough[1], 0.03) ** 4
        h = dr.normalize(wo + si.wi)
        i, o = dr.maximum(wo.z, 1e-5), dr.maximum(si.wi.z, 1e-5)
        d = a2 / (dr.pi * (h.z * h.z * (a2 - 1) + 1) ** 2)
        v = 1 / ((i + dr.sqrt(a2 + (1 - a2) * i * i)) * (o + dr.sqrt(a2 + (1 - a2) * o * o)))
        oh = dr.maximum(dr.dot(h, si.wi), 1e-5)
        return base, rough[2], colour, factor[0], d, v, h.z, oh, i, (wo.z > 0) & (si.wi.z > 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        base, metallic, colour, w, d, v, _, oh, i, lit = self.lobe(si, wo, active)
        s = (1 - dr.minimum(oh, 1)) ** 5
        f0 = dr.minimum(0.04 * mi.Color3f(colour), 1)
        f = f0 + (1 - f0) * s
        most = dr.maximum(dr.maximum(f.x, f.y), f.z)
        dielectric = (1 - w * most) * mi.Color3f(base) / dr.pi + w * f * d * v
        metal = (mi.Color3f(base) * (1 - s) + s) * d * v
        return dr.select(lit & active, (metallic * metal + (1 - metallic) * dielectric) * i, mi.Color3f(0))

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        *_, d, _, nh, oh, i, lit = self.lobe(si, wo, active)
        return dr.select(lit & active, 0.5 * d * nh / (4 * oh) + 0.5 * i / dr.pi, 0)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
        alpha = dr.maximum(self.maps[1].eval_3(si, active)[1], 0.03) ** 2
        t = alpha * dr.sqrt(sample2.x / dr.maximum(1 - sample2.x, 1e-7))
        nh = 1 / dr.sqrt(1 + t * t)
        phi = 2 * dr.pi * sample2.y
        h = mi.Vector3f(t * nh * dr.cos(phi), t * nh * dr.sin(phi), nh)
        mirrored = 2 * dr.dot(h, si.wi) * h - si.wi
        bs = mi.BSDFSample3f()
        bs.wo = dr.select(sample1 < 0.5, mirrored, mi.warp.square_to_cosine_hemisphere(sample2))
        bs.eta, bs.sampled_component = 1.0, 0
        bs.sampled_type = +mi.BSDFFlags.GlossyReflection
        bs.pdf = self.pdf(ctx, si, bs.wo, active)
        good = bs.pdf > 1e-10
        value = self.eval(ctx, si, bs.wo, active) / dr.select(good, bs.pdf, 1)
        return bs, dr.select(good, value, mi.Color3f(0))

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def to_string(self) -> str:
        return "Gltf[]"


def decoded(content: bytes) -> list[np.ndarray]:
    """Base colour, (occlusion, roughness, metallic), specular colour, specular factor: linear [H, W, 3]."""
    (size,) = struct.unpack_from("<I", content, 12)
    head, binary = json.loads(content[20 : 20 + size]), content[28 + size :]
    specular = head["materials"][0]["extensions"]["KHR_materials_specular"]
    images = []
    for image in head["images"]:
        view = head["bufferViews"][image["bufferView"]]
        png = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        images.append(np.asarray(Image.open(io.BytesIO(png))).astype(np.float64) / 255)

    def linear(x: np.ndarray) -> np.ndarray:
        return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)

    base, rough, both = images
    colour = linear(both[..., :3]) * specular["specularColorFactor"]
    factor = np.repeat(both[..., 3:] * specular["specularFactor"], 3, axis=-1)
    return [linear(base), rough, colour, factor]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path)
    parser.add_argument("glb", type=Path)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, required=True)
    args = parser.parse_args()
    mi.register_bsdf("gltf", Gltf)
    root = Xml.parse(args.scene / "scene.xml").getroot()
    bsdf = root.find("shape/bsdf")
    assert bsdf is not None
    bsdf.clear()
    bsdf.set("type", "gltf")
    args.output.mkdir(parents=True, exist_ok=True)
    for name, pixels in zip(NAMES, decoded(args.glb.read_bytes()), strict=True):
        file = (args.output / f".{name}.exr").resolve()
        mi.Bitmap(pixels.astype(np.float32)).write(str(file))
        texture = Xml.SubElement(bsdf, "texture", type="bitmap", name=name)
        Xml.SubElement(texture, "string", name="filename", value=str(file))
        Xml.SubElement(texture, "boolean", name="raw", value="true")
        Xml.SubElement(texture, "string", name="wrap_mode", value="clamp")
    changed = args.scene / "gltf.xml"
    Xml.ElementTree(root).write(changed)
    for number, frame in enumerate(json.loads((args.scene / "frames.json").read_text())["frames"]):
        scene = mi.load_file(
            str(changed),
            environment=frame["environment"],
            world_from_environment=frame["world_from_environment"],
        )
        image = mi.render(scene, sensor=number, spp=args.spp, seed=args.seed)
        mi.Bitmap(image).write(str(args.output / f"{frame['name']}.exr"))


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Radiance that reaches the pixels of a lens, by Mitsuba 3: an object or a mirror ball under a light probe.

Rays start from the distorted lens itself (lens.py), spread evenly over a pixel; nothing is resampled.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from swatchwork.arrays import F32
from swatchwork.capture import Camera
from swatchwork.light import Environment

from . import lens, llvm
from .subject import BALL_REFLECTANCE, Subject

BOUNCES = 1
"""Direct light alone: what the method leaves out would hide what the way to it costs."""
STRATA = 4
AT_ONCE = STRATA**2
"""Samples a pixel in one pass, one in each of its cells."""

dr, mi = llvm.start("llvm_ad_rgb")


class Scene:
    """Something under a light."""

    def __init__(self, shape: Any, light: Environment, *, background: bool) -> None:
        sky = {"type": "envmap", "bitmap": mi.Bitmap(llvm.raster(light))}
        self.scene = mi.load_dict({"type": "scene", "object": shape, "light": sky})
        self.integrator = mi.load_dict(
            {"type": "path", "max_depth": BOUNCES + 1, "rr_depth": 99, "hide_emitters": not background}
        )

    def seen_by(self, camera: Camera, samples: int, seed: int) -> F32:
        """F32[H, W, 4]: radiance and the object's coverage; without background, 0 beside the object."""
        width, height = camera.width, camera.height
        corner = lens.corner_slopes(camera).reshape(-1, 2).astype(np.float32)
        columns = [mi.Float(corner[:, axis].copy()) for axis in (0, 1)]
        lane = dr.arange(mi.UInt32, width * height * AT_ONCE)
        pixel, cell = lane // AT_ONCE, lane % AT_ONCE
        pose = camera.world_from_camera.astype(np.float32)
        total = np.zeros((height * width, 4))
        passes = max(1, samples // AT_ONCE)
        for i in range(passes):
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed(seed * 1000 + i, width * height * AT_ONCE)
            column, row = pixel % width, pixel // width
            s, t = sampler.next_2d()
            s, t = (cell % STRATA + s) / STRATA, (cell // STRATA + t) / STRATA
            at = row * (width + 1) + column
            local = []
            for slopes in columns:
                a, b, c, d = (dr.gather(mi.Float, slopes, at + step) for step in (0, 1, width + 1, width + 2))
                local.append((1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d))
            local = [local[0], -local[1], mi.Float(-1)]
            d = mi.Vector3f(*(sum(float(pose[k, j]) * local[j] for j in range(3)) for k in range(3)))
            origin = mi.Point3f(*(float(pose[k, 3]) for k in range(3)))
            ray = mi.RayDifferential3f(origin, dr.normalize(d))
            colour, _, _ = self.integrator.sample(self.scene, sampler, ray)
            hit = dr.select(self.scene.ray_test(ray), mi.Float(1), 0)
            values = np.stack([np.array(c) for c in (colour.x, colour.y, colour.z, hit)], axis=-1)
            total += values.reshape(height * width, AT_ONCE, 4).mean(axis=1)
        return (total / passes).reshape(height, width, 4).astype(np.float32)


def painted_object(subject: Subject) -> Any:
    """The object; Mitsuba has v = 0 in a picture's first row, we have v = 1."""
    images = {
        name: llvm.bitmap(mi, np.ascontiguousarray(getattr(subject, name)[::-1]))
        for name in ("base_color", "roughness", "metallic")
    }
    return llvm.textured_mesh(mi, subject.mesh, {"type": "principled", "specular": 0.5, **images})


def mirror_ball(centre: np.ndarray, radius: float) -> Any:
    """A mirror of constant reflectance."""
    mirror = {
        "type": "conductor",
        "material": "none",
        "specular_reflectance": {"type": "rgb", "value": [BALL_REFLECTANCE] * 3},
    }
    return mi.load_dict({"type": "sphere", "center": list(centre), "radius": float(radius), "bsdf": mirror})

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A Cook-Torrance sphere with the paper's G and F, rendered by Mitsuba 3, against the operator."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from swatchwork._native import Pyramid
from swatchwork.arrays import F32, F64
from swatchwork.octahedral import direction_from_square
from swatchwork.reflectance import GenericBasis
from swatchwork.response import generic_responses

mi: Any = pytest.importorskip("mitsuba", reason="the other renderer is not installed (extra: oracle)")

SIDE, SAMPLES, HALF_WIDTH = 24, 128, 1.05
SIGMA, TAU, DIFFUSE = 0.3, 0.2, 0.3


def light(d: F64) -> F64:
    """A smooth coloured environment with a broad bright lobe [..., 3]."""
    lobe = np.exp(4 * (d @ np.array([0.48, 0.6, 0.64]) - 1))[..., None]
    return 0.2 + np.array([3.0, 2.0, 1.0]) * lobe + 0.1 * (1 + d)


def mitsuba_raster(width: int = 512) -> F32:
    """Mitsuba's layout: first and last rows lie on the poles, columns have centres at +0.5."""
    v = np.arange(width // 2)[:, None] / (width // 2 - 1) * np.pi
    u = (np.arange(width) + 0.5) / width * 2 * np.pi
    d = np.broadcast_arrays(np.sin(v) * np.sin(u), np.cos(v), -np.sin(v) * np.cos(u))
    return light(np.stack(d, -1)).astype(np.float32)


def bsdf_class() -> type:
    """The model of Eqs. 8 to 11, written anew on Mitsuba's own vectors."""

    class CookTorrance(mi.BSDF):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [flags]
            self.m_flags = flags

        def sample(self, ctx: Any, si: Any, sample1: float, sample2: Any, active: bool) -> Any:
            wo = mi.warp.square_to_cosine_hemisphere(sample2)
            sample = mi.BSDFSample3f()
            sample.wo, sample.eta = wo, 1.0
            sample.pdf = mi.warp.square_to_cosine_hemisphere_pdf(wo)
            sample.sampled_type, sample.sampled_component = +mi.BSDFFlags.GlossyReflection, 0
            if si.wi.z <= 0 or sample.pdf <= 0:
                return sample, mi.Color3f(0)
            return sample, self.eval(ctx, si, wo, active) / sample.pdf

        def eval(self, ctx: Any, si: Any, wo: Any, active: bool) -> Any:
            o, i = si.wi, wo
            if o.z <= 0 or i.z <= 0:
                return mi.Color3f(0)
            x, y, z = i.x + o.x, i.y + o.y, i.z + o.z
            length = (x * x + y * y + z * z) ** 0.5
            hn, oh = z / length, (o.x * x + o.y * y + o.z * z) / length
            tan2 = (1 - hn * hn) / (hn * hn)
            d = np.exp(-tan2 / SIGMA**2) / (np.pi * SIGMA**2 * hn**4)
            g = min(1.0, 2 * hn * i.z / oh, 2 * hn * o.z / oh)
            f = TAU + (1 - TAU) * (1 - oh) ** 5
            return mi.Color3f(float(d * g * f / (4 * o.z) + DIFFUSE / np.pi * i.z))

        def pdf(self, ctx: Any, si: Any, wo: Any, active: bool) -> float:
            return mi.warp.square_to_cosine_hemisphere_pdf(wo) if si.wi.z > 0 and wo.z > 0 else 0.0

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: bool) -> Any:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def to_string(self) -> str:
            return "CookTorrance[]"

    return CookTorrance


def rendered(seeds: tuple[int, ...]) -> list[F64]:
    """Images [SIDE, SIDE, 3] of the unit sphere seen from +z without perspective, one a seed."""
    mi.set_variant("scalar_rgb")
    mi.register_bsdf("cook_torrance_of_the_test", bsdf_class())
    film = {
        "type": "hdrfilm",
        "width": SIDE,
        "height": SIDE,
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
    }
    world_from_camera = mi.ScalarTransform4f().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0])
    scale = mi.ScalarTransform4f().scale([HALF_WIDTH, HALF_WIDTH, 1])
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 1, "hide_emitters": True},
            "sensor": {
                "type": "orthographic",
                "to_world": world_from_camera @ scale,
                "film": film,
                "sampler": {"type": "independent", "sample_count": SAMPLES},
            },
            "light": {"type": "envmap", "bitmap": mi.Bitmap(mitsuba_raster())},
            "ball": {"type": "sphere", "bsdf": {"type": "cook_torrance_of_the_test"}},
        }
    )
    return [np.array(mi.render(scene, seed=seed), dtype=np.float64) for seed in seeds]


def predicted(subsamples: int = 8) -> tuple[F64, F64]:
    """The operator's image, and which pixels lie wholly on the sphere."""
    side = SIDE * subsamples
    centre = ((np.arange(side) + 0.5) / side * 2 - 1) * HALF_WIDTH
    x, y = np.meshgrid(centre, -centre)
    inside = x * x + y * y < 0.98
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    n = np.stack([x, y, z], -1)[inside]
    octahedron = (np.arange(256) + 0.5) / 256
    base = light(direction_from_square(np.stack(np.meshgrid(octahedron, octahedron), -1)))
    basis = GenericBasis("oracle", sigmas=np.array([SIGMA]))
    o = np.broadcast_to([0.0, 0.0, 1.0], n.shape)
    kernels = generic_responses(basis, Pyramid(base.astype(np.float32)), n, o)
    weights = np.array([1 - TAU, TAU, DIFFUSE])
    image = np.zeros((side, side, 3))
    image[inside] = np.einsum("pjc,j->pc", kernels, weights)
    blocks = (SIDE, subsamples, SIDE, subsamples)
    return image.reshape(*blocks, 3).mean(axis=(1, 3)), inside.reshape(blocks).all(axis=(1, 3))


def test_agrees_with_mitsuba_within_its_noise() -> None:
    first, second = rendered((1, 2))
    found, whole = predicted()
    theirs = 0.5 * (first + second)[whole]
    ours = found[whole]
    # Half the difference of two renders is the deviation of their mean.
    noise = np.sqrt(np.mean((0.5 * (first - second)[whole]) ** 2))
    difference = np.sqrt(np.mean((theirs - ours) ** 2))
    # Some 300 pixels: the two estimates of one deviation differ by a few percent, the operator adds
    # under half a percent of the mean, and the noise is some percent of it.
    assert noise < 0.1 * ours.mean()
    assert difference < 1.15 * noise
    # Averaged over the ball the noise falls by the root of the pixel count: three deviations of bias.
    bias = abs(np.mean(theirs - ours))
    assert bias < 3 * noise / np.sqrt(whole.sum()) + 2e-3 * ours.mean()

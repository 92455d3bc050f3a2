# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A Mitsuba 3 BSDF that evaluates a Swatchwork material exactly; needs nothing but mitsuba.

Import this file after mitsuba.set_variant(...); it registers the plugin "swatchwork":

    <bsdf type="swatchwork">
        <string name="filename" value="material.json"/>
        <texture type="bitmap" name="blend_0"> ... </texture>      three weights a texture, raw
    </bsdf>

The BRDF is sum_n w_n(u, v) sum_j c_nj kernel_j, with w_n from the textures and kernels of two kinds:

    D_sigma(h) G F / (4 n.i n.o),   D Beckmann's, F = (1 - o.h)^p, G of V-grooves or Smith's of fixed alpha
    sum of a(n.i) b(n.o) / pi       diffuse shapes a, b

It is sampled by a mixture of the Beckmann lobes in use and the cosine.
"""

import json
import math

import drjit as dr
import mitsuba as mi

LOWEST_COSINE = 0.02  # shading normals that turn away from the viewer are bent back to this n.o
INVERSE_PI = 1 / math.pi


def shape(name, c):
    """A diffuse shape of one cosine."""
    if name == "one":
        return 1.0
    if name == "half":
        return 1 - (1 - 0.5 * c) ** 5
    if name == "fifth":
        return (1 - c) ** 5
    if name == "tenth":
        return (1 - c) ** 10
    if name == "shade":
        return 1 / (1 + c)
    raise ValueError(f"unknown diffuse shape {name!r}")


def masking(name, n_i, n_o, o_h, n_h):
    """Shadowing and masking G."""
    if name == "vgroove":
        return dr.minimum(1.0, 2 * n_h * dr.minimum(n_i, n_o) / o_h)
    kind, _, alpha = name.partition(":")
    if kind != "smith":
        raise ValueError(f"unknown masking {name!r}")
    a2 = float(alpha) ** 2
    width_i = n_i + dr.sqrt(a2 + (1 - a2) * n_i * n_i)
    width_o = n_o + dr.sqrt(a2 + (1 - a2) * n_o * n_o)
    return 4 * n_i * n_o / (width_i * width_o)


def beckmann(n_h, sigma):
    """D(h) per steradian."""
    cosine2 = dr.maximum(n_h, 1e-4) ** 2
    return dr.exp((cosine2 - 1) / (cosine2 * sigma**2)) / (math.pi * sigma**2 * cosine2 * cosine2)


class SwatchworkBSDF(mi.BSDF):
    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        path = mi.file_resolver().resolve(str(props["filename"]))
        with open(str(path), encoding="utf-8") as file:
            self.table = json.load(file)
        self.count = len(self.table["representatives"])
        self.blend = [props[f"blend_{i}"] for i in range((self.count + 2) // 3)]
        self.sigmas = self.table["sigmas"]
        flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.SpatiallyVarying
        self.m_components = [flags]
        self.m_flags = flags

    def weights(self, si, active):
        """Blend weights of the representatives."""
        found = []
        for texture in self.blend:
            value = texture.eval_3(si, active)
            found += [value[0], value[1], value[2]]
        return found[: self.count]

    def normal(self, o):
        """The shading normal in the local frame: (0, 0, 1), or bent until the viewer sees it."""
        side = dr.sqrt(dr.maximum(1 - o.z * o.z, 1e-12))
        b = math.sqrt(1 - LOWEST_COSINE**2) / side
        a = LOWEST_COSINE - b * o.z
        bent = mi.Vector3f(a * o.x, a * o.y, a * o.z + b)
        return dr.select(o.z < LOWEST_COSINE, bent, mi.Vector3f(0, 0, 1))

    def cosines(self, o, i):
        """n.i, n.o, n.h, o.h made safe, and whether light comes from above."""
        n = self.normal(o)
        n_i, n_o = dr.dot(n, i), dr.maximum(dr.dot(n, o), LOWEST_COSINE)
        lit = n_i > 1e-6
        n_i = dr.select(lit, n_i, 1.0)
        h = i + o
        length = dr.maximum(dr.norm(h), 1e-6)
        return n_i, n_o, dr.dot(n, h) / length, dr.maximum(dr.dot(o, h) / length, 1e-6), lit

    def kernels(self, n_i, n_o, n_h, o_h):
        """Value times n.i of each kernel in use."""
        lobe = [beckmann(n_h, sigma) for sigma in self.sigmas]
        g = {name: masking(name, n_i, n_o, o_h, n_h) / (4 * n_o) for name in self.table["maskings"]}
        away = dr.maximum(1 - o_h, 0.0)
        found = []
        for kernel in self.table["kernels"]:
            if "diffuse" in kernel:
                terms = [shape(a, n_i) * shape(b, n_o) for a, b in kernel["diffuse"]]
                found.append(sum(terms) * INVERSE_PI * n_i)
            else:
                value = lobe[kernel["sigma"]] * g[kernel["masking"]]
                for _ in range(kernel["power"]):
                    value = value * away
                found.append(value)
        return found

    def eval(self, ctx, si, wo, active=True):
        n_i, n_o, n_h, o_h, lit = self.cosines(si.wi, wo)
        kernels = self.kernels(n_i, n_o, n_h, o_h)
        total = mi.Color3f(0.0)
        for weight, of in zip(self.weights(si, active), self.table["representatives"]):
            value = [0.0, 0.0, 0.0]
            for number, r, g, b in of["coefficients"]:
                for c, x in enumerate((r, g, b)):
                    value[c] = value[c] + x * kernels[number]
            total += weight * mi.Color3f(*value)
        return dr.select(lit & active, total, mi.Color3f(0.0))

    def shares(self, si, active):
        """Probability of each lobe; that of the cosine is what is missing to 1."""
        found = [0.0] * len(self.sigmas)
        for weight, of in zip(self.weights(si, active), self.table["representatives"]):
            for k, share in enumerate(of["sampling"]):
                if share > 0:
                    found[k] = found[k] + weight * share
        return found

    def pdf(self, ctx, si, wo, active=True):
        n_i, _, n_h, o_h, lit = self.cosines(si.wi, wo)
        rest, found = 1.0, 0.0
        for share, sigma in zip(self.shares(si, active), self.sigmas):
            found = found + share * beckmann(n_h, sigma) * n_h / (4 * o_h)
            rest = rest - share
        return dr.select(lit & active, found + rest * n_i * INVERSE_PI, 0.0)

    def sample(self, ctx, si, sample1, sample2, active=True):
        o = si.wi
        n = self.normal(o)
        s, t = mi.coordinate_system(n)
        phi = 2 * math.pi * sample2.y
        # Choose a lobe, or with none the cosine.
        below, sigma = 0.0, mi.Float(-1.0)
        for share, of_lobe in zip(self.shares(si, active), self.sigmas):
            sigma = dr.select((sample1 >= below) & (sample1 < below + share), of_lobe, sigma)
            below = below + share
        tangent = sigma * dr.sqrt(dr.maximum(-dr.log(dr.maximum(1 - sample2.x, 1e-12)), 0.0))
        n_h = 1 / dr.sqrt(1 + tangent * tangent)
        across = tangent * n_h
        h = across * dr.cos(phi) * s + across * dr.sin(phi) * t + n_h * n
        mirrored = 2 * dr.dot(o, h) * h - o
        radius = dr.sqrt(sample2.x)
        scattered = (
            radius * dr.cos(phi) * s + radius * dr.sin(phi) * t + dr.sqrt(dr.maximum(1 - sample2.x, 0.0)) * n
        )
        found = mi.BSDFSample3f()
        found.wo = dr.select(sigma > 0, mirrored, scattered)
        found.eta = 1.0
        found.sampled_type = +mi.BSDFFlags.GlossyReflection
        found.sampled_component = 0
        found.pdf = self.pdf(ctx, si, found.wo, active)
        good = found.pdf > 1e-12
        value = self.eval(ctx, si, found.wo, active) / dr.select(good, found.pdf, 1.0)
        return found, dr.select(good, value, mi.Color3f(0.0))

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def traverse(self, callback):
        for number, texture in enumerate(self.blend):
            callback.put(f"blend_{number}", texture, mi.ParamFlags.Differentiable)

    def to_string(self):
        return f"SwatchworkBSDF[{self.count} representatives, {len(self.table['kernels'])} kernels]"


mi.register_bsdf("swatchwork", SwatchworkBSDF)

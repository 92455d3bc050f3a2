# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The metallic-roughness parameters of each texel whose pictures are nearest to the material's.

    min over (c, w, f0, metallic, roughness)  sum_q | sum_n w_n T_qn - sum_k a_k(...) V_qk(roughness) |^2

q runs over (normal, viewer, light) triples: normals and viewers as a sphere shows them to a camera, lights of
several kinds, so that no one lamp rules. T_qn are the representatives' responses by the operator of the
reconstruction, V_qk the four integrals of `standard.py`, a_k its coefficients. Only inner products over q
are needed, so the cost of a texel does not depend on how many triples there are, and equal blends share a
fit. For each roughness of the table it is a bounded least squares in c, w f0 and w (the small loss that the
dielectric's lobe causes beneath it lags a sweep), solved by coordinate descent; the best roughness is kept.

Averaging parameters instead (of the representatives' own fits, by blend weight) would do worse: rendered
light is linear in a blend, roughness is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F64, I64, unit
from ..light import Environment
from ..material import Material, dense
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis
from ..response import representative_responses
from ..simulate import procedural_environment
from .standard import F0, LEVELS, Standard, coefficients, integrals

FITTED_UNDER = (("room", 0), ("sky", 0), ("studio", 0), ("overcast", 0))
HELD_OUT = ("atelier", 1)
"""The light that the stated loss is of."""
PAIRS = 64
"""(normal, viewer) pairs a light."""
STEPS = 255
"""Blend weights are told apart to this part; the textures are not finer."""
CHUNK = 1 << 14
COARSE = 4
"""Every so-manieth roughness is tried first, then those between around the best."""
SWEEPS = 12
METAL_MAY_COST = 1.02
"""A texel is called metallic to a degree where that raises its root squared error by at most 2 %."""


@dataclass(frozen=True, eq=False)
class StandardFit:
    """Fitted parameters and what they leave."""

    parameters: Standard
    """Of each distinct blend."""
    blend_of_texel: I64
    """[M] which of them each texel of the atlas has, in the order of Material.on_atlas."""
    fit_nrms: float
    """Relative error of the lights fitted, over the texels."""
    loss_nrms: float
    """The same of a light that was held out."""
    clipped: float
    """Share of texels whose base colour would be above 1."""


@dataclass(frozen=True, eq=False)
class _Products:
    """Inner products over the triples: of integrals V and responses T of the representatives."""

    vv: F64  # [L, 3, 4, 4]
    vt: F64  # [L, 3, 4, N]
    tt: F64  # [3, N, N]

    @classmethod
    def under(cls, m: Material, lights: list[Environment], seed: int) -> _Products:
        basis = GenericBasis.of(m.basis)
        vv, vt = np.zeros((len(LEVELS), 3, 4, 4)), np.zeros((len(LEVELS), 3, 4, m.N))
        tt = np.zeros((3, m.N, m.N))
        for number, light in enumerate(lights):
            normal, viewer = _as_a_sphere_shows(PAIRS, seed + number)
            v = integrals(light, normal, viewer)
            t = representative_responses(basis, m.representatives, light.pyramid(), normal, viewer).astype(
                np.float64
            )
            vv += np.einsum("lqic,lqjc->lcij", v, v)
            vt += np.einsum("lqic,qnc->lcin", v, t)
            tt += np.einsum("qnc,qkc->cnk", t, t)
        return cls(vv, vt, tt)

    def error(self, p: Standard, level: I64, blend: F64) -> tuple[F64, F64]:
        """Squared error and squared target [T] of parameters at levels [T] for blends [T, N]."""
        a = coefficients(p)
        target = np.einsum("tn,cnk,tk->t", blend, self.tt, blend)
        cross = np.einsum("tci,tcin,tn->t", a, self.vt[level], blend)
        return np.einsum("tci,tcij,tcj->t", a, self.vv[level], a) - 2 * cross + target, target


def fit_standard(m: Material, progress: Progress = SILENT) -> StandardFit:
    """Fit every distinct blend of a material."""
    weights = dense(m.index[m.on_atlas], m.weight[m.on_atlas].astype(np.float64), m.N)
    steps = np.rint(weights * STEPS).astype(np.uint8)
    distinct, of_texel, count = np.unique(steps, axis=0, return_inverse=True, return_counts=True)
    blends = distinct / np.maximum(distinct.sum(axis=1, dtype=np.float64, keepdims=True), 1)
    with progress.stage("fit metallic-roughness", len(blends)) as task:
        task.describe("light")
        lights = [procedural_environment(kind, seed) for kind, seed in FITTED_UNDER]
        products = _Products.under(m, lights, 0)
        held_out = _Products.under(m, [procedural_environment(*HELD_OUT)], 1000)
        task.describe("blends")
        parts, levels = [], []
        for start in range(0, len(blends), CHUNK):
            part = blends[start : start + CHUNK]
            found, level = _fitted(products, part)
            parts.append(found)
            levels.append(level)
            task.advance(len(part))
    p = Standard(**{name: np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0])})
    level = np.concatenate(levels)
    losses = []
    for of in (products, held_out):
        error, target = of.error(p, level, blends)
        losses.append(float(np.sqrt(max((count * error).sum(), 0) / max((count * target).sum(), 1e-300))))
    full = (p.base_colour >= 1 - 1e-6).any(axis=1)
    clipped = float((count * full).sum() / max(count.sum(), 1))
    return StandardFit(p, np.asarray(of_texel, np.int64).ravel(), losses[0], losses[1], clipped)


def _as_a_sphere_shows(count: int, seed: int) -> tuple[F64, F64]:
    """Normals and viewers [Q, 3]; n.o is distributed as over a sphere's picture, away from its very rim."""
    rng = np.random.default_rng([seed, 31])
    normal = unit(rng.normal(size=(count, 3)))
    cosine = np.sqrt((rng.permutation(count) + 0.5) / count)
    side = unit(np.cross(normal, rng.normal(size=(count, 3))))
    return normal, np.sqrt(1 - cosine**2)[:, None] * side + cosine[:, None] * normal


@dataclass
class _State:
    """Of T texels: base colour c, S = w f0 and w, at metallic m."""

    c: F64  # [T, 3]
    S: F64  # [T, 3]
    w: F64  # [T]
    m: F64  # [T]

    def factors(self) -> F64:
        """As `coefficients`, [T, 3, 4]."""
        w, m, most = self.w[:, None], self.m[:, None], self.S.max(axis=1, keepdims=True)
        d = (1 - m) * self.c
        lobe = m * self.c + (1 - m) * self.S
        rim = np.broadcast_to(m + (1 - m) * w, d.shape)
        return np.stack([d * (1 - most), -d * (w - most), lobe, rim], axis=-1)

    def parameters(self, level: I64) -> Standard:
        f0 = self.S / np.maximum(self.w, 1e-9)[:, None]
        return Standard(self.c, self.m, np.sqrt(LEVELS[level]), self.w, f0 / F0)


def _fitted(products: _Products, blend: F64) -> tuple[Standard, I64]:
    """Best parameters of blends [T, N], and the level of their roughness."""
    T = len(blend)
    best, error = np.zeros(T, np.int64), np.full(T, np.inf)
    state = _State(np.full((T, 3), 0.2), np.full((T, 3), F0), np.full(T, 0.5), np.zeros(T))

    def try_level(level: I64, state: _State, sweeps: int) -> None:
        nonlocal best, error
        found = _State(state.c.copy(), state.S.copy(), state.w.copy(), state.m.copy())
        new = _descend(products, found, level, blend, sweeps)
        better = new < error
        best, error = np.where(better, level, best), np.where(better, new, error)
        for name in ("c", "S", "w", "m"):
            old, fresh = getattr(kept, name), getattr(found, name)
            setattr(kept, name, np.where(better.reshape(-1, *[1] * (old.ndim - 1)), fresh, old))

    kept = _State(state.c, state.S, state.w, state.m)
    for level in range(0, len(LEVELS), COARSE):
        try_level(np.full(T, level), state, SWEEPS)
    step = COARSE // 2
    while step:
        middle = best.copy()
        for side in (-step, step):
            try_level(np.clip(middle + side, 0, len(LEVELS) - 1), kept, SWEEPS)
        step //= 2
    try_level(best.copy(), kept, 4 * SWEEPS)
    _call_metals(products, kept, best, error, blend)
    return kept.parameters(best), best


def _call_metals(products: _Products, kept: _State, best: I64, error: F64, blend: F64) -> None:
    """Say the same with a metallic share where one fits, for programs that know no KHR_materials_specular.

    A dielectric of high reflectance S over diffuse D looks like metal of share S / (S + D).
    """
    excess = np.maximum(kept.S - F0, 0)
    share = (excess / np.maximum(excess + kept.c, 1e-9)).min(axis=1)
    m = np.minimum(share, kept.w)[:, None]
    c = np.where(m < 0.98, np.minimum(kept.c / np.maximum(1 - m, 0.02), 1), kept.S)
    rest = np.clip((kept.w - m[:, 0]) / np.maximum(1 - m[:, 0], 1e-3), 0, 1)
    S = np.clip((kept.S - m * c) / np.maximum(1 - m, 1e-3), 0, rest[:, None])
    metal = _State(c, S, rest, m[:, 0])
    new = _descend(products, metal, best, blend, 4 * SWEEPS)
    take = (new <= METAL_MAY_COST**2 * error) & (m[:, 0] > 0)
    kept.c, kept.S = np.where(take[:, None], metal.c, kept.c), np.where(take[:, None], metal.S, kept.S)
    kept.w, kept.m = np.where(take, metal.w, kept.w), np.where(take, metal.m, kept.m)


def _descend(products: _Products, x: _State, level: I64, blend: F64, sweeps: int) -> F64:
    """Coordinate descent in place; the squared error [T] afterwards."""
    vv = products.vv[level]
    vt = np.einsum("tcin,tn->tci", products.vt[level], blend)
    target = np.einsum("tn,cnk,tk->t", blend, products.tt, blend)
    m = x.m[:, None]
    tiny = 1e-12 * np.einsum("tcii->tc", vv) + 1e-300

    def step(direction: F64) -> tuple[F64, F64]:
        """Slope and curvature [T, 3] of half the squared error along [T, 3, 4]."""
        slope = np.einsum("tcij,tcj->tci", vv, x.factors()) - vt
        bend = np.einsum("tci,tcij,tcj->tc", direction, vv, direction)
        return np.einsum("tci,tci->tc", slope, direction), bend

    def along(*parts: F64 | float) -> F64:
        return np.stack(np.broadcast_arrays(*parts, x.c)[:4], axis=-1)

    for _ in range(sweeps):
        most = x.S.max(axis=1, keepdims=True)
        slope, bend = step(along((1 - m) * (1 - most), -(1 - m) * (x.w[:, None] - most), m, 0.0))
        x.c = np.clip(x.c - slope / (bend + tiny), 0, 1)
        slope, bend = step(along(0.0, 0.0, 1 - m, 0.0))
        x.S = np.clip(x.S - slope / (bend + tiny), 0, x.w[:, None])
        # The rim alone: w with S as it is.
        slope, bend = step(along(0.0, 0.0, 0.0, 1 - m))
        moved = x.w - slope.sum(axis=1) / (bend.sum(axis=1) + tiny.sum(axis=1))
        x.w = np.clip(moved, x.S.max(axis=1), 1)
        # And w with S / w as it is, so that a lobe at its bound S = w can grow.
        f0 = x.S / np.maximum(x.w, 1e-9)[:, None]
        slope, bend = step(along(0.0, 0.0, (1 - m) * f0, 1 - m))
        x.w = np.clip(x.w - slope.sum(axis=1) / (bend.sum(axis=1) + tiny.sum(axis=1)), 1e-3, 1)
        x.S = f0 * x.w[:, None]
    a = x.factors()
    return np.asarray(
        np.einsum("tci,tcij,tcj->t", a, vv, a) - 2 * np.einsum("tci,tci->t", a, vt) + target, np.float64
    )

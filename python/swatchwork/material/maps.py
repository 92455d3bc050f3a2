# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Maps for eyes and other programs: diffuse, specular, roughness, tau (paper, Fig. 15), confidence.

They are summaries; the material itself is the blend of representatives.

- ``diffuse``: Lambertian albedo at normal incidence.
- ``specular``: directional albedo of the specular kernels at normal incidence.
- ``roughness``: sigma of the one Beckmann lobe nearest to the blended NDF. A lobe's energy per unit of
  log tan(alpha) is q(t) = 2 t^2 / sigma^2 exp(-t^2 / sigma^2), of mass 1; the fit is least squares of q
  over log t with free amplitude. Two lobes have the product 2 a^2 b^2 / (a^2 + b^2)^2, so the best sigma
  maximises sum_j e_j 2 s_j^2 s^2 / (s_j^2 + s^2)^2. Least squares over solid angle instead would pick the
  sharpest lobe however faint; matching second moments, the widest.
- ``tau``: with weights c0, c1 of the kernels of Fresnel exponent above 0 and 0 summed (tau = 0 and 1 in
  Eq. 11), it is c1 / (c0 + c1): reflectance at normal incidence over that at grazing.
- ``expected_error``: relative error to expect in a view that was not taken (trust.py); 1 where nothing is
  known of it: no view saw the texel, or a single photograph left none to hold out.
- ``confidence``: 1 / (1 + (expected error / 0.1)^2); 0 where nothing is known.

Energies e_j are luminances times the cosine-weighted mean of (1 - cos)^p, 2 / ((p + 1) (p + 2)). Roughness
and tau are 0 where nothing is specular, the residual where nothing was measured; off the atlas all maps are
0 and coverage is -1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import F32, F64, I32, Bool
from ..errors import InputError
from .material import BasisRecord, Material
from .trust import confidence_of, dense, features, neighbourhood

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
CHUNK = 1 << 13
"""Pixels of a band; a score for each of some 90 roughnesses is held of each."""


@dataclass(frozen=True, eq=False)
class MaterialMaps:
    """Images at atlas resolution, row 0 at v = 1."""

    diffuse: F32  # [H, W, 3]
    specular: F32  # [H, W, 3]
    roughness: F32  # [H, W]
    tau: F32  # [H, W]
    residual: F32  # [H, W]
    coverage: I32  # [H, W]
    expected_error: F32  # [H, W]
    confidence: F32  # [H, W]


def material_maps(material: Material) -> MaterialMaps:
    """All maps of a material (definitions at the top of this file)."""
    parts = [vars(band) for band in maps_in_bands(material)]
    return MaterialMaps(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


def maps_in_bands(material: Material) -> Iterator[MaterialMaps]:
    """The maps of some rows, then those of the next, so that a large atlas is never held in 64 bits."""
    m, basis = material, material.basis
    lobes, albedo = basis.lobes, normal_albedo(basis)
    first = len(lobes)
    diffuse = np.einsum("j,njc->nc", albedo[first:], m.representatives[:, first:])
    specular = np.einsum("j,njc->nc", albedo[:first], m.representatives[:, :first])
    luminance = m.representatives[:, :first] @ LUMINANCE
    power = np.array([power for _, power, _ in lobes])
    full = power == 0
    c0, c1 = np.where(full, 0, luminance), np.where(full, luminance, 0)

    energy, sigmas = luminance * 2 / ((power + 1) * (power + 2)), np.array([sigma for *_, sigma in lobes])
    at_normal, at_grazing = c1.sum(axis=-1), c0.sum(axis=-1)
    height, width = m.coverage.shape
    band = max(1, CHUNK // width)
    for start in range(0, height, band):
        rows = slice(start, start + band)
        atlas, residual = m.coverage[rows] >= 0, m.residual[rows].astype(np.float64)
        residual = np.where(atlas & np.isfinite(residual), residual, 0)
        index, weight = m.index[rows][atlas].astype(np.int64), m.weight[rows][atlas].astype(np.float64)
        normal = blended(at_normal, index, weight)
        total = normal + blended(at_grazing, index, weight)
        error = _expected_error(m, start, min(start + band, height))

        def on_atlas(values: F64, atlas: Bool = atlas) -> F32:
            image = np.zeros((*atlas.shape, *values.shape[1:]), dtype=np.float32)
            image[atlas] = values
            return image

        yield MaterialMaps(
            diffuse=on_atlas(blended(diffuse, index, weight)),
            specular=on_atlas(blended(specular, index, weight)),
            roughness=on_atlas(_fitted_roughness(energy, sigmas, index, weight)),
            tau=on_atlas(np.where(total > 0, normal / np.where(total > 0, total, 1), 0)),
            residual=residual.astype(np.float32),
            coverage=m.coverage[rows],
            expected_error=error.astype(np.float32),
            confidence=np.where(error < 1, confidence_of(error), 0).astype(np.float32) * atlas,
        )


def expected_error(m: Material, stride: int = 1) -> F32:
    """The expected relative error of every ``stride``-th texel along both sides."""
    height, width = m.coverage.shape
    band = max(1, CHUNK // width)
    parts = []
    for start in range(0, height, band):
        rows = _expected_error(m, start, min(start + band, height))
        parts.append(rows[-start % stride :: stride, ::stride].astype(np.float32))
    return np.concatenate(parts)


def _expected_error(m: Material, start: int, stop: int) -> F64:
    """Expected relative error [stop - start, W] of some rows: 1 where nothing is known, 0 off the atlas."""
    if m.trust is None:
        return (m.coverage[start:stop] >= 0).astype(np.float64)
    # A row more on either side, for neighbours.
    low, high = max(0, start - 1), min(m.coverage.shape[0], stop + 1)
    rows, own = slice(low, high), slice(start - low, stop - low)
    coverage = m.coverage[rows]
    seen = coverage > 0
    residual = np.where(seen, m.residual[rows], 0).astype(np.float32)
    residual = np.where(np.isfinite(residual), residual, 0)
    weights = dense(m.index[rows], m.weight[rows], m.N)
    appearance = weights @ m.trust.appearance.astype(np.float32)
    around, change = neighbourhood(appearance, residual, coverage)
    at = np.nonzero(seen[own])
    strength = (appearance[own][at].astype(np.float64) ** 2).sum(axis=-1)
    f = features(
        residual[own][at],
        around[own][at],
        change[own][at],
        strength,
        coverage[own][at],
        weights[own][at].astype(np.float64),
        m.n,
    )
    found = (coverage[own] >= 0).astype(np.float64)
    found[at] = np.minimum(m.trust.expected(f), 1)
    return found


def blended(per_representative: F64, index: np.ndarray, weight: F64) -> F64:
    """Values [N, ...] of the representatives, blended by index and weight [M, n] to [M, ...]."""
    found = np.zeros((len(index), *per_representative.shape[1:]))
    for i in range(index.shape[1]):
        w = weight[:, i].reshape(-1, *[1] * (per_representative.ndim - 1))
        found += w * per_representative[index[:, i]]
    return found


def _fitted_roughness(energy: F64, sigmas: F64, index: np.ndarray, weight: F64) -> F64:
    """Sigma [M] of the best single lobe for energies [N, J'] at sigmas [J']; 0 where there is none."""
    step = 0.05
    grid = np.arange(np.log(sigmas.min()), np.log(sigmas.max()) + step, step)
    s2, t2 = sigmas[:, None] ** 2, np.exp(2 * grid)[None]
    scores = energy @ (2 * s2 * t2 / (s2 + t2) ** 2)
    score = blended(scores, index, weight)
    best = np.clip(score.argmax(axis=1), 1, len(grid) - 2)
    at = np.arange(len(best))
    low, mid, high = score[at, best - 1], score[at, best], score[at, best + 1]
    # A parabola through the three scores around the top of the grid.
    bend = low - 2 * mid + high
    shift = np.where(bend < 0, 0.5 * (low - high) / np.where(bend < 0, bend, 1), 0)
    sigma = np.exp(grid[best] + step * np.clip(shift, -1, 1))
    return np.where(mid > 0, np.clip(sigma, sigmas.min(), sigmas.max()), 0)


def normal_albedo(basis: BasisRecord) -> F64:
    """Albedo [J] of each kernel for a viewer along the normal, without colour.

    With o = n, o.h = n.h = cos(alpha) and i lies at 2 alpha, so that a specular kernel's albedo is the mean
    of G F over the lobe, and light from below the horizon (alpha > 45 degrees) is lost.
    """
    # Midpoints of equal shares of the lobe: t^2 / sigma^2 is exponentially distributed.
    share = -np.log((np.arange(4096) + 0.5) / 4096)
    found = []
    for masking, power, sigma in basis.lobes:
        cos2 = 1 / (1 + share * sigma**2)
        g = np.where(cos2 > 0.5, _masking(masking, np.maximum(2 * cos2 - 1, 1e-9)), 0)
        found.append((g * (1 - np.sqrt(cos2)) ** power).mean())
    return np.array(found + [_diffuse_albedo(name) for name in basis.diffuse])


def _masking(name: str, cos_i: F64) -> F64:
    """G for o = n."""
    if name == "vgroove":
        return np.minimum(1, 2 * cos_i)
    kind, _, alpha = name.partition(":")
    if kind != "smith":
        raise InputError(f"masking {name!r}", expected="'vgroove' or 'smith:ALPHA'")
    a2 = float(alpha) ** 2
    return np.asarray(2 * cos_i / (cos_i + np.sqrt(a2 + (1 - a2) * cos_i**2)), dtype=np.float64)


def _diffuse_albedo(name: str) -> float:
    """For o = n: the cosine-weighted mean of a(n.i), which is 2 int c a(c) dc, times b(1)."""
    known = {
        "lambert": 1.0,
        "half": 23 / 28 * 31 / 32,
        "grazing5": 1 / 21,
        "grazing10": 1 / 66,
        "shade": 1 - np.log(2),
    }
    if name not in known:
        raise InputError(f"diffuse kernel {name!r}", expected=f"one of {', '.join(known)}")
    return float(known[name])

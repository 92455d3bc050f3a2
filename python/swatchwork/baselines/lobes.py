# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""One diffuse and one specular lobe: the parametric model that the methods before this one fit."""

from __future__ import annotations

import numpy as np

from ..arrays import F64, Float
from ..errors import InputError
from ..reflectance import GenericBasis

TAUS = (0.0, 0.02, 0.04, 0.06, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
"""Fresnel reflectances at normal incidence (Eq. 11) that are tried."""


BRIGHTEST = 1.0
"""Most that either colour may be: all light. A lobe that no measurement hits has no other bound."""


def single_lobe(
    basis: GenericBasis, responses: Float, target: Float, weight: Float, taus: tuple[float, ...] = TAUS
) -> F64:
    """The best Lambertian plus one Cook-Torrance lobe, as a representative [J, 3].

    Roughness and tau are those of one grid point for all channels, found by trying each; the two colours are
    least squares between 0 and BRIGHTEST, in closed form.

    Args:
        basis: has ``lambert`` and, for its first masking, the Fresnel exponents 5 and 0.
        responses: [R, J, 3] of the kernels, or [R, J, 1] where the channels are alike.
        target: [R, 3] to be met.
        weight: [R] of squared errors.
        taus: those to try.

    Raises:
        InputError: the basis lacks one of these kernels.
    """
    flat, rise, lambert = _columns(basis)
    a = np.asarray(responses, np.float64)
    w, y = np.asarray(weight, np.float64), np.asarray(target, np.float64)
    d, f, r = a[:, lambert], a[:, flat], a[:, rise]
    dd = _sum(w, d, d)
    df, dr, ff, fr, rr = (_sum(w, *pair) for pair in ((d, f), (d, r), (f, f), (f, r), (r, r)))
    yd = np.einsum("r,rc,rc->c", w, np.broadcast_to(d, y.shape), y)
    yf, yr = (
        np.einsum("r,rsc,rc->sc", w, np.broadcast_to(x, (*x.shape[:2], 3)), y, optimize=True) for x in (f, r)
    )
    best: tuple[float, int, float, F64, F64] | None = None
    for tau in taus:
        cross = tau * df + (1 - tau) * dr
        square = tau**2 * ff + 2 * tau * (1 - tau) * fr + (1 - tau) ** 2 * rr
        diffuse, specular, gain = _two(dd, cross, square, yd, tau * yf + (1 - tau) * yr)
        s = int(gain.sum(axis=-1).argmax())
        if best is None or gain[s].sum() > best[0]:
            best = (float(gain[s].sum()), s, tau, diffuse[s], specular[s])
    assert best is not None
    _, s, tau, diffuse, specular = best
    found = np.zeros((basis.kernels, 3))
    found[lambert] = diffuse
    found[flat[s]], found[rise[s]] = tau * specular, (1 - tau) * specular
    return found


def _columns(basis: GenericBasis) -> tuple[list[int], list[int], int]:
    """Kernels of tau = 1 and of tau = 0, by roughness, and the Lambertian."""
    of = [[j for j, lobe in enumerate(basis.lobes) if lobe[:2] == (basis.maskings[0], p)] for p in (0, 5)]
    if "lambert" not in basis.diffuse or not all(of):
        raise InputError(
            f"the basis {basis.name!r} has no single lobe",
            expected="a Lambertian kernel and the Fresnel exponents 5 and 0",
        )
    return of[0], of[1], len(basis.lobes) + basis.diffuse.index("lambert")


def _sum(w: F64, a: F64, b: F64) -> F64:
    """Weighted products [S, C] or [C] of columns [R, S, C] or [R, C]."""
    if a.ndim == b.ndim == 2:
        return np.asarray(np.einsum("r,rc,rc->c", w, a, b))
    a, b = (x[:, None] if x.ndim == 2 else x for x in (a, b))
    return np.asarray((w[:, None, None] * a * b).sum(axis=0))


def _two(aa: F64, ab: F64, bb: F64, ya: F64, yb: F64) -> tuple[F64, F64, F64]:
    """Least squares of two columns, weights [S, 3] between 0 and BRIGHTEST, and the squared error saved."""
    aa, ab, bb, ya, yb = np.broadcast_arrays(aa, ab, bb, ya, yb)
    aa, bb = np.maximum(aa, 1e-300), np.maximum(bb, 1e-300)
    determinant = aa * bb - ab**2
    solvable = determinant > 1e-12 * aa * bb
    divisor = np.where(solvable, determinant, 1.0)
    inside = (bb * ya - ab * yb) / divisor, (aa * yb - ab * ya) / divisor
    feasible = solvable & (np.minimum(*inside) >= 0) & (np.maximum(*inside) <= BRIGHTEST)
    candidates = [(np.where(feasible, inside[0], 0), np.where(feasible, inside[1], 0))]
    # Otherwise the optimum is on an edge of the square of weights: one at a bound, the other free.
    for bound in (0.0, BRIGHTEST):
        candidates.append((np.clip((ya - bound * ab) / aa, 0, BRIGHTEST), np.full_like(bb, bound)))
        candidates.append((np.full_like(aa, bound), np.clip((yb - bound * ab) / bb, 0, BRIGHTEST)))
    gains = [2 * (a * ya + b * yb) - (a * a * aa + 2 * a * b * ab + b * b * bb) for a, b in candidates]
    best = np.argmax(gains, axis=0)[None]
    a, b, gain = (
        np.take_along_axis(np.stack(x), best, axis=0)[0]
        for x in ([c[0] for c in candidates], [c[1] for c in candidates], gains)
    )
    return a, b, gain

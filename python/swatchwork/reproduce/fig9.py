# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Fig. 9: two halves that differ in their Fresnel coefficient alone."""

from __future__ import annotations

import numpy as np

from ..arrays import F64
from ..baselines import SparseAsPossible
from ..reflectance import paper
from ..solve import SolveOptions
from .experiment import Claim, Experiment, Figures, Setting, Table
from .spheres import Test, recover, views_of
from .targets import halves

TAUS, SIGMA = (0.15, 0.85), 0.165
VIEWS, TEXELS = 8, 600
CLOSE = 0.1
"""Of tau, that counts as recovered."""


def measure(setting: Setting) -> Figures:
    """tau of both halves, and the novel-light error."""

    def make() -> Figures:
        sphere = halves(SIGMA, TAUS, setting.pick(TEXELS, 150))
        light, test = setting.data.probe("grace"), Test.of(sphere, setting.data.probe("uffizi"))
        capture = sphere.captured(light, views_of(0)[: setting.pick(VIEWS, 4)], paper())
        found, weights = recover(SparseAsPossible(SolveOptions(max_N=4, max_n=2)), capture)
        tau = fresnel_at_normal(weights, found.representatives)
        left = sphere.weights[:, 0] > 0.5
        return {
            "nrms": test.error(found, weights),
            "n": found.found["n"],
            "N": found.materials,
            "tau": [[float(q) for q in np.quantile(tau[side], (0.05, 0.5, 0.95))] for side in (left, ~left)],
        }

    return setting.kept("fig9", make)


def fresnel_at_normal(weights: F64, representatives: F64) -> F64:
    """tau [M] of blends in the paper's basis: weight of the tau = 1 kernels over that of all (Eq. 11)."""
    powers = np.array([lobe.power for lobe in paper().lobes])
    specular = representatives[:, : len(powers)].sum(axis=-1)
    full, rise = specular[:, powers == 0].sum(axis=1), specular[:, powers == 5].sum(axis=1)
    return np.asarray((weights @ full) / np.maximum(weights @ (full + rise), 1e-30))


def claims(figures: Figures) -> list[Claim]:
    """tau is recovered."""
    medians = [side[1] for side in figures["tau"]]
    return [
        Claim(
            "tau = 0.15 and 0.85 are recovered, though both halves reflect alike at normal incidence.",
            f"tau = {medians[0]:.3f} and {medians[1]:.3f} at the median; novel-light NRMS "
            f"{100 * figures['nrms']:.2f} %",
            max(abs(m - t) for m, t in zip(medians, TAUS, strict=True)) < CLOSE,
        )
    ]


def tables(figures: Figures) -> list[Table]:
    """tau by half."""
    rows = tuple(
        (f"{t:g}", *(f"{q:.3f}" for q in side)) for t, side in zip(TAUS, figures["tau"], strict=True)
    )
    return [Table(("true tau", "5th percentile", "median", "95th"), rows)]


FIG9 = Experiment(
    "fig9",
    "Fig. 9: Fresnel recovery",
    measure,
    claims,
    tables,
    minutes=0.2,
    how="A sphere of two materials of roughness 0.165 (between two sigmas of the basis), specular colours "
    "scaled so that both reflect alike at normal incidence; k = 8 under Grace.",
)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What the synthetic experiments share: capture a sphere, hand it to a method, see it under other light."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from pathlib import Path

import numpy as np

from ..arrays import F64, Bool
from ..baselines import Measurements, Method, Recovered
from ..light import Environment
from ..reflectance import GenericBasis
from ..response import generic_responses, representative_responses
from ..simulate import Pairs, Sphere, SphereCapture, nrms, random_directions, visible_pairs
from ..whole import whole_file
from .pictures import Disc, comparison

Capture = Callable[[], SphereCapture]
"""Made when first asked for: finished parts do not need it."""
PORTRAIT_FROM = np.array([0.5, -0.8, 0.35])
TEST_VIEWS = 4
TEST_SEED = 10_000
"""Views of another seed: none of them is measured."""


@dataclass(frozen=True, eq=False)
class Test:
    """A sphere under novel light from novel views: the truth that recovered materials are held against."""

    light: Environment
    pairs: Pairs
    truth: F64
    """[P, 3]"""

    @classmethod
    def of(cls, sphere: Sphere, light: Environment, seed: int = TEST_SEED) -> Test:
        """Render the truth."""
        pairs = visible_pairs(sphere.normal, random_directions(TEST_VIEWS, seed))
        return cls(light, pairs, sphere.radiance(light, pairs))

    def error(self, found: Recovered, weights: F64) -> float:
        """NRMS of the pictures, by pixels, of a reflectance with weights [M, N] at all texels."""
        made = rendered(found, weights, self.light, self.pairs)
        return nrms(made, self.truth, self.pairs.normal, self.pairs.to_viewer)

    def errors(self, found: Recovered, weights: F64, seen: Bool) -> tuple[float, float]:
        """NRMS of the pictures, by pixels: of all they show, and of texels that are seen [M] in the capture.

        ``weights`` [M, N] are those of all texels.
        """
        made, at = rendered(found, weights, self.light, self.pairs), seen[self.pairs.texel]
        normal, to_viewer = self.pairs.normal, self.pairs.to_viewer
        return (
            nrms(made, self.truth, normal, to_viewer),
            nrms(made[at], self.truth[at], normal[at], to_viewer[at]),
        )


def rendered(found: Recovered, weights: F64, light: Environment, pairs: Pairs) -> F64:
    """Radiance [P, 3] of a recovered reflectance with weights [M, N] at all texels."""
    if len(found.representatives) > found.basis.kernels:
        # More representatives than kernels: a texel's kernels are summed first.
        kernels = np.einsum("mn,njc->mjc", weights, found.representatives, optimize=True)
        s = generic_responses(found.basis, light.pyramid(), pairs.normal, pairs.to_viewer)
        return np.asarray(np.einsum("pjc,pjc->pc", s, kernels[pairs.texel], optimize=True))
    s = representative_responses(
        found.basis, found.representatives, light.pyramid(), pairs.normal, pairs.to_viewer
    )
    return np.asarray(np.einsum("pn,pnc->pc", weights[pairs.texel], s, optimize=True))


def measurements_of(capture: SphereCapture) -> Measurements:
    """What a method sees of a captured sphere: texels in no view are left out."""
    return Measurements(capture.basis, capture.responses, capture.radiance, capture.offsets)


def recover(method: Method, capture: SphereCapture) -> tuple[Recovered, F64]:
    """What a method finds, and its weights [M, N] at all texels: an unseen one has its nearest seen one's."""
    found = method.recover(measurements_of(capture))
    return found, found.weights[capture.nearest_seen]


def label_of(method: Method) -> str:
    """A method's name, and its penalty where several are tried."""
    strength = getattr(method, "strength", None)
    return method.name if strength is None else f"{method.name} {strength:g}"


def run(
    method: Method, capture: Capture, tests: Sequence[Test], portrait: Portrait | None = None, name: str = ""
) -> dict[str, float | str]:
    """Recover a capture, and measure: the mean NRMS over tests, and what was found; and take its portrait."""
    taken = capture()
    found, weights = recover(method, taken)
    if portrait is not None:
        portrait.take(name, found, weights)
    seen = np.diff(taken.pairs.offsets) > 0
    errors = np.mean([test.errors(found, weights, seen) for test in tests], axis=0)
    return {
        "method": method.name,
        "k": taken.views,
        "nrms": float(errors[0]),
        "nrms_seen": float(errors[1]),
        "materials": found.materials,
        "status": found.status,
        **{f"found_{name}": value for name, value in found.found.items()},
    }


def captures(
    sphere: Sphere,
    light: Environment,
    views: F64,
    basis: GenericBasis,
    noise_percent: float = 0.0,
    seed: int = 0,
) -> Capture:
    """A capture that is made when first asked for, and then kept: methods share it."""
    return cache(lambda: sphere.captured(light, views, basis, noise_percent, seed))


def with_basis(capture: Capture, basis: GenericBasis) -> Capture:
    """The same measurements for a method that uses another basis."""
    return cache(lambda: replace(capture(), basis=basis))


@dataclass(frozen=True, eq=False)
class Portrait:
    """One picture of a sphere under one light, of the truth and of all that methods recover."""

    sphere: Sphere
    light: Environment
    folder: Path
    """Of finished parts: what a method's sphere looks like is kept as NAME.npy."""
    size: int

    @cached_property
    def disc(self) -> Disc:
        """The picture's pixels."""
        return Disc.of(PORTRAIT_FROM, self.size)

    @cached_property
    def pairs(self) -> Pairs:
        """The pixels, as pairs of the sphere's texels."""
        return self.disc.on(self.sphere.normal)

    def take(self, name: str, found: Recovered, weights: F64) -> None:
        """Keep the look of what a method recovered."""
        with whole_file(self.folder / f"{name}.npy") as made:
            np.save(made, rendered(found, weights, self.light, self.pairs))

    def show(self, file: Path, names: Mapping[str, str]) -> None:
        """Write truth and portraits (label by name) side by side."""
        taken = {label: self.folder / f"{name}.npy" for name, label in names.items()}
        there = [
            (label, np.load(path, allow_pickle=False)) for label, path in taken.items() if path.is_file()
        ]
        comparison(file, self.disc, self.sphere.radiance(self.light, self.pairs), there)


@lru_cache
def views_of(trial: int, most: int = 96) -> F64:
    """The views of a trial, uniform over the sphere; every method gets the first k of the same ones."""
    return random_directions(most, 500 + trial)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Measured isotropic reflectances: MERL tables, and two published compact forms of them.

Every reader returns a `MeasuredBrdf`, a function of two unit directions in the local frame (the normal is +z)
with values in 1/sr. All of them are made reciprocal, non-negative, and zero below the horizon.

- MERL ``.binary`` tables (Matusik et al. 2003), at the nearest cell;
- Neural-BRDF networks (Sztrajman et al. 2021), which also exist for the isotropic materials of RGL;
- NPF, non-parametric microfacet factors (Bagher et al. 2016).
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Protocol

import numpy as np

from ..arrays import F32, F64, Float, unit
from ..errors import InputError

MERL_DIMENSIONS = (90, 90, 180)  # theta_h (square-root spacing), theta_d, phi_d
MERL_SCALE = (1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0)


class MeasuredBrdf(Protocol):
    """A reflectance without parameters."""

    @property
    def name(self) -> str:
        """Of the material."""
        ...

    def evaluate(self, i_in_local: Float, o_in_local: Float) -> F64:
        """BRDF values [..., 3] in 1/sr for unit directions to the light and to the viewer, both [..., 3]."""
        ...


@dataclass(frozen=True)
class Angles:
    """Half and difference vectors (Rusinkiewicz 1998): h lies in the xz plane, d is i seen from h."""

    cos_h: F64
    sin_h: F64
    d: F64  # [..., 3]; d.z = i.h, and swapping i and o turns d.x, d.y around

    @property
    def theta_h(self) -> F64:
        return np.arctan2(self.sin_h, self.cos_h)

    @property
    def theta_d(self) -> F64:
        return np.arctan2(np.hypot(self.d[..., 0], self.d[..., 1]), self.d[..., 2])


def half_difference(i_in_local: Float, o_in_local: Float) -> Angles:
    """The half and the difference vector of directions [..., 3] (broadcast against each other)."""
    i, o = np.broadcast_arrays(np.asarray(i_in_local, np.float64), np.asarray(o_in_local, np.float64))
    h = unit(i + o)
    sin_h = np.hypot(h[..., 0], h[..., 1])
    # At the pole the azimuth of h is free; x is as good as any.
    safe = np.where(sin_h > 0, sin_h, 1.0)
    cos_phi = np.where(sin_h > 0, h[..., 0] / safe, 1.0)
    sin_phi = h[..., 1] / safe
    along = i[..., 0] * cos_phi + i[..., 1] * sin_phi
    d = np.stack(
        [
            h[..., 2] * along - sin_h * i[..., 2],
            i[..., 1] * cos_phi - i[..., 0] * sin_phi,
            sin_h * along + h[..., 2] * i[..., 2],
        ],
        axis=-1,
    )
    return Angles(h[..., 2], sin_h, d)


def above_horizon(i_in_local: Float, o_in_local: Float, value: F64) -> F64:
    """`value` [..., 3] where both directions are above the surface, zero elsewhere."""
    above = (np.asarray(i_in_local)[..., 2] > 0) & (np.asarray(o_in_local)[..., 2] > 0)
    return np.where(above[..., None], value, 0.0)


@dataclass(frozen=True)
class NeuralBrdf:
    """f = max(0, exp(W3 relu(W2 relu(W1 x + b1) + b2) + b3) - 1), x = (h, d), averaged over both orders."""

    name: str
    layers: tuple[tuple[F32, F32], ...]

    def evaluate(self, i_in_local: Float, o_in_local: Float) -> F64:
        """As `MeasuredBrdf.evaluate`. The networks by themselves are off reciprocity by 1 to 6 %."""
        angles = half_difference(i_in_local, o_in_local)
        # The x component of h is sin theta_h, its y component 0.
        x = np.concatenate(
            [np.stack([angles.sin_h, 0.0 * angles.sin_h, angles.cos_h], axis=-1), angles.d], axis=-1
        ).astype(np.float32)
        swapped = x * np.array([1, 1, 1, -1, -1, 1], np.float32)
        value = 0.5 * (self._network(x) + self._network(swapped)).astype(np.float64)
        return above_horizon(i_in_local, o_in_local, value)

    def _network(self, x: F32) -> F32:
        for w, b in self.layers[:-1]:
            x = np.maximum(x @ w + b, 0.0)
        w, b = self.layers[-1]
        value: F32 = np.maximum(np.expm1(x @ w + b), np.float32(0.0))
        return value


@dataclass(frozen=True)
class NpfBrdf:
    """pi f = rho_d + rho_s D(theta_h) F(theta_d) G1(theta_i) G1(theta_o) / (cos_i cos_o)."""

    name: str
    diffuse: F64  # [3]
    specular: F64  # [3]
    ndf: F64  # [90, 3], bins of sqrt(theta_h / 90 degrees)
    fresnel: F64  # [90, 3], bins of theta_d / 90 degrees
    masking: F64  # [90, 3], bins of theta / 90 degrees

    def evaluate(self, i_in_local: Float, o_in_local: Float) -> F64:
        """As `MeasuredBrdf.evaluate`, linear between bin centres."""
        i, o = np.broadcast_arrays(np.asarray(i_in_local, np.float64), np.asarray(o_in_local, np.float64))
        angles = half_difference(i, o)
        cos_i, cos_o = np.maximum(i[..., 2], 1e-6), np.maximum(o[..., 2], 1e-6)
        quarter = np.pi / 2
        lobe = (
            _table(self.ndf, np.sqrt(angles.theta_h / quarter))
            * _table(self.fresnel, angles.theta_d / quarter)
            * _table(self.masking, np.arccos(np.minimum(cos_i, 1.0)) / quarter)
            * _table(self.masking, np.arccos(np.minimum(cos_o, 1.0)) / quarter)
        )
        value = (self.diffuse + self.specular * lobe / (cos_i * cos_o)[..., None]) / np.pi
        return above_horizon(i, o, np.maximum(value, 0.0))


@dataclass(frozen=True)
class MerlBrdf:
    """A full MERL table, looked up at the nearest cell; invalid (negative) cells are zero."""

    name: str
    table: F32  # [90, 90, 180, 3], scaled to 1/sr

    def evaluate(self, i_in_local: Float, o_in_local: Float) -> F64:
        """As `MeasuredBrdf.evaluate`; phi_d and phi_d + pi share a cell, so the table is reciprocal."""
        angles = half_difference(i_in_local, o_in_local)
        phi_d = np.mod(np.arctan2(angles.d[..., 1], angles.d[..., 0]), np.pi)
        quarter = np.pi / 2
        fractions = (np.sqrt(angles.theta_h / quarter), angles.theta_d / quarter, phi_d / np.pi)
        cell = tuple(
            np.clip((f * n).astype(np.int64), 0, n - 1)
            for f, n in zip(fractions, MERL_DIMENSIONS, strict=True)
        )
        return above_horizon(i_in_local, o_in_local, self.table[cell].astype(np.float64))


def material_names(npz: str | PathLike[str]) -> tuple[str, ...]:
    """The materials of a file for `read_neural_brdf` or `read_npf`."""
    with np.load(npz, allow_pickle=False) as data:
        return tuple(str(name) for name in data["names"])


def read_neural_brdf(npz: str | PathLike[str], name: str) -> NeuralBrdf:
    """One network of a file with `names`, `w1`, `b1`, `w2`, `b2`, `w3`, `b3` (row-vector times matrix).

    Raises:
        InputError: the file has no material of that name.
    """
    with np.load(npz, allow_pickle=False) as data:
        m = _find(npz, data["names"], name)
        layers = tuple((data[f"w{k}"][m], data[f"b{k}"][m]) for k in (1, 2, 3))
    return NeuralBrdf(name, layers)


def read_npf(npz: str | PathLike[str], name: str) -> NpfBrdf:
    """One material of a file with `names`, `rho_d`, `rho_s`, `D`, `F`, `G1`.

    Raises:
        InputError: the file has no material of that name.
    """
    with np.load(npz, allow_pickle=False) as data:
        m = _find(npz, data["names"], name)
        rows = [data[key][m].astype(np.float64) for key in ("rho_d", "rho_s", "D", "F", "G1")]
    return NpfBrdf(name, *rows)


def read_merl_binary(file: str | PathLike[str]) -> MerlBrdf:
    """A MERL ``.binary`` table: three int32 dimensions, then float64 [3, theta_h, theta_d, phi_d].

    Raises:
        InputError: the dimensions or the length of the file are not MERL's.
    """
    raw = Path(file).read_bytes()
    dimensions = tuple(int(n) for n in np.frombuffer(raw[:12], "<i4")) if len(raw) >= 12 else ()
    expected_bytes = 12 + 3 * 8 * int(np.prod(MERL_DIMENSIONS))
    if dimensions != MERL_DIMENSIONS or len(raw) != expected_bytes:
        raise InputError(
            f"a table of dimensions {dimensions} in {len(raw)} bytes",
            file=file,
            expected=f"dimensions {MERL_DIMENSIONS} in {expected_bytes} bytes (a MERL .binary file)",
        )
    table = np.frombuffer(raw, "<f8", offset=12).reshape(3, *MERL_DIMENSIONS)
    scaled = np.moveaxis(table, 0, -1) * np.array(MERL_SCALE)
    return MerlBrdf(Path(file).stem, np.maximum(scaled, 0.0).astype(np.float32))


def _find(npz: str | PathLike[str], names: np.ndarray, name: str) -> int:
    known = [str(n) for n in names]
    if name not in known:
        raise InputError(
            f"no material {name!r}", file=npz, expected=f"one of {len(known)} names, such as {known[0]!r}"
        )
    return known.index(name)


def _table(rows: F64, fraction: F64) -> F64:
    """Rows [B, 3] over bins of [0, 1], linear between bin centres and constant beyond the outer ones."""
    at = np.clip(fraction * len(rows) - 0.5, 0, len(rows) - 1)
    low = np.minimum(at.astype(np.int64), len(rows) - 2)
    share = (at - low)[..., None]
    value: F64 = rows[low] * (1 - share) + rows[low + 1] * share
    return value

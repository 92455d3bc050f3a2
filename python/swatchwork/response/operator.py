# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Responses of many (point, viewer) pairs, in the Rust core."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from swatchwork._native import Pyramid, RingBasis, instruction_sets
from swatchwork.arrays import F32, F64, I32, U64, Float
from swatchwork.reflectance import DIFFUSE_KERNELS, DIFFUSE_SHAPES, GenericBasis
from swatchwork.response.rings import DEFAULT_QUADRATURE, Quadrature

__all__ = ["compiled", "generic_responses", "instruction_sets", "representative_responses"]


@lru_cache(maxsize=16)
def compiled(basis: GenericBasis, quadrature: Quadrature = DEFAULT_QUADRATURE) -> RingBasis:
    """``basis`` as rows over ring means, for the Rust core; kept for each pair of objects."""
    terms = len(basis.fresnel)
    plane = [
        terms * basis.maskings.index(lobe.masking) + basis.fresnel.index(lobe.power) for lobe in basis.lobes
    ]
    weights = [quadrature.weights(lobe.sigma) for lobe in basis.lobes]
    shapes = list(DIFFUSE_SHAPES)
    diffuse = np.zeros((len(basis.diffuse), len(shapes), len(shapes)), np.float32)
    for row, name in zip(diffuse, basis.diffuse, strict=True):
        for of_light, of_viewer in DIFFUSE_KERNELS[name]:
            row[shapes.index(of_light), shapes.index(of_viewer)] += 1.0
    bins = quadrature.bins
    return RingBasis(
        quadrature.tangents.astype(np.float32),
        quadrature.solid_angles.astype(np.float32),
        quadrature.azimuths.astype(np.uint32),
        quadrature.layer.astype(np.uint32),
        (float(bins[0]), float(bins[1] / bins[0]), bins.size),
        list(basis.maskings),
        list(basis.fresnel),
        np.array(plane, np.uint32),
        np.array(weights, np.float32).reshape(len(plane), quadrature.azimuths.size + 2 * bins.size),
        diffuse.reshape(-1, len(shapes) ** 2),
    )


def generic_responses(
    basis: GenericBasis,
    pyramid: Pyramid,
    normal: Float,
    to_viewer: Float,
    sky: U64 | None = None,
    sky_row: I32 | None = None,
    *,
    quadrature: Quadrature = DEFAULT_QUADRATURE,
    instruction_set: str | None = None,
) -> F32:
    """Radiance that each pair's viewer would see of each generic kernel (Eq. 13).

    Args:
        basis: the generic kernels.
        pyramid: the environment, in the world frame.
        normal: unit shading normals [P, 3], world.
        to_viewer: unit directions to the viewer [P, 3], world.
        sky: visibility of 64 x 64 octahedral cells [Q, 64] (bit i of word j; 1 = sky), world.
        sky_row: row of ``sky`` of each pair [P], -1 where all the sky is visible (the default).
        quadrature: where half-vectors are sampled.
        instruction_set: one of ``instruction_sets()``; the best one by default.

    Returns:
        Responses [P, J, 3] in the environment's unit of radiance; 0 where n.o <= 0.

    Raises:
        ValueError: naming the argument whose shape, layout or values are wrong.
    """
    pairs = _pairs(normal, to_viewer, sky, sky_row)
    return compiled(basis, quadrature).generic_responses(pyramid, *pairs, instruction_set)


def representative_responses(
    basis: GenericBasis,
    representatives: F64,
    pyramid: Pyramid,
    normal: Float,
    to_viewer: Float,
    sky: U64 | None = None,
    sky_row: I32 | None = None,
    *,
    quadrature: Quadrature = DEFAULT_QUADRATURE,
    instruction_set: str | None = None,
) -> F32:
    """Radiance that each pair's viewer would see of each representative (Eq. 14).

    The kernels are folded first, so that no [P, J, 3] is ever formed. Arguments and errors are those
    of :func:`generic_responses`, with ``representatives`` [N, J, 3]; returns [P, N, 3].
    """
    pairs = _pairs(normal, to_viewer, sky, sky_row)
    weights = np.ascontiguousarray(representatives, np.float64)
    return compiled(basis, quadrature).representative_responses(weights, pyramid, *pairs, instruction_set)


def _pairs(
    normal: npt.ArrayLike, to_viewer: npt.ArrayLike, sky: U64 | None, sky_row: I32 | None
) -> tuple[F32, F32, U64, I32]:
    n, o = np.ascontiguousarray(normal, np.float32), np.ascontiguousarray(to_viewer, np.float32)
    masks = np.zeros((0, 64), np.uint64) if sky is None else np.ascontiguousarray(sky, np.uint64)
    rows = np.full(len(n), -1, np.int32) if sky_row is None else np.ascontiguousarray(sky_row, np.int32)
    return n, o, masks, rows

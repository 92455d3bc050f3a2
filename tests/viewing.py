# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Small scenes for the tests of the viewer's page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swatchwork.capture import Camera
from swatchwork.material import BasisRecord, Material
from swatchwork.reflectance import GenericBasis
from swatchwork.relight import RelitScene
from swatchwork.simulate import blend_pattern, camera_towards, in_basis, satin_materials, shape
from swatchwork.surface import build_atlas

ATLAS = 96
WINDOW = 22, 16
"""Pixels of the pictures that are compared: windows of pictures of an object 160 pixels wide."""


def material(name: str, basis: GenericBasis) -> Material:
    """Two of four satin materials at each point of a shape."""
    mesh, truth = shape(name, 40), in_basis(satin_materials(0), basis)
    atlas = build_atlas(mesh, ATLAS)
    index, weight = blend_pattern(atlas.position(slice(None)), seed=0)
    full_index, full_weight = np.zeros((ATLAS, ATLAS, 2), np.uint32), np.zeros((ATLAS, ATLAS, 2), np.float32)
    coverage = np.full((ATLAS, ATLAS), -1, np.int32)
    full_index[atlas.row, atlas.col], full_weight[atlas.row, atlas.col] = index, weight
    coverage[atlas.row, atlas.col] = 1
    assert mesh.uv is not None
    return Material(
        basis=BasisRecord(
            basis.name, tuple(basis.sigmas.tolist()), basis.maskings, basis.diffuse, basis.fresnel
        ),
        representatives=truth,
        index=full_index,
        weight=full_weight,
        coverage=coverage,
        residual=np.full((ATLAS, ATLAS), 0.1, np.float32),
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=mesh.normals,
        uv=mesh.uv,
    )


def scene(name: str, basis: GenericBasis) -> RelitScene:
    """The same, ready to render, with shadows of few samples."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("swatchwork.relight.scene.SKY_SAMPLES", 2000)
        return RelitScene.of(material(name, basis))


def window(direction: np.ndarray, left: int, top: int) -> Camera:
    """A window of the picture that a camera in some direction takes."""
    whole, (width, height) = camera_towards(direction, 160), WINDOW
    return replace(whole, width=width, height=height, cx=whole.cx - left, cy=whole.cy - top)

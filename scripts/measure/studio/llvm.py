# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mitsuba, started with an LLVM that it can use, and light in its layout."""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib
import importlib.util
import os
from typing import Any

import numpy as np

from swatchwork.light import Environment

LLVM_VERSIONS = range(23, 16, -1)
"""With older ones Mitsuba 3.9 aborts."""


def find_llvm() -> str:
    """A name by which the loader finds LLVM.

    Raises:
        SystemExit: there is none that will do.
    """
    if given := os.environ.get("DRJIT_LIBLLVM_PATH"):
        return given
    for version in LLVM_VERSIONS:
        names = (
            f"libLLVM.so.{version}.1",
            f"libLLVM-{version}.so",
            ctypes.util.find_library(f"LLVM-{version}"),
        )
        for name in filter(None, names):
            try:
                ctypes.CDLL(name)
            except OSError:
                continue
            return name
    raise SystemExit(
        "Mitsuba needs LLVM 17 or newer and none was found: install it (Debian, Ubuntu: apt install "
        "libllvm19), or set DRJIT_LIBLLVM_PATH to a libLLVM.so"
    )


def start(variant: str) -> tuple[Any, Any]:
    """Dr.Jit and Mitsuba in a variant.

    Raises:
        SystemExit: Mitsuba or its LLVM is missing.
    """
    if importlib.util.find_spec("mitsuba") is None:
        raise SystemExit("Mitsuba 3 is not installed: pip install 'mitsuba>=3.9'")
    os.environ["DRJIT_LIBLLVM_PATH"] = find_llvm()
    drjit, mitsuba = importlib.import_module("drjit"), importlib.import_module("mitsuba")
    mitsuba.set_variant(variant)
    return drjit, mitsuba


def raster(light: Environment) -> np.ndarray:
    """The light in Mitsuba's layout and axes: rows from pole to pole, centres of columns at +0.5."""
    height = light.radiance.shape[0] + 1
    v = np.arange(height)[:, None] / (height - 1) * np.pi
    u = (np.arange(2 * height - 2) + 0.5) / (2 * height - 2) * 2 * np.pi
    d = np.broadcast_arrays(np.sin(v) * np.sin(u), np.cos(v), -np.sin(v) * np.cos(u))
    return light.lookup(np.stack(d, axis=-1)).astype(np.float32)


def textured_mesh(mi: Any, mesh: Any, bsdf: dict[str, Any]) -> Any:
    """A mesh in Mitsuba's form; ``v`` of its texture coordinates is upward, as ours."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    of_vertices = {"has_vertex_normals": True, "has_vertex_texcoords": True}
    shape = mi.Mesh("object", len(mesh.vertices), len(mesh.faces), props=properties, **of_vertices)
    arrays = mi.traverse(shape)
    arrays["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    arrays["vertex_normals"] = mesh.normals.astype(np.float32).ravel()
    arrays["vertex_texcoords"] = mesh.uv.astype(np.float32).ravel()
    arrays["faces"] = mesh.faces.astype(np.uint32).ravel()
    arrays.update()
    return shape


def bitmap(mi: Any, values: np.ndarray) -> dict[str, Any]:
    """A texture of linear numbers; the first row is at v = 0."""
    return {"type": "bitmap", "bitmap": mi.Bitmap(values), "raw": True, "format": "variant"}

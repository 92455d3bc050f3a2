# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Swatchwork: spatially-varying reflectance from few photographs under known natural light.

    import swatchwork
    found = swatchwork.reconstruct_folder("my-capture", "my-material")
    swatchwork.relight_folder("my-material", "my-capture/transforms.json", "renders")
    print(swatchwork.evaluate_folders("renders", "my-capture").nrms)

The rooms below (``swatchwork.capture``, ``swatchwork.solve``, ...) are public too: each one's surface is
its ``__init__``. Names here are looked up when first used, so that importing the package stays quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .capture import read_capture
    from .material import read_material, write_material
    from .workflow import (
        ReconstructOptions,
        SolveOptions,
        evaluate_folders,
        reconstruct_folder,
        relight_folder,
        run_demo,
    )

__all__ = [
    "ReconstructOptions",
    "SolveOptions",
    "evaluate_folders",
    "read_capture",
    "read_material",
    "reconstruct_folder",
    "relight_folder",
    "run_demo",
    "write_material",
]

_HOME = dict.fromkeys(__all__, "workflow") | {
    "read_capture": "capture",
    "read_material": "material",
    "write_material": "material",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)

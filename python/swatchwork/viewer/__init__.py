# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""An interactive page: the material under any light, in a browser, from one file."""

from .page import bundled_script, check_replaceable, render_viewer, write_viewer
from .scene import Light, Shot, TexelMap, ViewerScene, shot_of

__all__ = [
    "Light",
    "Shot",
    "TexelMap",
    "ViewerScene",
    "bundled_script",
    "check_replaceable",
    "render_viewer",
    "shot_of",
    "write_viewer",
]

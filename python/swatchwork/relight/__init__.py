# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Materials under any light: EXR frames, previews, turntables."""

from .frames import Lighting, RelitFrame, output_names, relight
from .preview import display_image, turntable
from .render import render, shade
from .scene import RelitScene
from .view import View, cosine_map, see

__all__ = [
    "Lighting",
    "RelitFrame",
    "RelitScene",
    "View",
    "cosine_map",
    "display_image",
    "output_names",
    "relight",
    "render",
    "see",
    "shade",
    "turntable",
]

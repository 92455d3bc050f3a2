# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Light: environment maps as functions of direction, in three conventions, and on the octahedral square."""

from swatchwork.light.conventions import direction_from_uv, solid_angles, uv_from_direction, vertical
from swatchwork.light.environment import Environment, read_environment

__all__ = [
    "Environment",
    "direction_from_uv",
    "read_environment",
    "solid_angles",
    "uv_from_direction",
    "vertical",
]

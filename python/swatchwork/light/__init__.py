# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Light: environment maps as functions of direction, in three conventions, and on the octahedral square."""

from swatchwork.light.conventions import direction_from_uv, solid_angles, uv_from_direction
from swatchwork.light.environment import Environment, read_environment
from swatchwork.light.octahedral import direction_from_square, pixel_directions, square_from_direction

__all__ = [
    "Environment",
    "direction_from_square",
    "direction_from_uv",
    "pixel_directions",
    "read_environment",
    "solid_angles",
    "square_from_direction",
    "uv_from_direction",
]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where photographs were taken from, in the world of the object's mesh (paper, section 6)."""

from swatchwork.prepare.registering.motion import apart, moved, projected
from swatchwork.prepare.registering.view import View

__all__ = ["View", "apart", "moved", "projected"]

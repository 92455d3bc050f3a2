# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Prepare: from what a camera wrote to a capture (paper, section 6)."""

from .boards import Board, Charuco, Checkerboard, Sighting, find_board
from .calibrate import Calibration, calibrate
from .exposure import REFERENCE, Exposure, exposures_of
from .linearize import Linearized, LinearizeOptions, LinearView, linearize
from .raw import Colour
from .response_curve import Response, given_response, recover_response
from .views import photographs_in, views_of
from .white_balance import WhiteBalance, earlier_white_balance

__all__ = [
    "REFERENCE",
    "Board",
    "Calibration",
    "Charuco",
    "Checkerboard",
    "Colour",
    "Exposure",
    "LinearView",
    "LinearizeOptions",
    "Linearized",
    "Response",
    "Sighting",
    "WhiteBalance",
    "calibrate",
    "earlier_white_balance",
    "exposures_of",
    "find_board",
    "given_response",
    "linearize",
    "photographs_in",
    "recover_response",
    "views_of",
]

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How far a render is from its reference: NRMS, PSNR-H, PSNR-L, SSIM."""

from .compare import Evaluation, FrameEvaluation, compare
from .metrics import SquaredError, nrms, psnr_hdr, psnr_ldr, squared_error, srgb_encoded, ssim

__all__ = [
    "Evaluation",
    "FrameEvaluation",
    "SquaredError",
    "compare",
    "nrms",
    "psnr_hdr",
    "psnr_ldr",
    "squared_error",
    "srgb_encoded",
    "ssim",
]

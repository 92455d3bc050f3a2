# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Measures of one image, ``a`` the render and ``b`` the reference, both linear radiance [H, W, 3].

NRMS is the paper's (section 7): sqrt(sum (a-b)^2 / sum b^2) over the foreground, no factor removed.

PSNR-H, PSNR-L and SSIM follow Stanford-ORB's published evaluation, so that figures can be set beside
its tables: the mask is eroded by a 5 x 5 box, everything outside it is black in both images, a
least-squares factor a channel is taken out of the render, and the mean runs over the whole image.
(Its floor, the score of a plain grey image, is left out: a bad render shows as bad.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..arrays import F64, Bool, Float

HDR_CLIP = 4.0
"""Upper end of PSNR-H's range: four times display white, so that highlights count but do not rule."""


@dataclass(frozen=True)
class SquaredError:
    """The two sums behind an NRMS; add those of several frames to pool them."""

    difference: float
    reference: float
    pixels: int

    def __add__(self, other: SquaredError) -> SquaredError:
        return SquaredError(
            self.difference + other.difference, self.reference + other.reference, self.pixels + other.pixels
        )

    @property
    def nrms(self) -> float:
        """sqrt(sum (a-b)^2 / sum b^2); nan where the reference is black or nothing was compared."""
        if self.reference > 0:
            return float(np.sqrt(self.difference / self.reference))
        return float("nan")


def squared_error(a: Float, b: Float, mask: Bool) -> SquaredError:
    """Sums of (a-b)^2 and b^2 over the pixels of ``mask`` [H, W], in double precision."""
    a_in, b_in = np.asarray(a, np.float64)[mask], np.asarray(b, np.float64)[mask]
    return SquaredError(float(((a_in - b_in) ** 2).sum()), float((b_in**2).sum()), int(mask.sum()))


def nrms(a: Float, b: Float, mask: Bool) -> float:
    """Normalised root of the summed squares over ``mask`` (paper, section 7), as a fraction."""
    return squared_error(a, b, mask).nrms


def srgb_encoded(linear: Float) -> F64:
    """Linear values clipped to [0, 1] through the sRGB transfer curve (IEC 61966-2-1)."""
    x = np.clip(np.asarray(linear, np.float64), 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


def eroded(mask: Bool) -> Bool:
    """The mask less the pixels whose 5 x 5 box leaves it; the image border does not erode."""
    return np.asarray(ndimage.binary_erosion(mask, np.ones((5, 5), np.bool_), border_value=1), dtype=np.bool_)


def _aligned(a: Float, b: Float, inside: Bool) -> tuple[F64, F64]:
    """Both images black outside ``inside``, the render times its least-squares factor a channel."""
    a_in = np.where(inside[..., None], np.maximum(np.asarray(a, np.float64), 0), 0)
    b_in = np.where(inside[..., None], np.maximum(np.asarray(b, np.float64), 0), 0)
    aa, ab = (a_in**2).sum(axis=(0, 1)), (a_in * b_in).sum(axis=(0, 1))
    # A black channel has no factor; it stays black.
    return a_in * np.where(aa > 0, ab / np.where(aa > 0, aa, 1), 1), b_in


def _psnr(a: F64, b: F64) -> float:
    mse = float(((a - b) ** 2).mean())
    return float("inf") if mse == 0 else float(-10 * np.log10(mse))


def psnr_hdr(a: Float, b: Float, mask: Bool) -> float:
    """PSNR-H in dB (peak 1): linear images brightened by mean(sRGB(b)) / mean(b), clipped to [0, 4].

    nan where the eroded mask is empty, as of PSNR-L and SSIM: two black images would agree perfectly.
    """
    inside = eroded(mask)
    if not inside.any():
        return float("nan")
    a_in, b_in = _aligned(a, b, inside)
    mean = np.clip(b_in, 0, 1).mean()
    gain = srgb_encoded(b_in).mean() / mean if mean > 1e-8 else 1.0
    return _psnr(np.clip(gain * a_in, 0, HDR_CLIP), np.clip(gain * b_in, 0, HDR_CLIP))


def psnr_ldr(a: Float, b: Float, mask: Bool) -> float:
    """PSNR-L in dB: sRGB-encoded images in [0, 1]; nan where the eroded mask is empty."""
    inside = eroded(mask)
    if not inside.any():
        return float("nan")
    a_in, b_in = _aligned(a, b, inside)
    return _psnr(srgb_encoded(a_in), srgb_encoded(b_in))


def ssim(a: Float, b: Float, mask: Bool, window: int = 11) -> float:
    """Structural similarity (Wang et al. 2004) of the images PSNR-L compares, in [-1, 1].

    A Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, range 1, biased covariances, mean over the
    whole image and the channels; the border is mirrored. ``window`` is 11 in the original and 3 in
    Stanford-ORB. nan where the eroded mask is empty.
    """
    inside = eroded(mask)
    if not inside.any():
        return float("nan")
    a_in, b_in = _aligned(a, b, inside)
    x, y = srgb_encoded(a_in), srgb_encoded(b_in)
    tap = np.exp(-0.5 * ((np.arange(window) - window // 2) / 1.5) ** 2)
    tap /= tap.sum()

    def blurred(image: F64) -> F64:
        rows = ndimage.correlate1d(image, tap, axis=0, mode="mirror")
        return np.asarray(ndimage.correlate1d(rows, tap, axis=1, mode="mirror"), dtype=np.float64)

    mean_x, mean_y = blurred(x), blurred(y)
    var_x, var_y = blurred(x * x) - mean_x**2, blurred(y * y) - mean_y**2
    covariance = blurred(x * y) - mean_x * mean_y
    c1, c2 = 0.01**2, 0.03**2
    similarity = ((2 * mean_x * mean_y + c1) * (2 * covariance + c2)) / (
        (mean_x**2 + mean_y**2 + c1) * (var_x + var_y + c2)
    )
    return float(similarity.mean())

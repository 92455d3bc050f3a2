# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Error measures against plain twins, and the pairing of renders with references."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from swatchwork.capture import write_exr, write_png
from swatchwork.errors import InputError
from swatchwork.evaluate import compare, nrms, psnr_hdr, psnr_ldr, squared_error, srgb_encoded, ssim


def example(seed: int = 0, size: int = 24) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A reference with highlights above 1, a tinted and noisy render of it, a disc as mask."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size]
    mask = np.hypot(x - size / 2, y - size / 2) < 0.4 * size
    b = rng.gamma(0.7, 0.8, (size, size, 3)) * mask[..., None]
    a = b * [1.1, 0.8, 1.3] * rng.normal(1, 0.1, b.shape).clip(0.5)
    return a.astype(np.float32), b.astype(np.float32), mask


def aligned_twin(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Erode pixel by pixel, blacken the outside, fit one factor a channel by lstsq."""
    height, width = mask.shape
    inside = np.zeros_like(mask)
    for j in range(height):
        for i in range(width):
            inside[j, i] = mask[max(j - 2, 0) : j + 3, max(i - 2, 0) : i + 3].all()
    a, b = a.astype(float) * inside[..., None], b.astype(float) * inside[..., None]
    for c in range(3):
        a[..., c] *= np.linalg.lstsq(a[..., c].reshape(-1, 1), b[..., c].ravel(), rcond=None)[0][0]
    return a, b


def srgb_twin(x: np.ndarray) -> np.ndarray:
    def one(v: float) -> float:
        v = min(max(v, 0.0), 1.0)
        return 12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055

    return np.vectorize(one)(x)


def test_nrms_is_the_papers_and_keeps_a_wrong_exposure() -> None:
    a, b, mask = example()
    difference = reference = 0.0
    for j, i in zip(*np.nonzero(mask), strict=True):
        for c in range(3):
            difference += (float(a[j, i, c]) - float(b[j, i, c])) ** 2
            reference += float(b[j, i, c]) ** 2
    # Sums of about 1000 doubles: rounding only.
    assert nrms(a, b, mask) == pytest.approx(math.sqrt(difference / reference), rel=1e-12)
    assert nrms(1.5 * b, b, mask) == pytest.approx(0.5, rel=1e-6)  # f32 images


def test_nrms_pools_sums_not_quotients() -> None:
    a, b, mask = example(1)
    c, d, _ = example(2)
    pooled = squared_error(a, b, mask) + squared_error(10 * c, 10 * d, mask)
    both = nrms(np.concatenate([a, 10 * c]), np.concatenate([b, 10 * d]), np.concatenate([mask, mask]))
    assert pooled.nrms == pytest.approx(both, rel=1e-12)
    assert math.isnan(nrms(a, 0 * b, mask))


def test_psnr_h_and_psnr_l_equal_plain_twins() -> None:
    a, b, mask = example()
    x, y = aligned_twin(a, b, mask)
    gain = srgb_twin(y).mean() / y.clip(0, 1).mean()
    mse = ((gain * x).clip(0, 4) - (gain * y).clip(0, 4)).ravel()
    # lstsq and the closed form agree to rounding, 1e-9 dB leaves room for it.
    assert psnr_hdr(a, b, mask) == pytest.approx(-10 * math.log10(np.mean(mse**2)), abs=1e-9)
    mse = (srgb_twin(x) - srgb_twin(y)).ravel()
    assert psnr_ldr(a, b, mask) == pytest.approx(-10 * math.log10(np.mean(mse**2)), abs=1e-9)


def test_psnr_does_not_see_a_tint_nor_the_rim() -> None:
    _, b, mask = example()
    rim = b.copy()
    rim[mask & ~np.roll(mask, 2, axis=0)] += 1
    assert psnr_ldr(b * np.float32([2, 3, 0.5]), b, mask) > 100
    assert psnr_hdr(rim, b, mask) > 100
    assert nrms(rim, b, mask) > 0.1


@pytest.mark.parametrize("window", [3, 11])
def test_ssim_equals_a_slow_twin(window: int) -> None:
    a, b, mask = example(3, 20)
    x, y = (srgb_twin(image) for image in aligned_twin(a, b, mask))
    r = window // 2
    one = np.exp(-(np.arange(-r, r + 1) ** 2) / (2 * 1.5**2))
    w = np.outer(one, one) / one.sum() ** 2
    x, y = (np.pad(v, ((r, r), (r, r), (0, 0)), mode="reflect") for v in (x, y))
    total = []
    for j in range(20):
        for i in range(20):
            for c in range(3):
                p, q = x[j : j + window, i : i + window, c], y[j : j + window, i : i + window, c]
                mp, mq = (w * p).sum(), (w * q).sum()
                vp, vq = (w * (p - mp) ** 2).sum(), (w * (q - mq) ** 2).sum()
                cov = (w * (p - mp) * (q - mq)).sum()
                total.append(
                    (2 * mp * mq + 1e-4) * (2 * cov + 9e-4) / ((mp**2 + mq**2 + 1e-4) * (vp + vq + 9e-4))
                )
    # E[x^2] - E[x]^2 against E[(x - E[x])^2]: cancellation of a few ulps over 9e-4.
    assert ssim(a, b, mask, window) == pytest.approx(np.mean(total), abs=1e-11)


def test_a_perfect_render_is_perfect() -> None:
    _, b, mask = example()
    assert nrms(b, b, mask) == 0
    assert ssim(b, b, mask) == pytest.approx(1, abs=1e-12)
    assert srgb_encoded(np.float32([0, 1, 7])).tolist() == pytest.approx([0, 1, 1], abs=1e-12)


def write_pair(folder: Path) -> tuple[Path, Path]:
    renders, references = folder / "renders", folder / "references"
    renders.mkdir()
    references.mkdir()
    for seed, name in enumerate(("0001.exr", "0002.exr")):
        a, b, mask = example(seed)
        alpha = mask.astype(np.float32)[..., None]
        write_exr(references / name, np.concatenate([b, alpha], axis=-1))
        write_exr(renders / name, np.concatenate([a, alpha], axis=-1))
    return renders, references


def test_folders_are_compared_frame_by_frame_and_pooled(tmp_path: Path) -> None:
    found = compare(*write_pair(tmp_path))
    a, b, mask = example(1)
    assert [frame.name for frame in found.frames] == ["0001.exr", "0002.exr"]
    assert found.frames[1].nrms == pytest.approx(nrms(a, b, mask), rel=1e-12)
    assert found.pixels == 2 * int(mask.sum())
    assert found.psnr_h == pytest.approx(np.mean([frame.psnr_h for frame in found.frames]))
    assert found.nrms_rim is None
    assert found.as_dict()["frames"][0]["ssim"] == found.frames[0].ssim


def test_previews_beside_the_images_are_passed_over(tmp_path: Path) -> None:
    renders, references = write_pair(tmp_path)
    for folder in (renders, references):
        write_png(folder / "0001.png", np.zeros((24, 24, 3), np.uint8))
    assert compare(renders, references).frames[0].name == "0001.exr"


def test_a_perfect_set_is_valid_json(tmp_path: Path) -> None:
    _, references = write_pair(tmp_path)
    assert compare(references, references).as_dict()["psnr_h"] is None


def test_a_missing_render_is_an_error(tmp_path: Path) -> None:
    renders, references = write_pair(tmp_path)
    (renders / "0002.exr").unlink()
    with pytest.raises(InputError, match=r"no render of the reference 0002\.exr"):
        compare(renders, references)


def test_another_size_is_an_error(tmp_path: Path) -> None:
    renders, references = write_pair(tmp_path)
    write_exr(renders / "0002.exr", np.ones((24, 20, 3), np.float32))
    with pytest.raises(InputError, match="20 x 24 pixels; expected 24 x 24"):
        compare(renders, references)


def test_a_reference_without_foreground_is_an_error(tmp_path: Path) -> None:
    renders, references = write_pair(tmp_path)
    write_exr(references / "0002.exr", np.zeros((24, 24, 4), np.float32))
    with pytest.raises(InputError, match=r"0002\.exr has no pixel to compare"):
        compare(renders, references)


def test_a_foreground_that_erodes_away_has_no_score(tmp_path: Path) -> None:
    renders, references = write_pair(tmp_path)
    thin = np.zeros((24, 24, 4), np.float32)
    thin[10:13, 10:13] = 1
    write_exr(references / "0002.exr", thin)
    found = compare(renders, references)
    assert found.frames[1].pixels == 9 and math.isfinite(found.frames[1].nrms)
    for key in ("psnr_h", "psnr_l", "ssim", "ssim_11"):
        assert math.isnan(getattr(found.frames[1], key))
        assert getattr(found, key) == getattr(found.frames[0], key)
        assert found.as_dict()["frames"][1][key] is None


def test_folders_without_images_are_errors(tmp_path: Path) -> None:
    renders, references = write_pair(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        compare(tmp_path / "nowhere", references)
    with pytest.raises(InputError, match="no such folder or file"):
        compare(renders, tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no image"):
        compare(renders, tmp_path / "empty")


def test_a_capture_as_reference_tells_rim_from_inner(shared: Path) -> None:
    test = shared / "captures/sphere-merl/test"
    left = np.zeros((256, 256))
    left[:, :128] = 1
    found = compare(test / "images", test, cosines=lambda frame: left)
    assert found.nrms == 0
    assert found.nrms_inner == 0
    assert found.nrms_rim == 0
    with pytest.raises(InputError, match="has no cameras"):
        compare(test / "images", test / "images", cosines=lambda frame: left)

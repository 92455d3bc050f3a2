# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Images in each format, as light; and damaged ones."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest

from swatchwork.capture import (
    exr_in_bands,
    linear_from_srgb,
    read_exr_channels,
    read_image,
    read_mask,
    write_exr,
    write_exr_channels,
    write_png,
)
from swatchwork.capture.images import image_size
from swatchwork.errors import InputError, OutputError

RNG = np.random.default_rng(1)
PIXELS = RNG.uniform(0, 9, (6, 8, 3)).astype(np.float32)


def srgb_twin(x: float) -> float:
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4


def test_exr_keeps_floats_and_halves(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", PIXELS)
    image = read_image(tmp_path / "a.exr")
    np.testing.assert_array_equal(image.linear, PIXELS)
    assert image.alpha is None and not image.clipped.any()
    write_exr(tmp_path / "h.exr", PIXELS, half=True)
    np.testing.assert_array_equal(read_image(tmp_path / "h.exr").linear, PIXELS.astype(np.float16))
    assert read_exr_channels(tmp_path / "h.exr")["R"].dtype == np.float16
    assert image_size(tmp_path / "h.exr") == (8, 6)


def test_exr_alpha_is_premultiplied_already(tmp_path: Path) -> None:
    rgba = np.concatenate([PIXELS, np.full((6, 8, 1), 0.25, np.float32)], axis=-1)
    write_exr(tmp_path / "a.exr", rgba)
    image = read_image(tmp_path / "a.exr")
    np.testing.assert_array_equal(image.linear, PIXELS)
    assert image.alpha is not None
    np.testing.assert_array_equal(image.alpha, rgba[..., 3])


@pytest.mark.parametrize("rows", [50, 20])
def test_exr_channels_of_each_type_round_trip(tmp_path: Path, rows: int) -> None:
    """Written whole, or in bands of which the last is short."""
    channels = {
        "index.0": RNG.integers(0, 2**32, (50, 7), dtype=np.uint32),
        "weight.0": RNG.random((50, 7), dtype=np.float32),
        "half": RNG.random((50, 7)).astype(np.float16),
    }
    if rows == 50:
        write_exr_channels(tmp_path / "c.exr", channels)
    else:
        types = {name: values.dtype for name, values in channels.items()}
        with exr_in_bands(tmp_path / "c.exr", 7, 50, types) as write:
            for start in range(0, 50, rows):
                write({name: values[start : start + rows] for name, values in channels.items()})
    read = read_exr_channels(tmp_path / "c.exr")
    assert read.keys() == channels.keys()
    for name, values in channels.items():
        assert read[name].dtype == values.dtype
        np.testing.assert_array_equal(read[name], values)


def test_exr_that_ends_too_soon(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match=r"c\.exr: cannot be written .*before its last row"),
        exr_in_bands(tmp_path / "c.exr", 7, 50, {"Y": np.float32}) as write,
    ):
        write({"Y": np.zeros((20, 7))})


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_exr_on_a_full_disk(tmp_path: Path) -> None:
    (tmp_path / "f.exr").symlink_to("/dev/full")
    # What is short is not written before the file is closed.
    for pixels in (RNG.random((512, 512), dtype=np.float32), np.zeros((5, 7), np.float32)):
        with pytest.raises(OutputError, match=r"f\.exr: cannot be written"):
            write_exr_channels(tmp_path / "f.exr", {"Y": pixels})


def test_exr_of_luminance_or_of_one_named_layer(tmp_path: Path) -> None:
    write_exr_channels(tmp_path / "y.exr", {"Y": PIXELS[..., 0]})
    np.testing.assert_array_equal(read_image(tmp_path / "y.exr").linear, PIXELS[..., [0, 0, 0]])
    layer = {f"ViewLayer.Combined.{c}": PIXELS[..., i] for i, c in enumerate("RGB")}
    write_exr_channels(tmp_path / "b.exr", layer | {"ViewLayer.Depth.Z": PIXELS[..., 0]})
    np.testing.assert_array_equal(read_image(tmp_path / "b.exr").linear, PIXELS)


def test_exr_cropped_to_a_data_window_is_filled_up(tmp_path: Path) -> None:
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "dataWindow": (np.array([2, 1], np.int32), np.array([4, 2], np.int32)),
        "displayWindow": (np.array([0, 0], np.int32), np.array([3, 4], np.int32)),
    }
    small = {c: np.ascontiguousarray(PIXELS[:2, :3, i]) for i, c in enumerate("RGB")}
    with OpenEXR.File(header, small) as file:
        file.write(str(tmp_path / "w.exr"))
    linear = read_image(tmp_path / "w.exr").linear
    assert linear.shape == (5, 4, 3) and image_size(tmp_path / "w.exr") == (4, 5)
    np.testing.assert_array_equal(linear[1:3, 2:4], PIXELS[:2, :2])
    assert np.count_nonzero(linear) == 12


def test_hdr_is_linear_and_in_order_red_green_blue(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.hdr"), PIXELS[..., ::-1])
    image = read_image(tmp_path / "a.hdr")
    # A shared exponent leaves 8 bits to the largest channel of a pixel: 1/128 of it at worst.
    assert np.all(np.abs(image.linear - PIXELS) <= PIXELS.max(axis=-1, keepdims=True) / 128)
    assert image_size(tmp_path / "a.hdr") == (8, 6)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_png_decodes_srgb_and_marks_clipped_pixels(tmp_path: Path, dtype: type) -> None:
    top = np.iinfo(dtype).max
    coded = np.array([[[0, top // 50, top // 3], [top, 7, 9], [top - 1, 1, 2]]], dtype=dtype)
    cv2.imwrite(str(tmp_path / "a.png"), coded[..., ::-1])
    image = read_image(tmp_path / "a.png")
    expected = [[[srgb_twin(float(c) / top) for c in pixel] for pixel in row] for row in coded]
    np.testing.assert_allclose(image.linear, expected, rtol=1e-5, atol=1e-7)  # float32 powers
    np.testing.assert_array_equal(image.clipped, [[False, True, False]])
    assert image.alpha is None


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_png_alpha_is_straight_and_comes_out_premultiplied(tmp_path: Path, dtype: type) -> None:
    top = np.iinfo(dtype).max
    rgba = np.array([[[top, top, top, 0], [100, 50, 20, top // 5], [top, 0, 0, top // 5]]], dtype=dtype)
    cv2.imwrite(str(tmp_path / "a.png"), rgba[..., [2, 1, 0, 3]])
    image = read_image(tmp_path / "a.png")
    assert image.alpha is not None
    np.testing.assert_allclose(image.alpha, [[0, 0.2, 0.2]], rtol=1e-6)
    np.testing.assert_allclose(image.linear[0, 1, 0], 0.2 * srgb_twin(100 / top), rtol=1e-5)
    # White under no coverage is background, not a clipped highlight.
    np.testing.assert_array_equal(image.clipped, [[False, False, True]])


def test_gray_images_count_for_all_channels(tmp_path: Path) -> None:
    gray = np.array([[0, 128, 255]], np.uint8)
    for name in ("g.png", "g.jpg"):
        cv2.imwrite(str(tmp_path / name), gray)
        linear = read_image(tmp_path / name).linear
        assert linear.shape == (1, 3, 3)
        np.testing.assert_array_equal(linear[..., 0], linear[..., 2])


def test_jpeg_is_srgb(tmp_path: Path) -> None:
    coded = np.full((16, 16, 3), (200, 100, 50), np.uint8)
    cv2.imwrite(str(tmp_path / "a.jpg"), coded[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 100])
    linear = read_image(tmp_path / "a.jpg").linear[8, 8]
    expected = linear_from_srgb(np.array([200, 100, 50]) / 255)
    np.testing.assert_allclose(linear, expected, atol=0.015)  # the codec's rounding, two levels of 255


def test_png_writer_round_trips(tmp_path: Path) -> None:
    coded = RNG.integers(0, 255, (4, 5, 3), dtype=np.uint8)
    write_png(tmp_path / "a.png", coded)
    np.testing.assert_allclose(
        read_image(tmp_path / "a.png").linear, linear_from_srgb(coded / 255), rtol=1e-6
    )


def test_masks_are_inside_above_half(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "m.png"), np.array([[0, 127, 128, 255]], np.uint8))
    np.testing.assert_array_equal(read_mask(tmp_path / "m.png"), [[False, False, True, True]])
    write_exr_channels(tmp_path / "m.exr", {"Y": np.array([[0, 0.5, 0.51, 1]], np.float32)})
    np.testing.assert_array_equal(read_mask(tmp_path / "m.exr"), [[False, False, True, True]])


@pytest.mark.parametrize("name", ["a.exr", "a.hdr", "a.png", "a.jpg"])
@pytest.mark.parametrize("kept", [0.0, 0.02, 0.5, 0.97])
def test_truncated_files_are_refused(tmp_path: Path, name: str, kept: float) -> None:
    path = tmp_path / name
    big = RNG.random((64, 64, 3)).astype(np.float32)
    if name.endswith("exr"):
        write_exr(path, big)
    else:
        cv2.imwrite(str(path), big if name.endswith("hdr") else (big * 255).astype(np.uint8))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(kept * len(whole))])
    with pytest.raises(InputError, match=f"{name}: cannot be read.*expected a complete"):
        read_image(path)


def test_missing_and_unknown_files_are_refused(tmp_path: Path) -> None:
    for name in ("a.exr", "a.hdr", "a.png"):
        with pytest.raises(InputError, match=f"{name}: no such file"):
            read_image(tmp_path / name)
    (tmp_path / "a.tif").write_bytes(b"II")
    with pytest.raises(InputError, match=r"unknown image type '\.tif'; expected one of \.exr"):
        read_image(tmp_path / "a.tif")
    (tmp_path / "b.png").write_bytes(b"not an image at all")
    with pytest.raises(InputError, match=r"b\.png: cannot be read"):
        read_image(tmp_path / "b.png")


def test_alpha_that_is_no_coverage_is_refused(tmp_path: Path) -> None:
    rgba = np.concatenate([PIXELS, np.full((6, 8, 1), 3.0, np.float32)], axis=-1)
    write_exr(tmp_path / "a.exr", rgba)
    with pytest.raises(InputError, match=r"48 values outside \[0, 1\], such as 3"):
        read_image(tmp_path / "a.exr")


def test_exr_without_colour_is_refused(tmp_path: Path) -> None:
    write_exr_channels(tmp_path / "z.exr", {"Z": PIXELS[..., 0]})
    with pytest.raises(InputError, match="channels Z; expected R, G, B"):
        read_image(tmp_path / "z.exr")


def test_a_folder_that_does_not_exist_cannot_be_written_to(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        write_exr(tmp_path / "no" / "a.exr", PIXELS)
    with pytest.raises(OutputError, match="cannot be written"):
        write_png(tmp_path / "no" / "a.png", np.zeros((2, 2, 3), np.uint8))

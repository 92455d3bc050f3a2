# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Images made to do harm: what their headers declare, and what they hold."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import Imath
import numpy as np
import OpenEXR
import pytest
from PIL import Image

from swatchwork.capture import EnvironmentSource, read_exr_channels, read_image, write_exr, write_exr_channels
from swatchwork.capture.images import image_size
from swatchwork.capture.photograph import read_mask
from swatchwork.errors import InputError
from swatchwork.light import read_environment


def exr_window(file: Path, name: str, corner: tuple[int, int]) -> None:
    content = bytearray(file.read_bytes())
    at = content.index(name.encode() + b"\0box2i\0") + len(name) + 11
    struct.pack_into("<ii", content, at + 8, *corner)
    file.write_bytes(content)


def png(file: Path, width: int, height: int, pixels: bytes) -> None:
    content = b"\x89PNG\r\n\x1a\n"
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    for kind, data in ((b"IHDR", head), (b"IDAT", zlib.compress(pixels, 9)), (b"IEND", b"")):
        content += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    file.write_bytes(content)


def test_exr_windows_are_held_against_the_file(tmp_path: Path) -> None:
    for name in ("dataWindow", "displayWindow"):
        for corner, part in (
            ((2**31 - 1, 2**31 - 1), "a.exr"),
            ((40_000, 40_000), "declares 40001 x 40001"),
            *([((9_000, 9_000), "bytes")] if name == "dataWindow" else []),
        ):
            write_exr(tmp_path / "a.exr", np.ones((4, 6, 3), np.float32))
            exr_window(tmp_path / "a.exr", name, corner)
            with pytest.raises(InputError, match=part):
                read_image(tmp_path / "a.exr")


def cropped_exr(file: Path, width: int, height: int, side: int) -> None:
    """White of side x side pixels in the corner, cropped to that; nothing around it is stored."""
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    with OpenEXR.File(header, {"Y": np.ones((side, side), np.float16)}) as made:
        made.write(str(file))
    exr_window(file, "displayWindow", (width - 1, height - 1))


def test_cropped_exrs_are_read(tmp_path: Path) -> None:
    """A mask of 24 million pixels that is cropped to its object takes 15 KB."""
    cropped_exr(tmp_path / "mask.exr", 6000, 4000, 1500)
    assert (tmp_path / "mask.exr").stat().st_size * 1040 < 6000 * 4000
    assert image_size(tmp_path / "mask.exr") == (6000, 4000)
    mask = read_mask(tmp_path / "mask.exr")
    assert mask.shape == (4000, 6000) and mask.sum() == 1500 * 1500


def test_windows_of_the_cosine_transform_are_bounded_too(tmp_path: Path) -> None:
    header = OpenEXR.Header(64, 64)
    header["compression"] = Imath.Compression(Imath.Compression.DWAB_COMPRESSION)
    header["channels"] = {"Y": Imath.Channel(Imath.PixelType(Imath.PixelType.HALF))}
    file = OpenEXR.OutputFile(str(tmp_path / "a.exr"), header)
    file.writePixels({"Y": np.zeros((64, 64), np.float16).tobytes()}, 64)
    file.close()
    assert not read_image(tmp_path / "a.exr").linear.any()
    for name in ("dataWindow", "displayWindow"):
        exr_window(tmp_path / "a.exr", name, (12_999, 12_999))
    with pytest.raises(InputError, match="declares 13000 x 13000 pixels in"):
        image_size(tmp_path / "a.exr")


def test_probes_of_another_shape_are_not_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_exr(tmp_path / "env.exr", np.ones((8, 8, 3), np.float32))
    monkeypatch.setattr("swatchwork.light.environment.read_image", lambda _: pytest.fail("it was decoded"))
    with pytest.raises(InputError, match="the environment is 8 x 8"):
        read_environment(EnvironmentSource(tmp_path / "env.exr", "blender"))


def test_uniform_exrs_are_no_bombs(tmp_path: Path) -> None:
    """Nothing but zeros packs as well as it gets; the limit leaves that alone."""
    for half in (False, True):
        write_exr(tmp_path / "a.exr", np.zeros((512, 1024, 4), np.float32), half=half)
        assert not read_image(tmp_path / "a.exr").linear.any()
    write_exr_channels(tmp_path / "y.exr", {"Y": np.zeros((1024, 1024), np.float16)})
    assert not read_image(tmp_path / "y.exr").linear.any()


def test_uniform_pictures_are_no_bombs(tmp_path: Path) -> None:
    for name, pixels in {
        "bits.png": Image.new("1", (1024, 1024)),
        "gray.png": Image.new("L", (1024, 1024)),
        "deep.png": Image.new("I;16", (1024, 1024)),
        "colour.jpg": Image.new("RGB", (1024, 1024)),
        "gray.jpg": Image.new("L", (1024, 1024)),
    }.items():
        pixels.save(tmp_path / name)
        assert not read_image(tmp_path / name).linear.any()
    assert cv2.imwrite(str(tmp_path / "zero.hdr"), np.zeros((1024, 1024, 3), np.float32))
    assert not read_image(tmp_path / "zero.hdr").linear.any()


def test_png_sizes_are_held_against_the_file(tmp_path: Path) -> None:
    for width, height in ((2**31 - 1, 2**31 - 1), (13_000, 13_000), (30_000, 30_000)):
        png(tmp_path / "a.png", width, height, bytes(1000))
        with pytest.raises(InputError, match=r"a\.png: (declares|cannot be read)"):
            image_size(tmp_path / "a.png")
    # A bomb proper: all that it declares is there. It is refused by its size before it is unpacked.
    png(tmp_path / "bomb.png", 14_000, 14_000, bytes(14_001 * 14_000))
    with pytest.raises(InputError, match=r"196000000 pixels|declares 14000 x 14000"):
        read_image(tmp_path / "bomb.png")


def test_hdr_sizes_are_held_against_the_file(tmp_path: Path) -> None:
    file = tmp_path / "a.hdr"
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"
    for size in (
        b"-Y 99999999 +X 99999999",
        b"-Y 9000 +X 9000",
        b"-Y 0 +X 5",
        b"-Y -5 +X 5",
        b"+X 5 -Y 5",
        b"",
    ):
        file.write_bytes(head + size + b"\n" + bytes(400))
        with pytest.raises(InputError, match=r"a\.hdr"):
            read_image(file)


def test_files_are_what_their_names_say(tmp_path: Path) -> None:
    """Pillow and OpenCV know dozens of formats; a stranger's file is not tried with each."""
    Image.new("RGB", (4, 4)).save(tmp_path / "a.bmp")
    Image.new("RGB", (4, 4)).save(tmp_path / "b.png")
    for source, name in (("a.bmp", "x.png"), ("a.bmp", "x.jpg"), ("b.png", "x.hdr"), ("b.png", "x.jpg")):
        (tmp_path / name).write_bytes((tmp_path / source).read_bytes())
        with pytest.raises(InputError, match=name):
            read_image(tmp_path / name)


def test_channels_are_counted_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_exr_channels(tmp_path / "a.exr", {f"c{i}": np.ones((4, 6), np.float32) for i in range(9)})
    monkeypatch.setattr("swatchwork.capture.exr.MOST_SAMPLES", 9 * 24 - 1)
    with pytest.raises(InputError, match="declares 216 numbers"):
        read_exr_channels(tmp_path / "a.exr")

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mutations of photographs, masks and light probes: EXR, .hdr, PNG, JPEG."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from random import Random

import numpy as np
from mutating import flipped, mutation, some_file

from swatchwork.capture import read_exr_channels, write_exr_channels

SUFFIXES = (".exr", ".hdr", ".png", ".jpg")
HUGE = (0, 1 << 15, 1 << 20, (1 << 31) - 1)


@mutation("images", "truncated")
def image_truncated(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, *SUFFIXES)
    assert file is not None
    content = file.read_bytes()
    # The last bytes of a JPEG say no more than that it ends.
    cut = rng.randrange(int(0.95 * len(content)))
    file.write_bytes(content[:cut])
    return f"{file.name}: the first {cut} of {len(content)} bytes"


@mutation("images", None)
def image_bits_flipped(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, *SUFFIXES)
    assert file is not None
    content = file.read_bytes()
    start = rng.choice((0, 0, len(content) // 2))
    file.write_bytes(flipped(content, rng, start))
    return f"{file.name}: bits from {start} on"


@mutation("images", None)
def image_part_zeroed(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, *SUFFIXES)
    assert file is not None
    content = bytearray(file.read_bytes())
    at = rng.randrange(len(content))
    content[at : at + 64] = rng.choice((b"\0", b"\xff")) * len(content[at : at + 64])
    file.write_bytes(content)
    return f"{file.name}: 64 bytes at {at}"


@mutation("images", "wrong size")
def exr_window_huge(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".exr")
    if file is None:
        return None
    content = bytearray(file.read_bytes())
    names = rng.choice((("dataWindow",), ("displayWindow",), ("dataWindow", "displayWindow")))
    corner = [rng.choice(HUGE), rng.choice(HUGE)]
    if corner == [0, 0]:
        corner = [1 << 30, 1 << 14]
    for name in names:
        # Name, type, length of the attribute, then the four numbers.
        at = content.index(name.encode() + b"\0box2i\0") + len(name) + 7 + 4
        struct.pack_into("<ii", content, at + 8, *corner)
    file.write_bytes(content)
    return f"{file.name}: {', '.join(names)} to {corner}"


@mutation("images", "wrong size")
def exr_window_inverted(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".exr")
    if file is None:
        return None
    content = bytearray(file.read_bytes())
    for name in ("dataWindow", "displayWindow"):
        at = content.index(name.encode() + b"\0box2i\0") + len(name) + 7 + 4
        struct.pack_into(
            "<iiii", content, at, *rng.choice(((5, 5, 1, 1), (0, 0, -1, -1), (-(2**31), 0, 2**31 - 1, 0)))
        )
    file.write_bytes(content)
    return f"{file.name}: windows inside out"


@mutation("images", "wrong size")
def hdr_size_huge(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".hdr")
    if file is None:
        return None
    head, mark, rest = file.read_bytes().partition(b"\n-Y ")
    _, _, pixels = rest.partition(b"\n")
    size = rng.choice(
        (b"99999999 +X 99999999", b"0 +X 0", b"-1 +X 5", b"2147483648 +X 2", b"30000 +X 30000", b"x +X y")
    )
    file.write_bytes(head + mark + size + b"\n" + pixels)
    return f"{file.name}: -Y {size.decode()}"


@mutation("images", "wrong size")
def png_size_huge(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".png")
    if file is None:
        return None
    content = bytearray(file.read_bytes())
    width, height = (
        rng.choice(((1 << 31) - 1, 30_000, 13_000, 0)),
        rng.choice(((1 << 31) - 1, 30_000, 13_000)),
    )
    struct.pack_into(">II", content, 16, width, height)
    # With its sum right, so that nothing but the size is wrong.
    struct.pack_into(">I", content, 29, zlib.crc32(content[12:29]))
    file.write_bytes(content)
    return f"{file.name}: {width} x {height}"


@mutation("images", "wrong size")
def png_bomb(folder: Path, rng: Random) -> str | None:
    """Zeros, well packed: more than any image may have, or than the intrinsics say."""
    file = some_file(folder, rng, ".png")
    if file is None:
        return None
    told = "masks" in file.parts or '"w":' in (folder / "transforms.json").read_text(encoding="utf-8")
    side = rng.choice((12_000, 25_000)) if told else 25_000
    packed = zlib.compress(bytes((1 + side // 8) * side), 9)
    parts = [(b"IHDR", struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)), (b"IDAT", packed), (b"IEND", b"")]
    content = b"\x89PNG\r\n\x1a\n"
    for kind, data in parts:
        content += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    file.write_bytes(content)
    return f"{file.name}: {side} x {side} in {len(content)} bytes"


@mutation("images", "wrong size")
def jpeg_size_huge(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".jpg")
    if file is None:
        return None
    content = bytearray(file.read_bytes())
    at = content.index(b"\xff\xc0")
    struct.pack_into(
        ">HH", content, at + 5, *rng.choice(((65535, 65535), (0, 24), (12_000, 12_000), (25, 24)))
    )
    file.write_bytes(content)
    return f"{file.name}: another size"


@mutation("images", "wrong size")
def exr_of_another_size(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".exr")
    if file is None:
        return None
    height, width = rng.choice(((1, 3), (23, 24), (24, 25), (7, 500)))
    zeros = np.ones((height, width), dtype=np.float32)
    write_exr_channels(file, dict.fromkeys("RGB", zeros))
    return f"{file.name}: {width} x {height}"


@mutation("images", "wrong type")
def exr_of_other_channels(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".exr")
    if file is None or "masks" in file.parts:
        return None
    names = rng.choice((["Z"], ["R"], ["R", "G"], ["a.R", "a.G", "a.B", "b.R", "b.G", "b.B"], ["<b>"]))
    first = next(iter(read_exr_channels(file).values()))
    write_exr_channels(file, {name: first.astype(np.float32) for name in names})
    return f"{file.name}: channels {names}"


@mutation("images", "non-finite")
def exr_not_finite(folder: Path, rng: Random) -> str | None:
    return _with_value(folder, rng, rng.choice((np.nan, np.inf, -np.inf)))


@mutation("images", "out of range")
def exr_out_of_range(folder: Path, rng: Random) -> str | None:
    return _with_value(folder, rng, rng.choice((-1.0, -1e30, 3e38, 1e20)))


def _with_value(folder: Path, rng: Random, value: float) -> str | None:
    """In a photograph or a probe, where it counts: near its middle."""
    file = some_file(folder, rng, ".exr")
    if file is None or "masks" in file.parts:
        return None
    channels = {name: pixels.copy() for name, pixels in read_exr_channels(file).items()}
    pixels = channels[rng.choice("RGB")]
    pixels[pixels.shape[0] // 2, pixels.shape[1] // 2] = value
    write_exr_channels(file, channels)
    return f"{file.name}: {value}"


@mutation("images", "out of range")
def exr_alpha_out_of_range(folder: Path, rng: Random) -> str | None:
    file = some_file(folder, rng, ".exr")
    if file is None or "images" not in file.parts:
        return None
    channels = {name: pixels.copy() for name, pixels in read_exr_channels(file).items()}
    if "A" not in channels:
        return None
    channels["A"][0, 0] = value = rng.choice((-1.0, 2.0, np.nan, np.inf))
    write_exr_channels(file, channels)
    return f"{file.name}: alpha {value}"


@mutation("images", "out of range")
def light_all_black(folder: Path, rng: Random) -> str | None:
    file = folder / "env.exr"
    if not file.is_file():
        return None
    channels = {name: 0 * pixels for name, pixels in read_exr_channels(file).items()}
    write_exr_channels(file, channels)
    return "env.exr is black"

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""DNG files of known mosaics, written byte by byte: no camera's RAW file is at hand."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from swatchwork.prepare import REFERENCE, Exposure

BLACK, WHITE = 512, 15000
CAM_FROM_XYZ = np.array([[0.9, -0.2, -0.1], [-0.4, 1.2, 0.2], [-0.1, 0.2, 0.7]])
"""Of a camera much like others."""
RGGB = ("RG", "GB")
X_TRANS = ("GGRGGB", "GGBGGR", "BRGRBG", "GGBGGR", "GGRGGB", "RBGBRG")
SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 10: 8}


def write_dng(
    file: Path,
    mosaic: np.ndarray,
    exposure: Exposure = REFERENCE,
    *,
    black: int = BLACK,
    matrix: np.ndarray = CAM_FROM_XYZ,
    neutral: tuple[float, float, float] = (0.5, 1.0, 0.625),
    pattern: tuple[str, ...] = RGGB,
) -> None:
    """A little-endian, uncompressed DNG 1.4 of a mosaic uint16 [H, W], and its EXIF."""

    def short(*v: int) -> bytes:
        return struct.pack(f"<{len(v)}H", *v)

    def long(*v: int) -> bytes:
        return struct.pack(f"<{len(v)}I", *v)

    def rational(*v: float, sign: str = "I") -> bytes:
        return b"".join(struct.pack(f"<{sign}{sign}", round(x * 100000), 100000) for x in v)

    height, width = mosaic.shape
    entries = {
        254: (4, long(0)),
        256: (4, long(width)),
        257: (4, long(height)),
        258: (3, short(16)),
        259: (3, short(1)),
        262: (3, short(32803)),
        271: (2, b"Swatchwork\0"),
        272: (2, b"Synthetic\0"),
        273: (4, long(0)),
        274: (3, short(1)),
        277: (3, short(1)),
        278: (4, long(height)),
        279: (4, long(2 * mosaic.size)),
        284: (3, short(1)),
        33421: (3, short(len(pattern), len(pattern[0]))),
        33422: (1, bytes("RGB".index(colour) for row in pattern for colour in row)),
        34665: (4, long(0)),
        50706: (1, bytes([1, 4, 0, 0])),
        50708: (2, b"Swatchwork Synthetic\0"),
        50713: (3, short(1, 1)),
        50714: (3, short(black)),
        50717: (3, short(WHITE)),
        50721: (10, rational(*matrix.ravel(), sign="i")),
        50728: (5, rational(*neutral)),
        50778: (3, short(21)),
    }
    exif = {
        33434: (5, rational(exposure.time_s)),
        33437: (5, rational(exposure.aperture)),
        34855: (3, short(round(exposure.iso))),
    }

    def directory(of: Mapping[int, tuple[int, bytes]], start: int) -> bytes:
        rows, beyond = b"", b""
        after = start + 2 + 12 * len(of) + 4
        for tag, (kind, data) in sorted(of.items()):
            rows += struct.pack("<HHI", tag, kind, len(data) // SIZES[kind])
            if len(data) <= 4:
                rows += data.ljust(4, b"\0")
            else:
                rows += long(after + len(beyond))
                beyond += data + b"\0" * (len(data) % 2)
        return short(len(of)) + rows + long(0) + beyond

    second = 8 + len(directory(entries, 8))
    pixels = second + len(directory(exif, second))
    entries |= {34665: (4, long(second)), 273: (4, long(pixels))}
    header = b"II*\0" + long(8)
    data = mosaic.astype("<u2").tobytes()
    file.write_bytes(header + directory(entries, 8) + directory(exif, second) + data)


def mosaic_of(colour: np.ndarray, black: int = BLACK, pattern: tuple[str, ...] = RGGB) -> np.ndarray:
    """uint16 [H, W]: shares of full scale [H, W, 3] through a filter, cut at the white level."""
    plane = np.empty(colour.shape[:2])
    for i, row in enumerate(pattern):
        for j, name in enumerate(row):
            at = np.s_[i :: len(pattern), j :: len(row)]
            plane[at] = colour[..., "RGB".index(name)][at]
    return np.minimum(np.round(black + plane * (WHITE - black)), WHITE).astype(np.uint16)


def patches(*colours: tuple[float, float, float], side: int = 48) -> np.ndarray:
    """Flat squares side by side, [side, side * count, 3]."""
    return np.concatenate(
        [np.broadcast_to(np.array(c, dtype=float), (side, side, 3)) for c in colours], axis=1
    )

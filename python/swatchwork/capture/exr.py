# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""EXR files, channel by channel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from typing import Any

import Imath
import numpy as np
import numpy.typing as npt
import OpenEXR

from swatchwork.arrays import Float
from swatchwork.capture.guarding import MOST_IMAGE_BYTES, MOST_PIXELS, check_size, need_file
from swatchwork.errors import InputError, OutputError, is_out_of_memory

_PIXEL_TYPES = {
    "float16": Imath.PixelType.HALF,
    "float32": Imath.PixelType.FLOAT,
    "uint32": Imath.PixelType.UINT,
}

SAMPLES_A_BYTE = 1040
"""At most, by the methods of `BOUNDED`: deflate packs 1032 bytes in one, others fewer."""
SAMPLES_A_BYTE_ELSE = 40_000
"""At most, by the cosines of DWA and what came later; HTJ2K packs 31,000 zeros in a byte, DWAB 9,000. So
a file of 20 KB may hold the 179 million pixels of the limit, which take some 39 bytes each to read: 7 GB."""
BOUNDED = ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A")
MOST_CHANNELS = 1024
MOST_SAMPLES = 4 * MOST_PIXELS
"""In all channels, of all parts: the largest RGBA image, or 80 channels of a 4K frame."""

Channels = dict[str, npt.NDArray[Any]]


def read_exr_channels(path: Path) -> Channels:
    """All channels of an EXR file's first part by name, [H, W] each, as half, float or uint32.

    A file cropped to a data window is filled up with zeros to its display window.

    Raises:
        InputError: the file is missing, truncated or not an EXR, or has subsampled channels.
    """
    exr_size(path)
    with _opened(path, header_only=False) as file:
        data, display = (np.array(file.header()[name]) for name in ("dataWindow", "displayWindow"))
        channels: Channels = {}
        for name, channel in file.channels().items():
            if (channel.xSampling, channel.ySampling) != (1, 1):
                raise InputError(
                    f"channel {name} is subsampled {channel.xSampling}x{channel.ySampling}",
                    file=path,
                    expected="full-resolution channels",
                    hint="Save it as plain RGB or RGBA",
                )
            channels[name] = np.array(channel.pixels)
    if np.array_equal(data, display):
        return channels
    return {name: _in_display_window(pixels, data, display) for name, pixels in channels.items()}


def exr_size(path: Path) -> tuple[int, int]:
    """(width, height) of an EXR file's display window, from its header alone, within limits.

    Raises:
        InputError: the file is missing or not an EXR, or declares more than we read or it can hold.
    """
    with _opened(path, header_only=True) as file:
        # The library reads all parts, though we look at the first.
        parts = [_declared(path, part.header) for part in file.parts]
    samples = sum(count for *_, count in parts)
    if samples > MOST_SAMPLES:
        raise InputError(
            f"declares {samples} numbers in all its channels", file=path, expected=f"{MOST_SAMPLES} at most"
        )
    width, height, _ = parts[0]
    return width, height


def _declared(path: Path, header: Any) -> tuple[int, int, int]:
    """(width, height) of a part's display window, and how many numbers it declares; each within limits."""
    if "deep" in str(header["type"]):
        raise InputError("is a deep image", file=path, expected="one sample a pixel")
    channels, bounded = len(header["channels"]), header["compression"].name.partition("_")[0] in BOUNDED
    if not 1 <= channels <= MOST_CHANNELS:
        raise InputError(f"has {channels} channels", file=path, expected=f"1 to {MOST_CHANNELS}")
    sizes = []
    for name in ("dataWindow", "displayWindow"):
        low, high = np.array(header[name], dtype=int)
        width, height = (int(length) for length in high - low + 1)
        most = (SAMPLES_A_BYTE if bounded else SAMPLES_A_BYTE_ELSE) / channels
        # Around the data window nothing is stored, so that a cropped image may be as short as it likes.
        most = most if name == "dataWindow" else np.inf
        check_size(path, width, height, file_bytes=path.stat().st_size, most_a_byte=most)
        sizes.append((width, height))
    return *sizes[-1], channels * max(width * height for width, height in sizes)


def write_exr_channels(path: Path, channels: Mapping[str, npt.NDArray[Any]]) -> None:
    """Write [H, W] channels (float16, float32 or uint32, kept as they are), losslessly compressed.

    Raises:
        OutputError: the file cannot be written.
    """
    height, width = next(iter(channels.values())).shape
    with exr_in_bands(path, width, height, {name: rows.dtype for name, rows in channels.items()}) as write:
        write(channels)


@contextmanager
def exr_in_bands(
    path: Path, width: int, height: int, types: Mapping[str, npt.DTypeLike]
) -> Iterator[Callable[[Mapping[str, npt.NDArray[Any]]], None]]:
    """A function that writes the next rows of an image, [h, width] a channel, so that it is never held whole.

    ``types``: float16, float32 or uint32 of each channel. Losslessly compressed.

    Raises:
        OutputError: the file cannot be written, or rows are missing at the end.
    """
    header = OpenEXR.Header(width, height)
    header["compression"] = Imath.Compression(Imath.Compression.ZIP_COMPRESSION)
    kinds = {name: np.dtype(of) for name, of in types.items()}
    header["channels"] = {
        name: Imath.Channel(Imath.PixelType(_PIXEL_TYPES[kind.name])) for name, kind in kinds.items()
    }
    with _writing(path):
        file = OpenEXR.OutputFile(str(path), header)

    def write(rows: Mapping[str, npt.NDArray[Any]]) -> None:
        stored = {name: rows[name].astype(kind).tobytes() for name, kind in kinds.items()}
        with _writing(path):
            file.writePixels(stored, len(next(iter(rows.values()))))

    try:
        yield write
    except BaseException:
        with suppress(OSError, RuntimeError):
            file.close()
        raise
    with _writing(path):
        # The library keeps to itself what goes wrong with the last rows and the table of all of them.
        file.close()
        if not OpenEXR.InputFile(str(path)).isComplete():
            raise OSError("it ends before its last row: is the disk full?")


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise OutputError(f"{path}: cannot be written ({error})") from error


def write_exr(path: Path, pixels: Float, *, half: bool = False) -> None:
    """Write [H, W, 3] RGB or [H, W, 4] RGBA (premultiplied) as float, or as half.

    Raises:
        OutputError: the file cannot be written.
    """
    stored = np.asarray(pixels, dtype=np.float16 if half else np.float32)
    write_exr_channels(path, {name: stored[..., i] for i, name in enumerate("RGBA"[: stored.shape[-1]])})


@contextmanager
def _opened(path: Path, *, header_only: bool) -> Iterator[Any]:
    """An open file; whatever the library finds wrong, on opening or later, becomes an InputError."""
    need_file(path, "an EXR image", most=MOST_IMAGE_BYTES)
    printed = StringIO()
    try:
        # The library prints what it finds wrong with a file, before it raises.
        with (
            redirect_stdout(printed),
            OpenEXR.File(str(path), separate_channels=True, header_only=header_only) as file,
        ):
            yield file
    except InputError:
        raise
    except Exception as error:
        if is_out_of_memory(error):
            raise
        # It prints and forgets this one, too, and has a file without parts then.
        if "MemoryError" in printed.getvalue().replace(str(path), ""):
            raise MemoryError(str(path)) from error
        # A truncated file opens without its parts, and fails at the first question asked of it.
        reason = str(error).replace(str(path), "").strip(" :\n") or "no reason given"
        raise InputError(
            f"cannot be read as EXR ({reason})",
            file=path,
            expected="a complete EXR image",
            hint="It may be truncated, or of another type than its name says",
        ) from error


def _in_display_window(pixels: npt.NDArray[Any], data: Any, display: Any) -> npt.NDArray[Any]:
    """The part of a data window's pixels that lies in the display window, zeros elsewhere."""
    (dx0, dy0), (vx0, vy0), (vx1, vy1) = data[0], display[0], display[1]
    canvas = np.zeros((vy1 - vy0 + 1, vx1 - vx0 + 1), dtype=pixels.dtype)
    top, left = max(dy0, vy0), max(dx0, vx0)
    part = pixels[top - dy0 : max(vy1 + 1 - dy0, 0), left - dx0 : max(vx1 + 1 - dx0, 0)]
    canvas[top - vy0 : top - vy0 + part.shape[0], left - vx0 : left - vx0 + part.shape[1]] = part
    return canvas

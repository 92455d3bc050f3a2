# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What is asked of a file before it is read: that it is one, and that what it declares is no bomb.

Captures are downloaded from strangers. A header is a few bytes that can ask for terabytes, so that sizes
are held against limits, and against what the file's own length can hold, before anything is allocated.
"""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from typing import Any

from swatchwork.errors import InputError

MOST_PIXELS = 178_956_970
"""Of one image, as many as Pillow opens by itself; the largest camera backs have 151 million, an 16,384 x
8,192 panorama 134 million."""

MOST_JSON_BYTES = 1 << 27
"""Of one JSON document; ten thousand frames take 10 MB, a material of 100 representatives 3 MB."""

MOST_JSON_VALUES = 1 << 23
"""Of one JSON document: three bytes make a list of 64. Ten thousand frames have 300,000."""

MOST_IMAGE_BYTES = 1 << 32
"""Of one image file; the largest that we read takes 2.9 GB as floats without compression."""

MOST_NAME_BYTES, MOST_PATH_BYTES = 255, 1024
"""Of a file's name, as file systems have it, and of a path that a capture names."""

MOST_MESH_BYTES = 1 << 32
"""Of one mesh file, or of the buffers of one glTF; fifty million triangles take about as much."""

MOST_ELEMENTS = 1 << 28
"""Vertices or faces that a mesh may declare: their numbers, times three, are kept in 32 bits."""


def need_file(path: Path, expected: str, *, most: int | None = None, hint: str | None = None) -> int:
    """The size in bytes of a regular file: not a folder, pipe or device, which could block or never end.

    Raises:
        InputError: there is none, it is something else, or it is larger than ``most`` bytes.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        raise InputError("no such file", file=path, expected=expected, hint=hint) from None
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"is {_kind(status.st_mode)}, no file", file=path, expected=expected, hint=hint)
    if most is not None and status.st_size > most:
        raise InputError(f"is {status.st_size} bytes long", file=path, expected=f"{most} at most")
    return status.st_size


def check_size(path: Path, width: int, height: int, *, file_bytes: int, most_a_byte: float) -> None:
    """Refuse an image that declares more pixels than we read, or than its file can hold.

    Args:
        file_bytes: the file's length.
        most_a_byte: pixels that one byte of the file's format stands for at most.

    Raises:
        InputError: naming what it declares and the limit.
    """
    if width < 1 or height < 1 or width * height > MOST_PIXELS:
        raise InputError(
            f"declares {width} x {height} pixels", file=path, expected=f"1 to {MOST_PIXELS} pixels in all"
        )
    if width * height > most_a_byte * file_bytes:
        raise InputError(
            f"declares {width} x {height} pixels in {file_bytes} bytes",
            file=path,
            expected="a file long enough to hold them",
            hint="It may be truncated, or made to exhaust memory",
        )


def read_json(path: Path, expected: str = "a JSON object", hint: str | None = "It may be truncated") -> Any:
    """The document of a JSON file.

    A key twice in one object is refused: Python would keep the last, other programs the first.

    Raises:
        InputError: no regular file, too long, nested too deeply, or no JSON.
    """
    need_file(path, expected, most=MOST_JSON_BYTES)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"is not JSON ({error})", file=path, expected=expected, hint=hint) from error
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path, expected=expected) from error
    return parsed_json(text, path, expected, hint)


def parsed_json(
    text: str | bytes, path: Path, expected: str = "a JSON object", hint: str | None = "It may be truncated"
) -> Any:
    """The document in a text of the file ``path``; see `read_json`."""
    if isinstance(text, str):
        values = sum(text.count(mark) for mark in ",[{")
    else:
        values = sum(text.count(mark) for mark in (b",", b"[", b"{"))
    if values > MOST_JSON_VALUES:
        raise InputError(f"has more than {MOST_JSON_VALUES} values", file=path, expected=expected)
    try:
        return json.loads(text, object_pairs_hook=_once)
    except RecursionError as error:
        raise InputError("is not JSON (nested too deeply)", file=path, expected=expected) from error
    except _Twice as error:
        raise InputError(str(error), file=path, expected="each key once in an object") from error
    except ValueError as error:
        raise InputError(f"is not JSON ({error})", file=path, expected=expected, hint=hint) from error


class _Twice(Exception):
    pass


def _once(items: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(items)
    if len(made) < len(items):
        seen: set[str] = set()
        twice = next(key for key, _ in items if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise _Twice(f'the key "{twice[:60]}" is there twice')
    return made


def _kind(mode: int) -> str:
    if stat.S_ISDIR(mode):
        return "a folder"
    return "a pipe" if stat.S_ISFIFO(mode) else "a device or socket"

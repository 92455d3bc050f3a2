# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a PLY file declares, held against its length before a general reader allocates for it."""

from __future__ import annotations

from pathlib import Path

from swatchwork.capture import MOST_MESH_BYTES, need_file
from swatchwork.capture.guarding import MOST_ELEMENTS
from swatchwork.errors import InputError

MOST_HEADER_BYTES = 1 << 16
_BYTES = {"char": 1, "uchar": 1, "short": 2, "ushort": 2, "int": 4, "uint": 4, "float": 4, "double": 8} | {
    f"{kind}{bits}": bits // 8 for kind in ("int", "uint", "float") for bits in (8, 16, 32, 64)
}


def check_ply(path: Path) -> None:
    """Refuse a header that is broken, or whose elements the rest of the file cannot hold.

    Raises:
        InputError: naming the element and its count.
    """
    length = need_file(path, "a PLY mesh", most=MOST_MESH_BYTES)
    with path.open("rb") as file:
        start = file.read(MOST_HEADER_BYTES)
    head, mark, _ = start.partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    if not mark or not lines or lines[0] != ["ply"] or len(lines) < 2 or lines[1][:1] != ["format"]:
        raise _broken(path, "the header is not one, or has no end")
    text = lines[1][1:2] == ["ascii"]
    least = 0
    elements: list[tuple[str, int, int]] = []
    for words in filter(None, lines[2:]):
        if words[0] == "element":
            if len(words) != 3 or not words[2].isdecimal() or int(words[2]) > MOST_ELEMENTS:
                raise _broken(path, f"it has the line {' '.join(words)!r}"[:120])
            elements.append((words[1], int(words[2]), 0))
        elif words[0] == "property":
            # Of a list there is at least its length.
            if len(words) < 3 or not elements or words[2 if words[1] == "list" else 1] not in _BYTES:
                raise _broken(path, f"it has the line {' '.join(words)!r}"[:120])
            name, count, size = elements[-1]
            one = 2 if text else _BYTES[words[2 if words[1] == "list" else 1]]
            elements[-1] = name, count, size + one
    for name, count, size in elements:
        least += count * size
        # The last line of a text may lack its end.
        if least > length - len(head) + 1:
            raise InputError(
                f"declares {count} of the element {name!r}",
                file=path,
                expected=f"what its {length} bytes hold",
                hint="Is it truncated?",
            )


def _broken(path: Path, what: str) -> InputError:
    return InputError(
        f"cannot be read as PLY ({what})", file=path, expected="a whole PLY file", hint="Is it truncated?"
    )

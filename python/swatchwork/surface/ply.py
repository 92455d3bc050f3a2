# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a PLY file declares, held against what it has before a general reader allocates for it.

That reader takes a file's word: for how many rows there are of a text, and that every list of a binary
element is as long as the first.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from swatchwork.capture.guarding import MOST_ELEMENTS
from swatchwork.errors import InputError

MOST_HEADER_BYTES = 1 << 16
MOST_CORNERS = 64
"""Of a polygon that somebody means; a longer one is taken for damage."""
_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_TYPES |= {"float": "f4", "double": "f8", "float16": "f2", "float32": "f4", "float64": "f8"}
_TYPES |= {f"{kind}{8 * size}": f"{kind[0]}{size}" for kind in ("int", "uint") for size in (1, 2, 4, 8)}


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str | None, str]] = field(default_factory=list)
    """Type of a list's length (None: no list), and of the values; as NumPy has them."""


def check_ply(path: Path, content: bytes) -> None:
    """Refuse a header that is broken, or whose elements are not what the rest of the file is.

    Raises:
        InputError: naming the element and what it has.
    """
    head, mark, _ = content[:MOST_HEADER_BYTES].partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    if not mark or not lines or lines[0] != ["ply"] or len(lines) < 2 or lines[1][:1] != ["format"]:
        raise _broken(path, "the header is not one, or has no end")
    kind = lines[1][1] if len(lines[1]) > 1 else ""
    if kind not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise _broken(path, f"its format is {kind[:40]!r}")
    elements = _elements(path, lines[2:])
    start = content.index(b"\n", len(head)) + 1 if b"\n" in content[len(head) :] else len(content)
    if kind == "ascii":
        _check_text(path, elements, content[start:])
    else:
        _check_binary(path, elements, memoryview(content)[start:], "<" if "little" in kind else ">")


def _elements(path: Path, lines: list[list[str]]) -> list[_Element]:
    elements: list[_Element] = []
    for words in filter(None, lines):
        if words[0] == "element" and len(words) == 3 and words[2].isdecimal() and len(words[2]) < 12:
            elements.append(_Element(words[1], int(words[2])))
            if elements[-1].count > MOST_ELEMENTS:
                raise _broken(path, f"it declares {words[2]} of the element {words[1]!r}")
        elif words[0] == "property" and elements and len(words) == 3 and words[1] in _TYPES:
            elements[-1].properties.append((None, _TYPES[words[1]]))
        elif (
            (words[0], len(words)) == ("property", 5)
            and (elements and words[1] == "list")
            and words[3] in _TYPES
            and _TYPES.get(words[2], "f")[0] in "iu"
        ):
            elements[-1].properties.append((_TYPES[words[2]], _TYPES[words[3]]))
        elif words[0] not in ("comment", "obj_info"):
            raise _broken(path, f"its header has the line {' '.join(words)[:60]!r}")
    return elements


def _check_text(path: Path, elements: list[_Element], body: bytes) -> None:
    rows = body.splitlines()
    at = 0
    for element in elements:
        if at + element.count > len(rows):
            raise _too_few(path, element, len(rows) - at)
        lists = [kind is not None for kind, _ in element.properties]
        for row in rows[at : at + element.count]:
            words, taken = row.split(), 0
            for is_list in lists:
                length = words[taken] if taken < len(words) else b"-"
                taken += 1 + (int(length) if is_list and length.isdigit() and len(length) < 10 else 0)
                if is_list and (not length.isdigit() or length == b"0"):
                    raise _broken(
                        path, f"a list of the element {element.name!r} is of length {length[:20]!r}"
                    )
            if len(words) != taken:
                raise _broken(
                    path, f"a row of the element {element.name!r} has {len(words)} numbers, not {taken}"
                )
        at += element.count


def _check_binary(path: Path, elements: list[_Element], body: memoryview, order: str) -> None:
    at = 0
    # An element without properties has no bytes.
    for element in filter(lambda e: e.count and e.properties, elements):
        columns: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
        counts, offsets, kinds = dict[str, int](), dict[str, int](), dict[str, str]()
        for i, (length_kind, kind) in enumerate(element.properties):
            if length_kind is not None:
                name, size = f"n{i}", np.dtype(columns).itemsize if columns else 0
                kinds[name], offsets[name] = length_kind, size
                length = _whole(body, at + size, order + length_kind)
                if not 1 <= length <= len(body):
                    raise _broken(path, f"a list of the element {element.name!r} is of length {length}")
                counts[name] = length
                columns += [(name, order + length_kind), (f"v{i}", order + kind, (length,))]
            else:
                columns.append((f"v{i}", order + kind))
        row = np.dtype(columns)
        room = min(element.count, (len(body) - at) // row.itemsize)
        for name, length in counts.items():
            found = np.frombuffer(body, row, room, at)[name] if room else np.zeros(0)
            if (found != length).any():
                raise _mixed(path, element, length, int(found[np.argmax(found != length)]))
            # A polygon of fewer corners may be all that is left.
            rest = at + room * row.itemsize + offsets[name]
            other = _whole(body, rest, order + kinds[name])
            if room < element.count and other != length and 3 <= other <= MOST_CORNERS:
                raise _mixed(path, element, length, other)
        if room < element.count:
            raise _too_few(path, element, room)
        at += element.count * row.itemsize


def _whole(body: memoryview, at: int, kind: str) -> int:
    """The integer of a type at a place; of what is left, where the file ends before."""
    content = bytes(body[at : at + int(kind[2])])
    return int.from_bytes(content, "little" if kind[0] == "<" else "big", signed=kind[1] == "i")


def _mixed(path: Path, element: _Element, length: int, other: int) -> InputError:
    """Rows of several lengths: polygons of several kinds, or numbers that are none."""
    sound = 1 <= other <= MOST_CORNERS and length <= MOST_CORNERS
    return InputError(
        f"cannot be read as PLY (lists of the element {element.name!r} are of length {length} and {other})",
        file=path,
        expected="polygons of one number of corners" if sound else "a whole PLY file of triangles",
        hint="Triangulate the mesh" if sound else "Is it truncated?",
    )


def _too_few(path: Path, element: _Element, found: int) -> InputError:
    return InputError(
        f"declares {element.count} of the element {element.name!r}, and has room for {found}",
        file=path,
        expected="all that it declares",
        hint="Is it truncated?",
    )


def _broken(path: Path, what: str) -> InputError:
    return InputError(
        f"cannot be read as PLY ({what})",
        file=path,
        expected="a whole PLY file of triangles",
        hint="Is it truncated?",
    )

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""glTF and GLB, taken apart and checked before a general reader sees them.

That reader gets the geometry alone: no pictures, and buffers as bytes that were found inside the file or
beside it. Everything that declares a size, or that points at something, is held against what is there.
"""

from __future__ import annotations

import base64
import binascii
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from swatchwork.capture import MOST_MESH_BYTES, need_file, parsed_json, path_within, shown
from swatchwork.errors import InputError
from swatchwork.surface.gltf_meshes import is_count, reduced_meshes

_KEPT = ("asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews", "cameras")
_WHOLE = "a whole glTF 2.0 file"


def read_gltf(path: Path) -> tuple[dict[str, Any], list[bytes]]:
    """The geometry's part of the JSON, checked, and the buffers, of which each "uri" is the number.

    Raises:
        InputError: no glTF 2.0, or something in it declares more than there is, names a file outside its
            folder, or is a scene that is no tree.
    """
    need_file(path, _WHOLE, most=MOST_MESH_BYTES)
    content = path.read_bytes()
    text, binary = _chunks(path, content) if path.suffix.lower() == ".glb" else (content, None)
    found = parsed_json(text, path, "a glTF 2.0 file")
    if not isinstance(found, dict) or not isinstance(found.get("asset"), dict):
        raise InputError('has no "asset"', file=path, expected=_WHOLE)
    try:
        head = {key: found[key] for key in _KEPT if key in found}
        # Pictures are not read; a primitive's UVs are only kept where it has a material.
        head["materials"] = [{} for _ in found.get("materials", [])]
        buffers = [_buffer(path, i, b, binary) for i, b in enumerate(found.get("buffers", []))]
        head["buffers"] = [{"uri": str(i), "byteLength": len(b)} for i, b in enumerate(buffers)]
        _check_views(path, head, buffers)
        _check_tree(path, head.get("nodes", []), head.get("scenes", []))
        head["meshes"], head["accessors"] = reduced_meshes(path, head, sum(map(len, buffers)))
    except (AttributeError, IndexError, KeyError, TypeError) as error:
        raise InputError(f"a part is missing or malformed ({error!r})", file=path, expected=_WHOLE) from error
    return head, buffers


def buffer_files(path: Path) -> list[Path]:
    """The files beside a .gltf that hold its numbers; none for other formats, or where it cannot be read."""
    if path.suffix.lower() != ".gltf":
        return []
    try:
        buffers = parsed_json(path.read_bytes(), path).get("buffers", [])
        named = [b["uri"] for b in buffers if "uri" in b and not b["uri"].startswith("data:")]
        return [path_within(path.parent, unquote(uri), str(path), "uri") for uri in named]
    except (InputError, OSError, KeyError, TypeError, AttributeError):
        return []


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a GLB."""
    if len(content) < 20 or content[:4] != b"glTF":
        raise InputError("is no GLB", file=path, expected=_WHOLE, hint="Is it truncated?")
    version, length = struct.unpack_from("<II", content, 4)
    if version != 2 or length != len(content):
        raise InputError(
            f"says that it is version {version} and {length} bytes long",
            file=path,
            expected=f"version 2 and its {len(content)} bytes",
            hint="Is it truncated?",
        )
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at < length:
        size, kind = struct.unpack_from("<I4s", content, at) if at + 8 <= length else (length, b"")
        if at + 8 + size > length:
            raise InputError(
                f"a chunk of {size} bytes at {at} ends beyond the file", file=path, expected=_WHOLE
            )
        chunks.setdefault(kind, content[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in chunks:
        raise InputError("has no JSON chunk", file=path, expected=_WHOLE)
    return chunks[b"JSON"], chunks.get(b"BIN\0")


def _buffer(path: Path, number: int, buffer: dict[str, Any], binary: bytes | None) -> bytes:
    uri = buffer.get("uri")
    if uri is None:
        if number or binary is None:
            raise InputError(f"buffer {number} has no data", file=path, expected="a uri, or a binary chunk")
        found = binary
    elif not isinstance(uri, str):
        raise InputError(f"buffer {number} has the uri {shown(uri)}", file=path, expected="a string")
    elif uri.startswith("data:"):
        try:
            found = base64.b64decode(uri.partition("base64,")[2], validate=True)
        except (binascii.Error, ValueError) as error:
            raise InputError(f"buffer {number} is no base64 ({error})", file=path, expected=_WHOLE) from error
    else:
        file = path_within(path.parent, unquote(uri), str(path), "uri")
        need_file(file, f"buffer {number} of {path.name}", most=MOST_MESH_BYTES)
        found = file.read_bytes()
    declared = buffer["byteLength"]
    if not is_count(declared) or declared > len(found):
        raise InputError(
            f"buffer {number} declares {shown(declared)} bytes",
            file=path,
            expected=f"the {len(found)} that it has",
            hint="Is a file truncated?",
        )
    return found


def _check_views(path: Path, head: dict[str, Any], buffers: list[bytes]) -> None:
    for number, view in enumerate(head.get("bufferViews", [])):
        start, size, of = view.get("byteOffset", 0), view["byteLength"], view["buffer"]
        sound = all(map(is_count, (start, size, of))) and of < len(buffers)
        if not sound or start + size > len(buffers[of]):
            raise InputError(
                f"bufferView {number} is bytes {shown(start)} to + {shown(size)} of buffer {shown(of)}",
                file=path,
                expected="a part of one of its buffers",
            )
        if "byteStride" in view and not (is_count(view["byteStride"]) and 1 <= view["byteStride"] <= 252):
            raise InputError(
                f"bufferView {number} has byteStride {shown(view['byteStride'])}",
                file=path,
                expected="4 to 252",
            )


def _check_tree(path: Path, nodes: list[Any], scenes: list[Any]) -> None:
    """Each node below one other at most, and none below itself: else a few could stand for billions."""
    above: dict[int, int] = {}
    for number, node in enumerate(nodes):
        for child in node.get("children", []):
            if not is_count(child) or child >= len(nodes) or child in above:
                raise InputError(
                    f"node {shown(child)} is missing, or below two others",
                    file=path,
                    expected="a tree of nodes",
                )
            above[child] = number
    for child in list(above):
        at, steps = child, 0
        while at in above and steps <= len(nodes):
            at, steps = above[at], steps + 1
        if steps > len(nodes):
            raise InputError(f"node {child} is below itself", file=path, expected="a tree of nodes")
        if steps > DEEPEST:
            raise InputError(f"node {child} is {steps} levels deep", file=path, expected=f"{DEEPEST} at most")
    for scene in scenes:
        seen: set[int] = set()
        for root in scene.get("nodes", []):
            if not is_count(root) or root >= len(nodes) or root in above or root in seen:
                raise InputError(
                    f"node {shown(root)} is no root, or twice in a scene",
                    file=path,
                    expected="a tree of nodes",
                )
            seen.add(root)


DEEPEST = 256
"""Levels of nodes; exporters of scans write one to three."""

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mutations of transforms.json as a text: cut, nested, of other bytes, or said otherwise."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

from jsons import load, save
from mutating import flipped, mutation


@mutation("json", "twice")
def key_twice(folder: Path, rng: Random) -> str:
    text = json.dumps(load(folder))
    key = rng.choice(("mesh", "frames", "file_path"))
    value = rng.choice(('"other"', "null", "1", "[]"))
    text = text.replace(f'"{key}":', f'"{key}": {value}, "{key}":', 1)
    (folder / "transforms.json").write_text(text, encoding="utf-8")
    return f"{key} twice"


@mutation("json", "truncated")
def json_truncated(folder: Path, rng: Random) -> str:
    file = folder / "transforms.json"
    content = file.read_bytes().rstrip()
    cut = rng.randrange(len(content))
    file.write_bytes(content[:cut])
    return f"the first {cut} of {len(content)} bytes"


@mutation("json", "wrong size")
def json_deep(folder: Path, rng: Random) -> str:
    depth = rng.choice((2_000, 100_000))
    nest = rng.choice(("[" * depth + "]" * depth, '{"a":' * depth + "1" + "}" * depth, "[" * depth))
    if rng.random() < 0.5 and nest[-1] != "[":
        text = json.dumps(load(folder))
        text = text[:-1] + ', "x": ' + nest + "}"
    else:
        text = nest
    (folder / "transforms.json").write_text(text, encoding="utf-8")
    return f"{depth} levels"


@mutation("json", "wrong type")
def json_of_bytes(folder: Path, rng: Random) -> str:
    file = folder / "transforms.json"
    kind = rng.choice(("noise", "utf-16", "bom", "latin", "zeros"))
    text = file.read_text(encoding="utf-8")
    content = {
        "noise": rng.randbytes(500),
        "utf-16": text.encode("utf-16"),
        "bom": b"\xef\xbb\xbf" + text.encode(),
        "latin": text.replace("images", "im\xe4ges").encode("latin-1"),
        "zeros": bytes(4096),
    }[kind]
    file.write_bytes(content)
    return kind


@mutation("json", None)
def json_bits_flipped(folder: Path, rng: Random) -> str:

    file = folder / "transforms.json"
    file.write_bytes(flipped(file.read_bytes(), rng))
    return "bits"


@mutation("json", None)
def json_said_otherwise(folder: Path, rng: Random) -> str:
    """The same in another order, with keys that nobody knows, or laid out otherwise."""
    head = load(folder)
    items = list(head.items())
    rng.shuffle(items)
    made = dict(items)
    made["x_unknown"] = rng.choice(
        [None, [[[1]]], {"a": {"b": 1}}, "x" * 100_000, 10**300, "\x1b[31m", "<script>"]
    )
    for frame in made["frames"]:
        frame["colmap_im_id"] = 1
    (folder / "transforms.json").write_text(
        json.dumps(made, indent=rng.choice((None, 0, 7))), encoding="utf-8"
    )
    return "reordered, unknown keys"


@mutation("json", None)
def json_huge(folder: Path, rng: Random) -> str:
    head = load(folder)
    head["x_unknown"] = list(range(200_000)) if rng.random() < 0.5 else "x" * 4_000_000
    save(folder, head)
    return "megabytes of unknown keys"

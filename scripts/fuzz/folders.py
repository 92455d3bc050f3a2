# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Mutations of the paths that a capture names, and of what is found there."""

from __future__ import annotations

import os
from pathlib import Path
from random import Random

from jsons import load, save
from mutating import mutation

KEYS = ("mesh", "file", "file_path", "mask_path")
OUTSIDE = (
    "/etc/passwd",
    "/dev/zero",
    "../../../../etc/passwd",
    "images/../../../x.exr",
    "..\\..\\secret.obj",
    "C:\\Windows\\win.ini",
    "c:/x.obj",
    "\\\\host\\share\\x.obj",
    "http://127.0.0.1:9/x.obj",
    "file:///etc/passwd",
    "//etc/passwd",
    "images/./.././../../x.png",
)
NO_NAME = (
    "mesh\0.obj",
    "mesh.obj\0",
    "a" * 300 + ".obj",
    ("d/" * 3000) + "x.exr",
    ".",
    "./",
    "..",
    "images/..",
    "images",
    "",
    " ",
    "\n",
    "mesh.obj\n",
    "\x1b[31mred\x1b[0m.exr",
    "\ud800.exr",
    "\u202egpj.exe",
    "<img src=x onerror=alert(1)>.exr",
    "[red]x[/red].png",
    "no such file.exr",
    "mesh.xyz",
    "transforms.json",
    "~/.bashrc",
    "%2e%2e/%2e%2e/x",
    "$HOME/x.obj",
    "\N{FULLWIDTH SOLIDUS}etc",
)


def _named(folder: Path, rng: Random) -> tuple[dict[str, object], str, dict[str, object]] | None:
    """The whole document, and an object of it with a key that names a file."""
    head = load(folder)
    objects = [head, *head["frames"]]
    objects += [o["environment"] for o in objects if "environment" in o]
    places = [(o, key) for o in objects for key in KEYS if key in o]
    there, key = rng.choice(places)
    return there, key, head


@mutation("json", "outside the folder")
def path_outside(folder: Path, rng: Random) -> str | None:
    found = _named(folder, rng)
    if found is None:
        return None
    there, key, head = found
    there[key] = text = rng.choice(OUTSIDE)
    save(folder, head)
    return f"{key} = {text!r}"


@mutation("json", "wrong type")
def path_that_names_no_file(folder: Path, rng: Random) -> str | None:
    found = _named(folder, rng)
    if found is None:
        return None
    there, key, head = found
    there[key] = text = rng.choice(NO_NAME)
    save(folder, head)
    return f"{key} = {text[:40]!r}"


def _victim(folder: Path, rng: Random) -> Path:
    """A file that reading the capture needs."""
    files = [f for f in folder.rglob("*") if f.is_file() and f.name != "transforms.json"]
    return rng.choice(sorted(files))


@mutation("folder", "missing")
def file_missing(folder: Path, rng: Random) -> str:
    file = _victim(folder, rng)
    file.unlink()
    return f"{file.name} removed"


@mutation("folder", "wrong type")
def file_is_something_else(folder: Path, rng: Random) -> str:
    file = rng.choice([_victim(folder, rng), folder / "transforms.json"])
    file.unlink()
    kind = rng.choice(("pipe", "folder", "zero", "loop", "dangling", "socket"))
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "folder":
        file.mkdir()
    elif kind == "zero":
        file.symlink_to("/dev/zero")
    elif kind == "loop":
        file.symlink_to(file.name)
    elif kind == "socket":
        import socket

        here = os.getcwd()
        os.chdir(file.parent)
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(file.name)
        os.chdir(here)
    else:
        file.symlink_to("nowhere")
    return f"{file.name} is a {kind}"


@mutation("folder", "outside the folder")
def link_to_outside(folder: Path, rng: Random) -> str:
    """The very file, but two folders up, where the capture has no business."""
    file = _victim(folder, rng)
    outside = folder.parent.parent / f"private-{folder.name}"
    outside.mkdir(exist_ok=True)
    target = outside / file.name
    file.rename(target)
    if rng.random() < 0.5:
        file.symlink_to(target)
    else:
        file.symlink_to(os.path.relpath(target, file.parent))
    return f"{file.name} links to outside"


@mutation("folder", None)
def link_to_inside(folder: Path, rng: Random) -> str:
    file = _victim(folder, rng)
    kept = folder / f"kept{file.suffix}"
    file.rename(kept)
    file.symlink_to(os.path.relpath(kept, file.parent))
    return f"{file.name} links to {kept.name}"


@mutation("folder", "wrong size")
def file_empty(folder: Path, rng: Random) -> str:
    file = _victim(folder, rng)
    file.write_bytes(b"")
    return f"{file.name} is empty"


@mutation("folder", "wrong size")
def file_swapped(folder: Path, rng: Random) -> str | None:
    """Bytes of another file, under the same name and ending."""
    file, other = _victim(folder, rng), _victim(folder, rng)
    if file.suffix == other.suffix or {file.suffix, other.suffix} <= {".exr"}:
        return None
    file.write_bytes(other.read_bytes())
    return f"{file.name} has the bytes of {other.name}"


@mutation("folder", None)
def file_of_noise(folder: Path, rng: Random) -> str:
    file = _victim(folder, rng)
    content = file.read_bytes()
    at = rng.randrange(len(content) + 1)
    file.write_bytes(content[:at] + rng.randbytes(rng.choice((1, 16, 4096))) + content[at:])
    return f"{file.name} has noise at {at}"

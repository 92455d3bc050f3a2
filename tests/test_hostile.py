# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Captures made to do harm: what is declared, named and nested, one wrong thing each, and the message.

`make fuzz` looks for more of the kind by the thousand; what it found is here.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from swatchwork.capture import (
    read_capture,
    read_image,
    read_json,
    read_photograph,
    write_exr,
)
from swatchwork.capture.fields import LINKS_INTO
from swatchwork.errors import InputError
from swatchwork.surface import read_mesh

POSE = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """One photograph of 6 x 4 pixels with a mask, a mesh of four triangles, a light of 8 x 4."""
    folder = tmp_path / "home" / "capture"
    folder.mkdir(parents=True)
    (folder / "mesh.obj").write_text(OBJ)
    write_exr(folder / "env.exr", np.ones((4, 8, 3), np.float32))
    write_exr(folder / "a.exr", np.ones((4, 6, 3), np.float32))
    Image.fromarray(np.full((4, 6), 255, np.uint8)).save(folder / "mask.png")
    frame = {"file_path": "a.exr", "transform_matrix": POSE, "mask_path": "mask.png"}
    head = {"mesh": "mesh.obj", "environment": {"file": "env.exr", "convention": "blender"}}
    head |= {"w": 6, "h": 4, "fl_x": 9.0, "frames": [frame]}
    (folder / "transforms.json").write_text(json.dumps(head))
    return folder


def refused(folder: Path, *parts: str) -> None:
    """Reading all of the capture raises an InputError with these parts in its message."""
    with pytest.raises(InputError) as caught:
        read = read_capture(folder)
        for frame in read.frames:
            read_photograph(frame)
        assert read.mesh_path is not None and read.environment is not None
        read_mesh(read.mesh_path)
        read_image(read.environment.file)
    missing = [part for part in parts if part not in str(caught.value)]
    assert missing == [], str(caught.value)


def edit(folder: Path, change: Callable[[dict[str, Any], dict[str, Any]], object]) -> None:
    head = json.loads((folder / "transforms.json").read_text())
    change(head, head["frames"][0])
    (folder / "transforms.json").write_text(json.dumps(head))


def frame_key(key: str, value: object) -> Callable[[Path], None]:
    return lambda folder: edit(folder, lambda _, frame: frame.update({key: value}))


def key(name: str, value: object) -> Callable[[Path], None]:
    return lambda folder: edit(folder, lambda head, _: head.update({name: value}))


def pose(row: int, column: int, value: object) -> Callable[[Path], None]:
    def change(_: dict[str, Any], frame: dict[str, Any]) -> None:
        frame["transform_matrix"][row][column] = value

    return lambda folder: edit(folder, change)


def replaced_by(name: str, make: Callable[[Path], object]) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        (folder / name).unlink()
        make(folder / name)

    return change


CANCELLING = [[1e200, 1e200, 0, 0], [1e200, -1e200, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

JSON: dict[str, tuple[Callable[[Path], object], tuple[str, ...]]] = {
    "deep": (lambda f: (f / "transforms.json").write_text("[" * 100_000), ("nested too deeply",)),
    "a key twice": (
        lambda f: (f / "transforms.json").write_text('{"mesh": "a.obj", "mesh": "b.obj"}'),
        ('"mesh" is there twice',),
    ),
    "a number of 5000 digits": (
        lambda f: (f / "transforms.json").write_text('{"w": 1' + "0" * 5000 + "}"),
        ("not JSON",),
    ),
    "true as a number": (frame_key("fl_x", True), ('"fl_x" is True', "a positive number")),
    "1e400": (frame_key("cx", float("inf")), ('"cx" is inf', "finite")),
    "an integer beyond doubles": (frame_key("cx", 10**400), ('"cx" is 1', "finite")),
    "strings in a pose": (frame_key("transform_matrix", [["1"] * 4] * 4), ("4 rows of 4 numbers",)),
    "true in a pose": (pose(0, 0, True), ("4 rows of 4 numbers",)),
    "null in a pose": (pose(0, 0, None), ("4 rows of 4 numbers",)),
    "a pose beyond doubles": (pose(0, 3, 10**400), ("finite numbers",)),
    "a pose that cancels to NaN": (frame_key("transform_matrix", CANCELLING), ("not rigid",)),
    "a camera far away": (pose(0, 3, 1e300), ("translation", "1e+12")),
    "an exposure that underflows": (frame_key("exposure", 1e-300), ('"exposure" is 1e-300',)),
    "an exposure that overflows": (frame_key("exposure", 1e300), ('"exposure" is 1e+300',)),
    "a distortion that overflows": (frame_key("k2", 1.7e308), ("k2", "1e+09")),
    "more pixels than we read": (frame_key("w", 10**9), ("1000000000 x 4", "pixels in all")),
    "the version true": (key("format_version", True), ("format_version",)),
    "the folder itself": (frame_key("file_path", "."), ("\"file_path\" is '.', a folder",)),
    "a folder above itself": (frame_key("mask_path", "x/.."), ("a folder",)),
    "a name too long": (frame_key("file_path", "a" * 256 + ".exr"), ("260 bytes long", "names of 255")),
    "a path too long": (frame_key("file_path", "d/" * 600 + "a.exr"), ("1205 bytes long",)),
    "NUL in a name": (frame_key("file_path", "a.exr\0"), ("control characters",)),
    "a line end in a name": (frame_key("file_path", "a\nerror: b.exr"), ("a\\nerror", "control characters")),
    "a surrogate in a name": (frame_key("file_path", "\ud800.exr"), ("control characters",)),
    "an escape in a name": (frame_key("mask_path", "\x1b[31m.png"), ("\\x1b", "control characters")),
    "an absolute path": (key("mesh", "/etc/passwd"), ("outside the capture folder",)),
    "a path of Windows": (key("mesh", "C:\\mesh.obj"), ("outside the capture folder",)),
    "backslashes": (frame_key("file_path", "..\\..\\a.exr"), ("outside the capture folder",)),
    "an address": (key("mesh", "http://127.0.0.1/mesh.obj"), ("outside the capture folder",)),
}


@pytest.mark.parametrize("case", JSON)
def test_json(case: str, capture: Path) -> None:
    spoil, parts = JSON[case]
    spoil(capture)
    refused(capture, "transforms.json", *parts)


@pytest.mark.parametrize("name", ["transforms.json", "mesh.obj", "env.exr", "a.exr", "mask.png"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "loop"])
def test_only_regular_files_are_read(name: str, kind: str, capture: Path) -> None:
    """A pipe would block for ever, /dev/zero never end."""
    make: dict[str, Callable[[Path], object]] = {
        "pipe": os.mkfifo,
        "device": lambda file: file.symlink_to("/dev/zero"),
        "folder": Path.mkdir,
        "loop": lambda file: file.symlink_to(file.name),
    }
    replaced_by(name, make[kind])(capture)
    refused(capture, name)


@pytest.mark.parametrize("name", ["mesh.obj", "env.exr", "a.exr", "mask.png"])
def test_links_stay_in_the_folder(name: str, capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that leads to a private file would bring it into a report that is passed on."""
    private = capture.parents[1] / "private"
    private.mkdir()
    (capture / name).rename(private / name)
    (capture / name).symlink_to(private / name)
    refused(capture, name, "a link that leads outside", str(private), LINKS_INTO)
    # What the user trusts is followed; what only begins alike is not.
    monkeypatch.setenv(LINKS_INTO, f"{capture}{os.pathsep}{private}")
    read_photograph(read_capture(capture).frames[0])
    monkeypatch.setenv(LINKS_INTO, str(private)[:-1])
    refused(capture, "a link that leads outside")


def test_links_within_the_folder_are_followed(capture: Path) -> None:
    (capture / "kept").mkdir()
    for name in ("mesh.obj", "a.exr"):
        (capture / name).rename(capture / "kept" / name)
        (capture / name).symlink_to(Path("kept") / name)
    read_photograph(read_capture(capture).frames[0])
    # The folder itself may be a link, and a mesh may lie, or link, one folder up.
    (capture.parent / "other").symlink_to(capture)
    (capture / "kept/mesh.obj").rename(capture.parent / "mesh.obj")
    (capture / "mesh.obj").unlink()
    (capture / "mesh.obj").symlink_to("../mesh.obj")
    read_capture(capture.parent / "other")


def test_a_folder_that_is_a_link_to_outside(capture: Path) -> None:
    private = capture.parents[1] / "private"
    private.mkdir()
    (capture / "a.exr").rename(private / "a.exr")
    (capture / "images").symlink_to(private)
    frame_key("file_path", "images/a.exr")(capture)
    refused(capture, "a link that leads outside")


def test_masks_of_another_size_are_not_decoded(capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.new("L", (3000, 3000)).save(capture / "mask.png")
    monkeypatch.setattr("swatchwork.capture.photograph.read_mask", lambda _: pytest.fail("it was decoded"))
    with pytest.raises(InputError, match="3000 x 3000"):
        read_photograph(read_capture(capture).frames[0])


def test_radiance_beyond_the_sun(capture: Path) -> None:
    for file in ("a.exr", "env.exr"):
        pixels = read_image(capture / file).linear.copy()
        pixels[1, 1, 1] = 3e38
        write_exr(capture / file, pixels)
    with pytest.raises(InputError, match=r"a\.exr .*3e\+38"):
        read_photograph(read_capture(capture).frames[0])
    with pytest.raises(InputError, match=r"env\.exr: a pixel has 3e\+38"):
        from swatchwork.light import read_environment

        light = read_capture(capture).environment
        assert light is not None
        read_environment(light)


def test_files_have_limits(capture: Path) -> None:
    """Files of holes, which take no room on the disk."""
    assert cv2.imwrite(str(capture / "a.hdr"), np.ones((4, 6, 3), np.float32))
    for name in ("a.exr", "a.hdr", "mask.png"):
        os.truncate(capture / name, 2**33)
        with pytest.raises(InputError, match=f"{name}.*is 8589934592 bytes long"):
            read_image(capture / name)
    os.truncate(capture / "mesh.obj", 2**33)
    with pytest.raises(InputError, match="is 8589934592 bytes long"):
        read_mesh(capture / "mesh.obj")


def test_json_of_many_values(tmp_path: Path) -> None:
    """Three bytes make a list of 64."""
    (tmp_path / "a.json").write_text("[" + "[]," * 2**22 + "[]]")
    with pytest.raises(InputError, match="more than 8388608 values"):
        read_json(tmp_path / "a.json")


def test_json_files_have_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("swatchwork.capture.guarding.MOST_JSON_BYTES", 100)
    (tmp_path / "a.json").write_text("[" + "1, " * 100 + "1]")
    with pytest.raises(InputError, match="303 bytes long; expected 100 at most"):
        read_json(tmp_path / "a.json")

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Symbolic links: those of ordinary layouts are followed, those that would bring a private file are not."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.capture import read_capture, read_photograph, write_exr
from swatchwork.capture.fields import LINKS_INTO
from swatchwork.errors import InputError
from swatchwork.prepare.importing import import_capture
from test_prepare_import import colmap_folder, given, metashape_folder, nerf_folder, orb_folder, owl_folder

__all__ = ["given"]

POSE = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """A capture of one photograph and its mask in images/, and a test set without any in test/."""
    folder = tmp_path / "home/capture"
    for inside in ("images", "test/images"):
        (folder / inside).mkdir(parents=True)
    (folder / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    write_exr(folder / "env.exr", np.ones((4, 8, 3), np.float32))
    for name in ("a.exr", "mask.exr"):
        write_exr(folder / "images" / name, np.ones((4, 6, 3), np.float32))
    frame = {"file_path": "images/a.exr", "transform_matrix": POSE, "mask_path": "images/mask.exr"}
    head: dict[str, Any] = {"w": 6, "h": 4, "fl_x": 9.0, "frames": [frame]}
    for up, place in (("", folder), ("../", folder / "test")):
        light = {"file": f"{up}env.exr", "convention": "blender"}
        (place / "transforms.json").write_text(
            json.dumps(head | {"mesh": f"{up}mesh.obj", "environment": light})
        )
    return folder


def test_a_test_set_links_to_the_photographs_of_its_capture(capture: Path) -> None:
    for name in ("a.exr", "mask.exr"):
        (capture / "test/images" / name).symlink_to(f"../../images/{name}")
    read_photograph(read_capture(capture / "test").frames[0])
    # A path that climbs by itself is none, and a folder above that is no capture is nobody's to read.
    file = capture / "test/transforms.json"
    file.write_text(file.read_text().replace("images/a.exr", "../images/a.exr"))
    with pytest.raises(InputError, match="outside the capture folder"):
        read_capture(capture / "test")
    file.write_text(file.read_text().replace("../images/a.exr", "images/a.exr"))
    (capture / "transforms.json").unlink()
    with pytest.raises(InputError, match="a link that leads outside"):
        read_capture(capture / "test")


def test_cameras_alone_follow_no_link(capture: Path) -> None:
    """`relight --cameras` and `plan --have` read no photograph: they may lie on another disk."""
    disk = capture.parents[1] / "disk"
    (capture / "images").rename(disk)
    (capture / "images").symlink_to(disk)
    assert len(read_capture(capture, require_images=False).frames) == 1
    with pytest.raises(InputError, match="a link that leads outside"):
        read_capture(capture)
    # The size of an image is taken from it where the JSON has none.
    file = capture / "transforms.json"
    file.write_text(file.read_text().replace('"w": 6, "h": 4, ', ""))
    with pytest.raises(InputError, match="a link that leads outside"):
        read_capture(capture, require_images=False)


PROJECTS: dict[str, tuple[Callable[[Path], object], dict[str, list[str]]]] = {
    "objects-with-lighting": (
        owl_folder,
        {"light": ["env.hdr"], "image": ["inputs/image_0000.png"], "mask": ["inputs/mask_0001.png"]},
    ),
    "colmap": (colmap_folder, {"image": ["images/b.png"], "images": ["images"]}),
    "metashape": (metashape_folder, {}),
    "nerf-blender": (nerf_folder, {}),
}


def linked_outside(root: Path, inside: str) -> Path:
    """Moves a project's file or folder into private/, and links to it."""
    private = root.parent / "private"
    private.mkdir(exist_ok=True)
    (root / inside).rename(private / Path(inside).name)
    (root / inside).symlink_to(private / Path(inside).name)
    return private


def refused(source: Path, **options: Any) -> None:
    out = source.parent / f"out-{source.name}"
    with pytest.raises(InputError, match=r"a link that leads outside .*SWATCHWORK_LINKS_INTO"):
        import_capture(source, out, **options)
    assert not out.exists()


@pytest.mark.filterwarnings("ignore:.*not aligned:swatchwork.errors.CaptureWarning")
@pytest.mark.parametrize("layout", PROJECTS)
def test_projects_that_link_to_outside(
    layout: str, tmp_path: Path, given: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    make, files = PROJECTS[layout]
    if not files:
        make(tmp_path / "found")
        pictures = sorted(p.relative_to(tmp_path / "found") for p in (tmp_path / "found").rglob("*.png"))
        files = {"image": [str(pictures[0])]}
    for what, names in files.items():
        root = tmp_path / what
        make(root)
        options = {"mesh": given["mesh"]} if what == "light" else dict(given)
        private = linked_outside(root, names[0])
        refused(root, **options)
        monkeypatch.setenv(LINKS_INTO, str(private))
        assert import_capture(root, tmp_path / f"trusted-{what}", **options).photographs
        monkeypatch.delenv(LINKS_INTO)


def test_photographs_named_without_a_suffix(tmp_path: Path, given: dict[str, Any]) -> None:
    """The link is behind the name with its suffix; the one without is of no file."""
    colmap_folder(tmp_path / "scan", text=True)
    file = tmp_path / "scan/sparse/0/images.txt"
    file.write_text(file.read_text().replace("b.png", "b"))
    assert import_capture(tmp_path / "scan", tmp_path / "sound", **given).photographs == 2
    linked_outside(tmp_path / "scan", "images/b.png")
    refused(tmp_path / "scan", **given)


def test_images_that_the_user_names_may_be_anywhere(tmp_path: Path, given: dict[str, Any]) -> None:
    colmap_folder(tmp_path / "scan")
    private = linked_outside(tmp_path / "scan", "images")
    found = import_capture(tmp_path / "scan", tmp_path / "out", images=private / "images", **given)
    assert found.photographs == 2


def test_the_mesh_and_the_light_of_stanford_orb(tmp_path: Path) -> None:
    """They lie beside the scene, in ground_truth; links within that are as good."""
    scene = "blender_HDR/teapot_scene001"
    truth = "ground_truth/teapot_scene001"
    for name, inside in (("one", f"{truth}/mesh_blender/mesh.obj"), ("two", f"{truth}/env_map/0000.exr")):
        (tmp_path / name).mkdir()
        orb_folder(tmp_path / name / "data")
        file = tmp_path / name / "data" / inside
        kept = file.with_name(f"kept{file.suffix}")
        os.rename(file, kept)
        file.symlink_to(kept.name)
        import_capture(tmp_path / name / "data" / scene, tmp_path / name / "sound")
        linked_outside(tmp_path / name / "data", str(kept.relative_to(tmp_path / name / "data")))
        with pytest.raises(InputError, match="a link that leads outside"):
            import_capture(tmp_path / name / "data" / scene, tmp_path / name / "out")

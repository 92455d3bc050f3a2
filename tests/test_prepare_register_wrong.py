# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Registration of wrong input by the command: what it says, and that no wrong pose passes without a word."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from swatchwork.cli import main
from swatchwork.prepare.registering import Pairs, write_pairs
from swatchwork.surface import write_mesh_obj
from synthetic_photographs import LENS, blob, photograph
from test_prepare_register import card, clicks, command

__all__ = ["card"]


@pytest.fixture
def other(card: Path, tmp_path: Path) -> Path:
    """A copy of the card to spoil."""
    return Path(shutil.copytree(card, tmp_path / "card"))


def swap(folder: Path, a: str, b: str) -> None:
    (folder / a).rename(folder / "aside.png")
    (folder / b).rename(folder / a)
    (folder / "aside.png").rename(folder / b)


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, dict, str]:
    status = main([*words, "--json"])
    captured = capsys.readouterr()
    return status, json.loads(captured.out), captured.err


def test_swapped_photographs_are_told(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    swap(other / "photos", "p0.png", "p2.png")
    write_pairs(other / "pairs.json", {"p0": clicks(0), "p2": clicks(2)}, "mesh.obj")
    _, found, _ = said(command(other, tmp_path / "capture"), capsys)
    words = " ".join([*found["suspicions"], *found["missing"].values()])
    assert "another" in words and any(name in words for name in ("p0", "p2")), words


def test_a_foreign_photograph_is_left_out(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    cv2.imwrite(str(other / "photos" / "p3.png"), photograph(3, texture=7).gray[:, ::-1])
    words = command(other, tmp_path / "capture")
    at = words.index("--masks")
    _, found, _ = said(words[:at] + words[at + 2 :], capsys)
    assert set(found["missing"]) == {"p3"} and "same object" in found["missing"]["p3"]


def test_a_foreign_photograph_with_a_fitting_mask_is_told(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    cv2.imwrite(str(other / "photos" / "p3.png"), photograph(3, texture=7).gray[:, ::-1])
    _, found, _ = said(command(other, tmp_path / "capture"), capsys)
    assert not found["missing"]
    (about,) = found["suspicions"]
    assert about.startswith("p3: its silhouette alone places it")


def test_the_mask_of_another_photograph_is_told(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    swap(other / "masks", "p0.png", "p3.png")
    _, found, _ = said(command(other, tmp_path / "capture"), capsys)
    about = [words for words in found["suspicions"] if words.startswith(("p0", "p3"))]
    assert about and all("mask" in words for words in about), found["suspicions"]


def test_a_mirrored_mesh_with_right_pairs_is_told(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    mesh = blob().meshes[0]
    flipped = replace(
        mesh,
        vertices=mesh.vertices * [1, -1, 1],
        normals=mesh.normals * [1, -1, 1],
        faces=mesh.faces[:, ::-1],
    )
    write_mesh_obj(other / "mesh.obj", flipped)
    right = clicks(0)
    pairs = Pairs("p0.png", right.uv_px, right.x_in_world * [1, -1, 1])
    write_pairs(other / "pairs.json", {"p0": pairs}, "mesh.obj")
    assert main(command(other, tmp_path / "capture")) == 2
    assert "mirror image" in capsys.readouterr().err
    assert not (tmp_path / "capture").exists()


def test_pairs_in_another_unit_than_the_mesh_are_told(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    mesh = blob().meshes[0]
    write_mesh_obj(other / "mesh.obj", replace(mesh, vertices=1000 * mesh.vertices))
    assert main(command(other, tmp_path / "capture")) == 2
    words = capsys.readouterr().err
    assert "100 % of the pairs' points are not on the mesh" in words
    assert "The mesh looks to be in millimetres where the pairs are in metres" in words


def test_a_wild_click_is_left_out(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    right = clicks(0)
    uv = right.uv_px.copy()
    uv[3] = (1e10, 5.0)
    write_pairs(other / "pairs.json", {"p0": Pairs("p0.png", uv, right.x_in_world)}, "mesh.obj")
    words = command(other, tmp_path / "capture", photos="photos/p0.png")
    _, found, _ = said(words, capsys)
    assert found["photographs"][0]["pairs_left_out"] == [4]


def test_pairs_of_a_photograph_that_is_not_given(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    assert main(command(other, tmp_path / "capture", photos="photos/p1.png")) == 2
    assert "there are pairs of p0.png only" in capsys.readouterr().err


def test_a_speck_of_a_mask_places_nothing(other: Path, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    speck = np.zeros((LENS.height, LENS.width), np.uint8)
    cv2.circle(speck, (300, 200), 12, 255, -1)
    cv2.imwrite(str(other / "masks" / "p0.png"), speck)
    words = command(other, tmp_path / "capture", photos="photos/p0.png")
    at = words.index("--pairs")
    assert main(words[:at] + words[at + 2 :]) == 2
    assert "masks/p0.png: the object is only 20 px large" in capsys.readouterr().err

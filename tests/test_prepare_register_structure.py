# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Structure from motion, and its world brought onto the mesh's."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from swatchwork.errors import InputError
from swatchwork.prepare.registering import (
    Structure,
    align_to_mesh,
    find_tracks,
    refine,
    structure_from_motion,
)
from swatchwork.prepare.registering.bundle import Bundle
from synthetic_photographs import (
    blob,
    photograph,
    photographs,
    shaken,
    true_camera,
    true_tracks,
    truth,
    worst,
)

needs_pycolmap = pytest.mark.skipif(
    __import__("importlib.util").util.find_spec("pycolmap") is None,
    reason="pycolmap is not installed (pip install 'swatchwork[colmap]')",
)


def turned_world(scale: float, wrong: float = 0.0, noise: float = 0.003) -> tuple[Structure, np.ndarray]:
    """The truth as structure from motion might have it, and mesh_from_structure."""
    tracks = true_tracks(2500, 0.0)
    seen: Bundle = refine(blob(), photographs_without_pictures(), truth(), tracks, steps=0)
    rng = np.random.default_rng(5)
    x = seen.points + rng.normal(0, noise, seen.points.shape)
    off = rng.random(len(x)) < wrong
    x[off] += rng.uniform(-1, 1, (int(off.sum()), 3))
    mesh_from_structure = np.eye(4)
    mesh_from_structure[:3, :3] = scale * Rotation.from_rotvec([0.4, -1.9, 0.7]).as_matrix()
    mesh_from_structure[:3, 3] = [3.0, -7.0, 1.5]
    back = np.linalg.inv(mesh_from_structure)
    cameras = {}
    for name, camera in truth().items():
        pose = back @ camera.world_from_camera
        pose[:3, :3] *= scale
        cameras[name] = replace(camera, world_from_camera=pose)
    frames = tuple(
        tuple(tracks.names[f] for f in tracks.frame[tracks.track == t]) for t in range(len(tracks))
    )
    return Structure(cameras, x @ back[:3, :3].T + back[:3, 3], frames, ()), mesh_from_structure


def photographs_without_pictures() -> list:
    return [replace(photograph(0), file=Path(f"{name}.png")) for name in truth()]


@pytest.mark.parametrize("scale", [0.03, 250.0])
def test_a_scale_of_any_size_is_found(scale: float) -> None:
    structure, true = turned_world(scale, wrong=0.2)
    x = structure.points @ true[:3, :3].T + true[:3, 3]
    aligned = align_to_mesh(blob(), structure, {"p3": true_camera(3)})
    # A thousand points, each to 0.003 of a radius of 1; samples are 0.01 apart. Ends turn most.
    assert aligned.scale == pytest.approx(scale, rel=1e-3)
    assert np.linalg.norm(aligned.points - x, axis=1).max() < 8e-3
    angle, away = worst(aligned.cameras)
    assert angle < 0.15 and away < 0.003
    assert 0.7 < aligned.near < 0.9 and aligned.off.shape == (len(structure.points),)


def test_a_first_pose_that_is_off_does_not_matter_much() -> None:
    structure, _ = turned_world(4.0)
    aligned = align_to_mesh(blob(), structure, shaken({"p3": true_camera(3)}, 1.0, 0.03))
    angle, away = worst(aligned.cameras)
    assert angle < 0.25 and away < 0.005 and aligned.near > 0.97


def test_the_posed_photograph_that_fits_leads() -> None:
    structure, _ = turned_world(4.0)
    wrong = shaken({"p3": true_camera(3)}, 40.0, 0.5)["p3"]
    aligned = align_to_mesh(blob(), structure, {"p3": wrong, "p5": true_camera(5)})
    assert worst(aligned.cameras)[0] < 0.25


def test_what_does_not_fit_is_said() -> None:
    structure, _ = turned_world(4.0)
    with pytest.raises(InputError, match="points that p3 sees agree on a scale of its world"):
        align_to_mesh(blob(), structure, {"p3": shaken({"p3": true_camera(3)}, 15.0, 0.5)["p3"]})
    with pytest.raises(InputError, match=r"none of the placed photographs \(p9\) is one that structure"):
        align_to_mesh(blob(), structure, {"p9": true_camera(3)})
    with pytest.raises(InputError, match="there are none"):
        align_to_mesh(blob(), structure, {})


@needs_pycolmap
def test_structure_from_motion_and_the_mesh_place_all(tmp_path: Path) -> None:
    foreign = replace(photograph(2, 5), file=Path("foreign.png"))
    views = [*photographs(), foreign]
    structure = structure_from_motion(views, tmp_path)
    assert set(structure.cameras) == set(truth()) and structure.missing == ("foreign",)
    assert len(structure.points) > 300 and min(map(len, structure.frames)) >= 2
    aligned = align_to_mesh(blob(), structure, {"p2": true_camera(2)})
    assert aligned.near > 0.95
    # COLMAP's chain of views knows of no mesh: it bends, and its ends swing.
    angle, away = worst(aligned.cameras)
    assert angle < 0.8 and away < 0.01
    found = refine(blob(), views, aligned.cameras, find_tracks(views))
    angle, away = worst(found.cameras)
    assert angle < 0.1 and away < 0.002


@needs_pycolmap
def test_wrong_input_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="2 photographs are given; expected 3"):
        structure_from_motion(photographs()[:2], tmp_path)
    with pytest.raises(InputError, match="two photographs are named p0"):
        structure_from_motion([photograph(0)] * 3, tmp_path / "twice")
    plain = [photograph(i, None) for i in range(3)]
    with pytest.raises(InputError, match="3 photographs share too little for structure from motion"):
        structure_from_motion(plain, tmp_path / "plain")
    with pytest.raises(InputError, match="is there already"):
        structure_from_motion(plain, tmp_path / "plain")


def test_a_missing_pycolmap_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    with pytest.raises(InputError, match=r"not installed; .*pip install 'swatchwork\[colmap\]'"):
        structure_from_motion([], tmp_path)


def test_a_failure_names_no_folder_that_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_: int) -> None:
        raise RuntimeError("Check failed\nno space left")

    fatal = SimpleNamespace(minloglevel=0, FATAL=SimpleNamespace(value=3))
    fake = SimpleNamespace(logging=fatal, set_random_seed=fails)
    monkeypatch.setattr("swatchwork.prepare.registering.structure._pycolmap", lambda: fake)
    views = photographs_without_pictures()
    with pytest.raises(InputError, match=r"^COLMAP failed \(no space left\)") as caught:
        structure_from_motion(views[:3], tmp_path)
    assert caught.value.file is None

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Meshes: files in every format, normals, and what is wrong with bad ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from swatchwork.errors import CaptureWarning, InputError
from swatchwork.surface import Mesh, mesh_from_arrays, read_mesh, write_mesh_obj

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "mesh.obj"
    path.write_text(text)
    return path


def sphere(subdivisions: int = 3) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions)


def test_obj_keeps_seams_and_the_files_normals(tmp_path: Path) -> None:
    text = TRIANGLE + "v 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt .5 .5\nvn 0 0 1\nvn .6 0 .8\n"
    mesh = read_mesh(written(tmp_path, text + "f 1/1/1 2/2/1 3/3/1\nf 2/4/2 4/1/1 3/3/1\n"))
    assert mesh.faces.shape == (2, 3)
    # Vertex 2 appears with two UVs and two normals: it is split.
    assert len(mesh.vertices) == 5
    np.testing.assert_allclose(mesh.uv[mesh.faces[1]], [[0.5, 0.5], [0, 0], [0, 1]])
    np.testing.assert_allclose(mesh.normals[mesh.faces[1, 0]], [0.6, 0, 0.8])


def test_obj_polygons_negative_numbers_and_comments(tmp_path: Path) -> None:
    mesh = read_mesh(
        written(tmp_path, "# made by hand\n" + TRIANGLE + "v 1 1 0 1 1 1\nf -4 -3 -1 -2 # quad\n")
    )
    assert len(mesh.faces) == 2 and mesh.uv is None
    np.testing.assert_allclose(mesh.crosses.sum(axis=0), [0, 0, 2])


def test_writing_and_reading_gives_the_mesh_back(tmp_path: Path) -> None:
    source = sphere(2)
    rng = np.random.default_rng(0)
    mesh = mesh_from_arrays(source.vertices, source.faces, uv=rng.random((len(source.vertices), 2)))
    write_mesh_obj(tmp_path / "out.obj", mesh)
    again = read_mesh(tmp_path / "out.obj")
    for name in ("vertices", "normals", "uv"):
        # Ten significant digits are written.
        np.testing.assert_allclose(getattr(again, name), getattr(mesh, name), atol=1e-9)
    np.testing.assert_array_equal(again.faces, mesh.faces)


@pytest.mark.parametrize("suffix", ["ply", "obj", "glb"])
def test_formats_agree(tmp_path: Path, suffix: str) -> None:
    source = sphere(2)
    source.export(tmp_path / f"mesh.{suffix}")
    mesh = read_mesh(tmp_path / f"mesh.{suffix}")
    assert len(mesh.faces) == len(source.faces)
    # f32 in PLY and GLB, eight decimals in OBJ.
    np.testing.assert_allclose(mesh.vertices[mesh.faces], source.vertices[source.faces], atol=1e-6)
    np.testing.assert_allclose((mesh.normals * mesh.vertices).sum(axis=1), 1, atol=1e-3)


def test_glb_scene_graph_is_flattened_with_its_transforms(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    part = sphere(1)
    uv = np.random.default_rng(1).random((len(part.vertices), 2))
    part.visual = trimesh.visual.TextureVisuals(uv=uv)
    mirror = np.diag([-1.0, 2.0, 1.0, 1.0])
    mirror[:3, 3] = [5, 0, 0]
    scene.add_geometry(part, node_name="plain")
    scene.add_geometry(part, node_name="mirrored", transform=mirror)
    scene.export(tmp_path / "scene.glb")
    mesh = read_mesh(tmp_path / "scene.glb")
    assert len(mesh.faces) == 2 * len(part.faces)
    assert mesh.uv is not None
    np.testing.assert_allclose(np.sort(mesh.uv[: len(uv), 1]), np.sort(uv[:, 1]), atol=1e-6)
    right = mesh.vertices[:, 0] > 2
    np.testing.assert_allclose(mesh.vertices[right].min(axis=0)[:2], [4, -2], atol=1e-6)
    # Under the mirror, triangles and normals still look outward.
    centre = np.where(right, 5, 0)[:, None] * [1, 0, 0]
    assert ((mesh.vertices - centre) * mesh.normals).sum(axis=1).min() > 0
    middle = mesh.vertices[mesh.faces].mean(axis=1) - centre[mesh.faces[:, 0]]
    assert (mesh.crosses * middle).sum(axis=1).min() > 0


def test_shading_is_not_split_by_uv_seams() -> None:
    source = sphere(3)
    split = source.vertices[source.faces].reshape(-1, 3)
    mesh = mesh_from_arrays(split, np.arange(len(split)).reshape(-1, 3))
    # Angle-weighted normals of 1280 faces are this close to the sphere's.
    assert (mesh.normals * split).sum(axis=1).min() > 0.9999


def test_angle_weighting_does_not_depend_on_the_triangulation() -> None:
    box = trimesh.creation.box()
    mesh = mesh_from_arrays(box.vertices, box.faces)
    # Every corner of a cube, however its sides are cut, has its normal along the diagonal.
    np.testing.assert_allclose(np.abs(mesh.normals), 3**-0.5, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TRIANGLE, "has no faces"),
        (TRIANGLE + "f 1 2 4\n", "names vertex 4"),
        (TRIANGLE + "f 1 2 -9\n", "line 4"),
        ("v 0 0 nan\n" + TRIANGLE + "f 2 3 4\nf 1 2 3\n", "NaN or infinite"),
        (TRIANGLE + "f 1 2 2\n", "all 1 triangles are degenerate"),
        (TRIANGLE + "v 1 2", "fewer than 3 numbers"),
        (TRIANGLE + "v 1 2 x\nf 1 2 3\n", "could not convert"),
        (TRIANGLE + "f 1/7 2/8 3/9\n", "names texture coordinate 9"),
    ],
)
def test_bad_obj(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)


def test_missing_unknown_and_truncated_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_mesh(tmp_path / "none.obj")
    (tmp_path / "mesh.fbx").write_bytes(b"x")
    with pytest.raises(InputError, match="unknown mesh format"):
        read_mesh(tmp_path / "mesh.fbx")
    for suffix in ("ply", "glb"):
        path = tmp_path / f"mesh.{suffix}"
        sphere(2).export(path)
        path.write_bytes(path.read_bytes()[:900])
        with pytest.raises(InputError, match=str(path)):
            read_mesh(path)


def test_degenerate_triangles_are_dropped_with_a_warning(tmp_path: Path) -> None:
    path = written(tmp_path, TRIANGLE + "f 1 2 3\nf 1 2 2\n")
    with pytest.warns(CaptureWarning, match="1 of 2 triangles are degenerate"):
        mesh = read_mesh(path)
    assert len(mesh.faces) == 1


@pytest.mark.parametrize("scale", [0.01, 1000.0])
def test_tiny_and_huge_meshes_are_not_degenerate(scale: float) -> None:
    source = sphere(4)
    assert len(mesh_from_arrays(source.vertices * scale, source.faces).faces) == len(source.faces)


def test_inside_out_meshes_are_turned_over() -> None:
    source = sphere(1)
    with pytest.warns(CaptureWarning, match="wind clockwise"):
        closed = mesh_from_arrays(source.vertices, source.faces[:, ::-1])
    with pytest.warns(CaptureWarning, match="wind clockwise"):
        by_normals = mesh_from_arrays(source.vertices, source.faces[:40, ::-1], source.vertices)
    for mesh in (closed, by_normals):
        assert outward(mesh)


def outward(mesh: Mesh) -> bool:
    return bool(((mesh.crosses * mesh.vertices[mesh.faces[:, 0]]).sum(axis=1) > 0).all())

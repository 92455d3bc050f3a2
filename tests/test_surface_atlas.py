# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Rasterised texels against a point-in-triangle loop; overlaps; unwrapping; the default resolution."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

from swatchwork.capture import Camera
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.surface import (
    Mesh,
    build_atlas,
    default_resolution,
    fill_gutter,
    has_injective_uv,
    mesh_from_arrays,
    padded,
    parametrised,
    read_mesh,
    unwrap,
    uv_problem,
)
from swatchwork.surface import atlas as atlas_module
from swatchwork.surface.raster import covered_centres


def grid(cells: int, seed: int = 0) -> Mesh:
    """A square patch of jittered triangles, its UVs the patch itself within a margin: injective."""
    n = cells + 1
    y, x = np.mgrid[0:n, 0:n] / cells
    jitter = np.random.default_rng(seed).uniform(-0.3, 0.3, (2, n, n)) / cells
    inner = (x > 0) & (x < 1) & (y > 0) & (y < 1)
    uv = np.stack([x + jitter[0] * inner, y + jitter[1] * inner], axis=-1).reshape(-1, 2) * 0.9 + 0.05
    i = np.arange(cells * n).reshape(cells, n)[:, :-1].ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + n], 1), np.stack([i + 1, i + n + 1, i + n], 1)])
    vertices = np.column_stack([3 * uv[:, 0], 2 * uv[:, 1], np.zeros(len(uv))])
    return mesh_from_arrays(vertices, faces, uv=uv)


def facing_camera(distance: float, pixels: int = 200) -> Camera:
    pose = np.eye(4)
    pose[:3, 3] = [1.5, 1.0, distance]
    return Camera(pixels, pixels, pixels, pixels, pixels / 2, pixels / 2, pose)


def covered_by_loop(mesh: Mesh, resolution: int) -> dict[tuple[int, int], set[int]]:
    """The slow twin: every texel centre against every triangle; centres on edges belong to both."""
    found: dict[tuple[int, int], set[int]] = {}
    for row in range(resolution):
        for col in range(resolution):
            p = np.array([(col + 0.5) / resolution, 1 - (row + 0.5) / resolution])
            a, b, c = (mesh.uv[mesh.faces[:, i]] for i in range(3))
            side = [
                (t - s)[:, 0] * (p - s)[:, 1] - (t - s)[:, 1] * (p - s)[:, 0]
                for s, t in ((a, b), (b, c), (c, a))
            ]
            side = np.where(np.abs(side) < 1e-12, 0, side)  # rounding of centres that lie on an edge
            inside = np.flatnonzero((np.min(side, axis=0) >= 0) | (np.max(side, axis=0) <= 0))
            if len(inside):
                found[row, col] = set(inside.tolist())
    return found


@pytest.mark.parametrize(("cells", "resolution"), [(3, 40), (12, 31), (30, 24)])
def test_every_centre_in_a_triangle_is_a_texel_of_it(cells: int, resolution: int) -> None:
    mesh = grid(cells)
    atlas = build_atlas(mesh, resolution)
    expected = covered_by_loop(mesh, resolution)
    found = dict(
        zip(zip(atlas.row.tolist(), atlas.col.tolist(), strict=True), atlas.face.tolist(), strict=True)
    )
    assert found.keys() == expected.keys()
    assert all(face in expected[place] for place, face in found.items())
    np.testing.assert_array_equal(atlas.texel_at[atlas.row, atlas.col], np.arange(len(atlas)))


def test_positions_normals_and_areas() -> None:
    mesh = grid(10)
    atlas = build_atlas(mesh, 64)
    centre = np.column_stack([(atlas.col + 0.5) / 64, 1 - (atlas.row + 0.5) / 64])
    # Exact up to rounding: the patch is an affine image of its UVs.
    position, normal = atlas.points(slice(None))
    np.testing.assert_allclose(
        position, np.column_stack([3 * centre[:, 0], 2 * centre[:, 1], 0 * centre[:, 0]]), atol=1e-12
    )
    np.testing.assert_allclose(normal, np.broadcast_to([0, 0, 1], normal.shape), atol=1e-12)
    np.testing.assert_allclose(atlas.footprint(slice(None)), 6 / 64**2, rtol=1e-9)
    assert atlas.row.min() > atlas.col.min() - 5 and position[0, 1] > position[-1, 1], "row 0 is v = 1"


def test_gutter_takes_the_nearest_texel() -> None:
    atlas = build_atlas(grid(4), 32)
    near = padded(atlas)
    rows, cols = np.mgrid[0:32, 0:32].reshape(2, -1)
    away = (rows[:, None] - atlas.row) ** 2 + (cols[:, None] - atlas.col) ** 2
    chosen = away[np.arange(len(rows)), near.ravel()]
    np.testing.assert_array_equal(chosen, away.min(axis=1))
    values = np.random.default_rng(0).random((len(atlas), 3))
    image = np.full((32, 32, 3), np.nan)
    image.reshape(-1, 3)[atlas.pixel] = values
    fill_gutter(image, atlas, near)
    np.testing.assert_array_equal(image, values[near])


def test_overlaps_tiling_and_missing_uvs_are_told() -> None:
    mesh = grid(6)
    assert has_injective_uv(mesh) and uv_problem(mesh) is None
    # A mirrored texture: both halves use the same UVs.
    mirrored = Mesh(
        mesh.vertices, mesh.faces, mesh.normals, np.column_stack([np.abs(mesh.uv[:, 0] - 0.5), mesh.uv[:, 1]])
    )
    assert "used more than once" in str(uv_problem(mirrored))
    assert "outside [0, 1]" in str(uv_problem(Mesh(mesh.vertices, mesh.faces, mesh.normals, mesh.uv * 3)))
    collapsed = mesh.uv.copy()
    collapsed[mesh.faces[:9]] = 0.02
    assert "no UV area" in str(uv_problem(Mesh(mesh.vertices, mesh.faces, mesh.normals, collapsed)))
    assert "no UVs" in str(uv_problem(Mesh(mesh.vertices, mesh.faces, mesh.normals)))
    with pytest.warns(CaptureWarning, match="unwrapped anew"):
        assert has_injective_uv(parametrised(mirrored, 128))


def test_one_overlapping_triangle_in_a_thousand_is_found() -> None:
    mesh = grid(24)
    uv = np.concatenate([mesh.uv, mesh.uv[mesh.faces[100]]])
    faces = mesh.faces.copy()
    faces[900] = len(mesh.uv) + np.arange(3)
    vertices = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces[900]]])
    assert not has_injective_uv(mesh_from_arrays(vertices, faces, uv=uv))


@pytest.mark.parametrize("scale", [0.01, 1.0, 1000.0])
def test_unwrapping_is_injective_and_complete(scale: float) -> None:
    source = trimesh.creation.torus(1.0, 0.4, major_sections=24, minor_sections=12)
    mesh = mesh_from_arrays(source.vertices * scale + 7 * scale, source.faces)
    flat = unwrap(mesh, 256)
    assert uv_problem(flat) is None
    np.testing.assert_allclose(flat.vertices[flat.faces], mesh.vertices[mesh.faces])
    np.testing.assert_allclose(flat.normals[flat.faces], mesh.normals[mesh.faces])
    atlas = build_atlas(flat, 256)
    assert (atlas.texel_at >= 0).mean() > 0.3
    # Texel counts fluctuate along the charts' borders, some 2000 texels of 30,000, as their square root.
    assert atlas.footprint(slice(None)).sum() == pytest.approx(source.area * scale**2, rel=0.01)
    # All texels have about the same size: charts share one scale.
    assert np.quantile(atlas.footprint(slice(None)), 0.9) < 2 * np.quantile(atlas.footprint(slice(None)), 0.1)


def test_default_resolution_makes_a_texel_a_pixel() -> None:
    mesh = grid(8)
    # At distance 4 with f = 200 px a unit is 50 px; the UVs stretch by 3 and 2: sqrt(150 * 100) = 122.5.
    assert default_resolution(mesh, [facing_camera(4.0)]) == 128
    assert default_resolution(mesh, [facing_camera(4.0), facing_camera(1.9)]) == 320
    assert default_resolution(mesh, [facing_camera(400.0)]) == 64
    assert default_resolution(mesh, [facing_camera(-4.0)]) == 64, "nothing is seen from behind"
    bare = Mesh(mesh.vertices, mesh.faces, mesh.normals)
    # 2.7 x 1.8 units of 50 px fill 0.6 of the square: sqrt(2.7 * 1.8 * 2500 / 0.6) = 142.
    assert default_resolution(bare, [facing_camera(4.0)]) == 192


def test_bad_requests() -> None:
    mesh = grid(2)
    with pytest.raises(InputError, match="no UVs"):
        build_atlas(Mesh(mesh.vertices, mesh.faces, mesh.normals), 64)
    with pytest.raises(InputError, match="resolution is 0"):
        build_atlas(mesh, 0)
    with pytest.raises(InputError, match="no texel"):
        build_atlas(Mesh(mesh.vertices, mesh.faces, mesh.normals, mesh.uv + 5), 64)


def test_of_overlapping_faces_the_first_keeps_a_texel(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many are rasterised at a time."""
    rng = np.random.default_rng(0)
    vertices = rng.random((90, 3))
    faces = np.arange(90, dtype=np.int32).reshape(30, 3)
    mesh = Mesh(vertices, faces, np.broadcast_to([0.0, 0, 1], (90, 3)).copy(), rng.random((90, 2)))
    face, row, col = covered_centres(mesh.uv, faces, 40)
    for chunk in (7, 300, 1 << 18):
        monkeypatch.setattr(atlas_module, "CHUNK", chunk)
        atlas = build_atlas(mesh, 40)
        assert set(zip(row.tolist(), col.tolist(), strict=True)) == set(
            zip(atlas.row.tolist(), atlas.col.tolist(), strict=True)
        )
        for r, c, found in zip(atlas.row, atlas.col, atlas.face, strict=True):
            assert found == face[(row == r) & (col == c)].min()


def test_points_of_some_texels_are_those_of_all() -> None:
    atlas = build_atlas(grid(6), 64)
    position, normal = atlas.points(slice(None))
    some = np.arange(3, len(atlas), 17)
    np.testing.assert_array_equal(atlas.position(some), position[some])
    np.testing.assert_array_equal(atlas.normal(some), normal[some])


def test_atlas_of_a_scan_is_quick_and_covers_what_the_truth_covers(shared: Path) -> None:
    mesh = read_mesh(shared / "captures/igea-merl/mesh.obj")
    covered = np.load(shared / "captures/igea-merl/truth/weights.npz")["covered"]
    start = time.process_time()
    atlas = build_atlas(mesh, len(covered))
    # 30,000 triangles at 1024 x 1024 take half a second; ten times that would be a loop over triangles.
    assert time.process_time() - start < 5
    # The renderer's own rasteriser decides centres on edges otherwise.
    assert ((atlas.texel_at >= 0) != covered).sum() < 20

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Rays against a brute-force twin, horizons and skies against geometry that has a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from swatchwork.arrays import F64, Bool, unit
from swatchwork.capture import Camera
from swatchwork.octahedral import pixel_directions, square_from_direction
from swatchwork.surface import Atlas, Mesh, RayScene, SkyMasks, mesh_from_arrays, sees, sky, sky_masks


def mesh_of(source: trimesh.Trimesh, scale: float = 1.0, shift: float = 0.0) -> Mesh:
    return mesh_from_arrays(source.vertices * scale + shift, source.faces)


def moller_trumbore(mesh: Mesh, origin: F64, direction: F64) -> tuple[F64, np.ndarray, F64]:
    """The slow twin: nearest hit of each ray by testing every triangle; t, face and barycentrics."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    e1, e2 = b - a, c - a
    p = np.cross(direction[:, None], e2)
    determinant = (e1 * p).sum(-1)
    s = origin[:, None] - a
    u = (s * p).sum(-1) / determinant
    q = np.cross(s, e1)
    v = (direction[:, None] * q).sum(-1) / determinant
    t = (e2 * q).sum(-1) / determinant
    t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
    face = t.argmin(axis=1)
    row = np.arange(len(t))
    u, v = u[row, face], v[row, face]
    return t[row, face], face, np.stack([1 - u - v, u, v], axis=1)


def camera_at(position: F64, focal: float = 100.0, pixels: int = 200, **lens: float) -> Camera:
    """A camera that looks at the origin."""
    back = unit(np.asarray(position, dtype=float))
    right = unit(np.cross([0.3, 1.0, 0.2], back))
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
    pose[:3, 3] = position
    return Camera(pixels, pixels, focal, focal, pixels / 2, pixels / 2, pose, **lens)


def open_box(depth: float) -> Mesh:
    """The inside of a square well, [-1, 1]^2 wide, from z = 0 up to z = depth; open at the top."""
    box = trimesh.creation.box((2, 2, depth))
    box.apply_translation([0, 0, depth / 2])
    box = box.subdivide().subdivide()
    keep = box.triangles_center[:, 2] < depth - 1e-9
    return mesh_from_arrays(box.vertices, box.faces[keep][:, ::-1], -box.vertices + [0, 0, depth / 2])


def bits(words: np.ndarray) -> Bool:
    """U64[Q, 64] to Bool[Q, row, column], by the definition."""
    return ((words[:, :, None] >> np.arange(64, dtype=np.uint64)) & np.uint64(1)).astype(bool)


def centres(mesh: Mesh) -> Atlas:
    """An atlas whose texels are the middles of the triangles."""
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(mesh.crosses, axis=1) / 2
    atlas = points(corners.mean(axis=1), unit(mesh.crosses))
    smooth = replace(atlas.mesh, normals=unit(mesh.normals[mesh.faces].sum(axis=1)))
    return replace(atlas, mesh=smooth, face_footprint=area)


def points(position: F64, normal: F64) -> Atlas:
    """An atlas of given points, one row of texels; each is a face of its own without extent."""
    count = len(position)
    number = np.arange(count, dtype=np.int32)
    normal = np.broadcast_to(normal, position.shape).astype(float)
    mesh = Mesh(position, np.repeat(number[:, None], 3, axis=1), normal, np.zeros((count, 2)))
    return Atlas(count, mesh, number, number, normal, np.ones(count))


@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (0.01, 0.5), (1000.0, 4e4)])
def test_hits_equal_brute_force(scale: float, shift: float) -> None:
    mesh = mesh_of(trimesh.creation.torus(1.0, 0.4, major_sections=20, minor_sections=10), scale, shift)
    rng = np.random.default_rng(2)
    origin = unit(rng.normal(size=(3000, 3))) * 3 * scale + shift
    direction = unit(rng.uniform(-1, 1, (3000, 3)) * scale + shift - origin)
    t, face, bary = moller_trumbore(mesh, origin, direction)
    scene = RayScene([mesh])
    hit = scene.first_hit(origin, direction)
    np.testing.assert_array_equal(hit.mesh, np.where(np.isfinite(t), 0, -1))
    there = hit.mesh == 0
    assert 0.3 < there.mean() < 0.9
    # f32 on the unit ball, rays 3 radii long: a few ulp of 3.
    np.testing.assert_allclose(hit.t[there], t[there], rtol=3e-6)
    same = there & (hit.face == face)
    assert same.sum() > 0.999 * there.sum(), "only rays through an edge may name the other triangle"
    np.testing.assert_allclose(hit.bary[same], bary[same], atol=2e-4)
    np.testing.assert_array_equal(scene.occluded(origin, direction), there)
    limited = scene.occluded(origin, direction, np.where(there, t * 0.999, np.inf))
    assert not limited.any()
    assert scene.occluded(origin, direction, np.where(there, t * 1.001, 0.0))[there].all()


def test_rays_at_edges_and_vertices_do_not_slip_through() -> None:
    mesh = mesh_of(trimesh.creation.icosphere(4))
    target = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1) * 0.5])
    edges = mesh.vertices[mesh.faces][:, :2].mean(axis=1)
    target = np.concatenate([target, edges])
    origin = np.broadcast_to([0.1, 0.2, 0.3], target.shape)
    missed = ~RayScene([mesh]).occluded(origin, target - origin)
    # Design 8 measured 0.4 % in robust mode.
    assert missed.mean() < 0.005


@pytest.mark.parametrize("scale", [0.01, 1.0, 1000.0])
def test_a_sphere_is_seen_up_to_its_horizon(scale: float) -> None:
    mesh = mesh_of(trimesh.creation.icosphere(5), scale)
    atlas = centres(mesh)
    camera = camera_at(np.array([1.0, 2.0, 2.0]) * scale, focal=90)
    seen = sees(RayScene([mesh]), atlas, camera)
    to_camera = unit(camera.position - atlas.position(slice(None)))
    cosine = (atlas.position(slice(None)) / scale * to_camera).sum(axis=1)
    # 20,480 facets lean by up to 1.2 degrees against the sphere, which only matters near the horizon.
    assert seen[cosine > 0.06].all()
    assert not seen[cosine < 0.02].any()


def test_what_leaves_the_image_is_not_seen() -> None:
    mesh = mesh_of(trimesh.creation.icosphere(4))
    atlas = centres(mesh)
    camera = camera_at(np.array([0.0, 0.0, 3.0]), focal=600)
    seen = sees(RayScene([mesh]), atlas, camera)
    # The image is 2 / 600 * 100 / 2 = a sixth of a unit to each side at unit depth; a third at depth 2.
    inside = np.abs(camera.project(atlas.position(slice(None)))[0] - 100).max(axis=1) < 100
    assert seen.any() and not seen[~inside].any()
    barrel = camera_at(np.array([0.0, 0.0, 3.0]), focal=600, k1=-0.9)
    assert sees(RayScene([mesh]), atlas, barrel).sum() > seen.sum(), "a barrel lens shows more"


def test_occluders_block_sight_and_sky() -> None:
    mesh = mesh_of(trimesh.creation.icosphere(4))
    atlas = centres(mesh)
    plate = trimesh.creation.box((8, 8, 0.1))
    plate.apply_translation([0, 0, 1.5])
    scene = RayScene([mesh, mesh_of(plate)])
    assert not sees(scene, atlas, camera_at(np.array([0.0, 0.0, 5.0]))).any()
    assert sees(scene, atlas, camera_at(np.array([0.0, 0.0, -5.0]))).any()
    masks = sky_masks(scene, atlas, samples=1000)
    top = int(np.argmax(atlas.normal(slice(None))[:, 2]))
    up = pixel_directions(64)[..., 2]
    visible = bits(masks.words[masks.of_texel[[top]]])[0]
    assert not visible[up > 0.2].any()
    assert (masks.of_texel[atlas.normal(slice(None))[:, 2] < -0.999] == -1).all()


def test_a_convex_object_needs_no_masks() -> None:
    mesh = mesh_of(trimesh.creation.icosphere(4))
    masks = sky_masks(RayScene([mesh]), centres(mesh), samples=1000)
    assert masks.words.shape == (0, 64) and masks.words.dtype == np.uint64
    assert (masks.of_texel == -1).all()


@pytest.mark.parametrize("depth", [0.5, 1.0, 3.0])
def test_sky_at_the_bottom_of_a_well(depth: float) -> None:
    where = np.array([[0.0, 0.0, 0.0], [0.5, -0.3, 0.0]])
    atlas = points(where, np.array([0.0, 0.0, 1.0]))
    masks = sky_masks(RayScene([open_box(depth)]), atlas)
    direction = pixel_directions(64)
    for x, row in zip(where, bits(masks.words[masks.of_texel]), strict=True):
        with np.errstate(divide="ignore"):
            rim = x[:2] + direction[..., :2] * (depth / direction[..., 2:])
        free = (direction[..., 2] > 0) & (np.abs(rim) < 1).all(axis=-1)
        above = direction[..., 2] > 0.02
        edge = np.abs(np.abs(rim).max(axis=-1) - 1) < 1e-3
        np.testing.assert_array_equal(row[above & ~edge], free[above & ~edge])


def test_bits_lie_where_the_mapping_says() -> None:
    mesh = open_box(50.0)
    masks = sky_masks(RayScene([mesh]), points(np.array([[0.2, 0.1, 25.0]]), np.array([0.0, 0.0, 1.0])))
    row, column = np.nonzero(bits(masks.words)[0] & (pixel_directions(64)[..., 2] > 0))
    # The only way out is straight up.
    place = (square_from_direction(np.array([0.0, 0.0, 1.0])) * 64).astype(int)
    assert (np.abs(row - place[1] + 0.5) < 3).all() and (np.abs(column - place[0] + 0.5) < 3).all()
    assert len(row) > 0


def every_cell(scene: RayScene, atlas: Atlas, monkeypatch: pytest.MonkeyPatch) -> SkyMasks:
    """Masks of all texels, traced in every cell."""
    with monkeypatch.context() as patch:
        patch.setattr(sky, "FIRST_LEVEL", len(atlas))
        return sky_masks(scene, atlas, len(atlas))


def test_finer_levels_see_what_tracing_every_cell_sees(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = mesh_of(trimesh.creation.torus(1.0, 0.4, major_sections=72, minor_sections=36))
    atlas, scene = centres(mesh), RayScene([mesh])
    whole = every_cell(scene, atlas, monkeypatch)
    monkeypatch.setattr(sky, "FIRST_LEVEL", 300)
    found = sky_masks(scene, atlas, len(atlas))
    shadowed = (whole.of_texel >= 0) & (found.of_texel >= 0)
    assert shadowed.mean() > 0.3 and ((whole.of_texel >= 0) == (found.of_texel >= 0)).mean() > 0.99
    a, b = (bits(masks.words[masks.of_texel[shadowed]]) for masks in (whole, found))
    # A part of an edge that falls between all six neighbours is missed.
    assert 0 < (a != b).mean() < 0.002


def test_samples_of_a_thinned_atlas_lie_as_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    """A large atlas chooses among every so many-th of its texels; the widest gap hardly grows."""
    mesh = mesh_of(trimesh.creation.icosphere(subdivisions=5))
    atlas = centres(mesh)
    gaps = []
    for candidates in (1 << 20, 8):
        monkeypatch.setattr(sky, "CANDIDATES", candidates)
        chosen = sky._spread_samples(atlas, 200)
        assert len(np.unique(chosen)) == len(chosen) > 190
        near = (atlas.position(slice(None)) @ atlas.position(chosen).T).max(axis=1)
        gaps.append(np.arccos(np.minimum(near, 1)).max())
    assert gaps[1] < 1.3 * gaps[0]


def test_sharing_masks_changes_irradiance_little(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = mesh_of(trimesh.creation.torus(1.0, 0.4, major_sections=72, minor_sections=36))
    atlas, scene = centres(mesh), RayScene([mesh])
    whole = every_cell(scene, atlas, monkeypatch)
    direction = pixel_directions(64).reshape(-1, 3)
    chosen = np.random.default_rng(3).choice(len(atlas), 400, replace=False)
    cosine = np.maximum(atlas.normal(chosen) @ direction.T, 0)
    found = []
    for masks in (sky_masks(scene, atlas, 1000), whole):
        words = np.concatenate([masks.words, np.full((1, 64), 2**64 - 1, np.uint64)])
        found.append((cosine * bits(words[masks.of_texel[chosen]]).reshape(len(chosen), -1)).sum(axis=1))
    error = np.sqrt(((found[0] - found[1]) ** 2).sum() / (found[1] ** 2).sum())
    # Without masks it would be 12 %; a sample's neighbourhood is 0.13 units wide here.
    assert error < 0.02

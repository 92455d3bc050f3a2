# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs of a known function of position, observed: the sample must be that function at the texel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from swatchwork.arrays import F64, unit
from swatchwork.capture import Camera, Capture, Frame, Photograph, read_capture
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.observe import observe
from swatchwork.observe.observations import SeenPairs
from swatchwork.surface import Atlas, Mesh, RayScene, build_atlas, mesh_from_arrays, read_mesh, sees

OCCLUDER = 100.0
"""What occluders show: nothing else in these scenes is brighter than 10."""

Shading = Callable[[F64], F64]


def ball(centre: tuple[float, float, float], radius: float, left: float) -> Mesh:
    """A UV sphere in half of the UV square: u in [left, left + 0.48]."""
    v, u = np.mgrid[0:33, 0:65] / np.array([32.0, 64.0])[:, None, None]
    theta, phi = np.pi * v, 2 * np.pi * u
    normal = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(
        -1, 3
    )
    i = (np.arange(32)[:, None] * 65 + np.arange(64)).ravel()
    low = np.stack([i, i + 65, i + 66], 1)[64 * 0 : 64 * 31]
    high = np.stack([i, i + 66, i + 1], 1)[64:]
    uv = np.stack([left + 0.01 + 0.48 * u.ravel(), 1 - v.ravel()], 1)
    return mesh_from_arrays(normal * radius + centre, np.concatenate([low, high]), normal, uv)


def both(one: Mesh, two: Mesh) -> Mesh:
    assert one.uv is not None and two.uv is not None
    return Mesh(
        np.concatenate([one.vertices, two.vertices]),
        np.concatenate([one.faces, two.faces + np.int32(len(one.vertices))]),
        np.concatenate([one.normals, two.normals]),
        np.concatenate([one.uv, two.uv]),
    )


def camera_at(
    position: tuple[float, float, float], focal: float = 260.0, pixels: int = 160, **lens: float
) -> Camera:
    """A camera that looks at the origin."""
    back = unit(np.array(position))
    right = unit(np.cross([0.1, 0.2, 1.0], back))
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
    pose[:3, 3] = position
    return Camera(pixels, pixels, focal, focal, pixels / 2, pixels / 2, pose, **lens)


def capture_of(*cameras: Camera, mask: Path | None = None) -> Capture:
    frames = tuple(
        Frame(f"images/{i}.exr", Path(f"{i}.exr"), mask, 1.0, camera, None)
        for i, camera in enumerate(cameras)
    )
    return Capture(Path("."), Path("transforms.json"), None, (), None, frames)


def photograph(scene: RayScene, camera: Camera, shading: Shading, *, alpha: bool = True) -> Photograph:
    """Box-filtered from 6 x 6 rays a pixel: premultiplied, coverage exact to 1/36."""
    n = 6
    pixels = camera.pixel_centres()
    total, cover = np.zeros((len(pixels), 3)), np.zeros(len(pixels))
    offset = (np.arange(n) + 0.5) / n - 0.5
    for dx in offset:
        for dy in offset:
            d = camera.rays(pixels + np.array([dx, dy]))
            hit = scene.first_hit(np.broadcast_to(camera.position, d.shape), d)
            there = np.flatnonzero(hit.mesh >= 0)
            mine = (hit.mesh[there] == 0)[:, None]
            total[there] += np.where(mine, shading(camera.position + hit.t[there, None] * d[there]), OCCLUDER)
            cover[there] += 1
    shape = (camera.height, camera.width)
    whole = cover / n**2 if alpha else np.ones(len(pixels))
    return Photograph(
        (total / n**2).reshape(*shape, 3).astype(np.float32),
        whole.reshape(shape).astype(np.float32),
        np.ones(shape, dtype=bool),
    )


def smooth(x: F64) -> F64:
    return 1 + 0.5 * np.sin(2 * x)


def observed(
    scene: RayScene, atlas: Atlas, camera: Camera, shading: Shading, *, alpha: bool = True
) -> SeenPairs:
    return observe(
        capture_of(camera), atlas, scene, read=lambda _: photograph(scene, camera, shading, alpha=alpha)
    ).pairs(np.arange(len(atlas)))


@pytest.mark.parametrize("lens", [{}, {"k1": -0.15, "k2": 0.05, "p1": 0.01, "p2": -0.01}])
@pytest.mark.parametrize("scale", [0.01, 1.0, 1000.0])
def test_samples_are_the_surface_at_the_texel(scale: float, lens: dict[str, float]) -> None:
    mesh = ball((0, 0, 0), scale, 0.0)
    atlas, scene = build_atlas(mesh, 128), RayScene([mesh])
    camera = camera_at((2 * scale, 3 * scale, scale), **lens)
    found = observed(scene, atlas, camera, lambda x: smooth(x / scale))
    truth = smooth(atlas.position(found.texel) / scale)
    error = np.abs(found.radiance / truth - 1).max(axis=1)
    # A pixel is 1/70 of the radius: bilinear interpolation of `smooth` is then good to a few 1e-4.
    assert error[found.cosine > 0.5].max() < 2e-3
    # At the rim a pixel spans 1/70 / cosine of surface, over which `smooth` changes by up to its slope, 1.
    assert (error * found.cosine).max() < 0.02
    visible = sees(scene, atlas, camera)
    assert len(found) > 0.97 * visible.sum() and visible[found.texel].all()
    assert found.cosine.min() >= 0.03 and (found.cosine < 0.1).sum() > 20, "rims count"


def test_nothing_crosses_a_depth_discontinuity() -> None:
    """A small ball before a big one, of 1 and 10 each: any mixture at all would show."""
    mesh = both(ball((0, 0, 0), 1.0, 0.0), ball((1.6, 0.3, 0.1), 0.35, 0.5))
    bar = trimesh.creation.box((0.05, 0.05, 6))
    bar.apply_translation([2.2, -0.3, 0])
    scene = RayScene([mesh, mesh_from_arrays(bar.vertices, bar.faces)])
    atlas = build_atlas(mesh, 128)

    def shading(x: F64) -> F64:
        return np.where(np.linalg.norm(x, axis=1, keepdims=True) < 1.01, 1.0, 10.0) * np.ones(3)

    for position in ((5.0, 0.0, 0.0), (4.0, 2.0, 1.0), (3.5, -3.0, 0.5)):
        camera = camera_at(position, focal=300)
        found = observed(scene, atlas, camera, shading)
        truth = shading(atlas.position(found.texel))
        assert (truth == 1).any() and (truth == 10).any()
        # f32 sums of 36 samples, nothing else.
        np.testing.assert_allclose(found.radiance, truth, rtol=1e-5)
        # Lost: a pixel or two along each outline, of a ball 50 pixels wide and a bar across it.
        assert len(found) > 0.8 * sees(scene, atlas, camera).sum()


def test_without_alpha_background_does_not_leak() -> None:
    mesh = ball((0, 0, 0), 1.0, 0.0)
    scene, atlas = RayScene([mesh]), build_atlas(mesh, 128)
    camera = camera_at((4.0, 0.0, 0.0))
    found = observed(scene, atlas, camera, np.ones_like, alpha=False)
    np.testing.assert_allclose(found.radiance, 1.0, rtol=1e-5)
    # The last pixel before the outline is lost: cosines up to 0.2 of a ball 130 pixels wide.
    assert len(found) > 0.8 * sees(scene, atlas, camera).sum()


def test_clipped_and_masked_pixels_are_missing() -> None:
    mesh = ball((0, 0, 0), 1.0, 0.0)
    scene, atlas = RayScene([mesh]), build_atlas(mesh, 128)
    camera = camera_at((4.0, 0.0, 0.0))
    picture = photograph(scene, camera, np.ones_like)
    picture.valid[60:80, 70:90] = False
    picture.radiance[60:80, 70:90] = 77.0
    found = observe(capture_of(camera), atlas, scene, read=lambda _: picture).pairs(np.arange(len(atlas)))
    np.testing.assert_allclose(found.radiance, 1.0, rtol=1e-5)
    uv_px, _ = camera.project(atlas.position(found.texel))
    inside = (uv_px > (70, 60)).all(axis=1) & (uv_px < (90, 80)).all(axis=1)
    assert not inside.any()


def test_pairs_are_sorted_by_texel_then_frame() -> None:
    mesh = ball((0, 0, 0), 1.0, 0.0)
    scene, atlas = RayScene([mesh]), build_atlas(mesh, 64)
    cameras = [camera_at(p) for p in ((4.0, 0.0, 0.0), (3.0, 3.0, 0.0), (3.0, 0.0, 3.0))]
    pictures = {f"images/{i}.exr": photograph(scene, c, smooth) for i, c in enumerate(cameras)}
    observations = observe(capture_of(*cameras), atlas, scene, read=lambda frame: pictures[frame.name])
    found, coverage = observations.pairs(np.arange(len(atlas))), observations.coverage
    order = found.texel.astype(np.int64) * 3 + found.frame
    assert (np.diff(order) > 0).all()
    np.testing.assert_array_equal(np.diff(found.offsets), coverage)
    np.testing.assert_array_equal(np.repeat(np.arange(len(atlas)), coverage), found.texel)
    assert found.offsets[-1] == len(found) == len(observations)
    assert (coverage == 0).any() and coverage.max() == 3
    seen_from = np.stack([c.position for c in cameras])[found.frame]
    np.testing.assert_allclose(found.to_viewer, unit(seen_from - atlas.position(found.texel)), atol=1e-6)
    np.testing.assert_allclose(
        found.cosine, (found.to_viewer * atlas.normal(found.texel)).sum(axis=1), atol=1e-6
    )
    alone = observe(capture_of(cameras[1]), atlas, scene, read=lambda _: pictures["images/1.exr"])
    middle = alone.pairs(np.arange(len(atlas)))
    np.testing.assert_array_equal(middle.radiance, found.radiance[found.frame == 1])
    # Any texels, from anywhere in the atlas: the same rows.
    some = np.flatnonzero(np.random.default_rng(3).random(len(atlas)) < 0.1)
    few = observations.pairs(some)
    same = np.isin(found.texel, some)
    for name in ("texel", "frame", "radiance", "to_viewer", "cosine"):
        np.testing.assert_array_equal(getattr(few, name), getattr(found, name)[same])
    np.testing.assert_array_equal(np.diff(few.offsets), coverage[some])
    assert len(observations.pairs(np.zeros(0, np.int64))) == 0


def test_a_frame_that_shows_nothing_is_named() -> None:
    mesh = ball((0, 0, 0), 1.0, 0.0)
    scene, atlas = RayScene([mesh]), build_atlas(mesh, 64)
    good = camera_at((4.0, 0.0, 0.0))
    pose = good.world_from_camera @ np.diag([-1.0, 1.0, -1.0, 1.0])
    away = replace(good, world_from_camera=pose)
    picture = photograph(scene, good, smooth)
    with pytest.raises(InputError, match=r"transforms.json: frame images/1.exr: no texel is visible"):
        observe(capture_of(good, away), atlas, scene, read=lambda _: picture)
    dark = replace(picture, valid=np.zeros_like(picture.valid))
    with pytest.raises(InputError, match="visible texels lies on valid pixels"):
        observe(capture_of(good), atlas, scene, read=lambda _: dark)
    with pytest.raises(InputError, match="no frames"):
        observe(capture_of(), atlas, scene)


def test_a_silhouette_that_disagrees_is_warned_of() -> None:
    mesh = ball((0, 0, 0), 1.0, 0.0)
    scene, atlas = RayScene([mesh]), build_atlas(mesh, 64)
    camera, beside = camera_at((4.0, 0.0, 0.0)), camera_at((4.0, 0.0, 0.0), focal=230)
    picture = photograph(scene, beside, smooth)
    with pytest.warns(CaptureWarning, match=r"images/0.exr.*overlap by 0\.7"):
        observe(capture_of(camera), atlas, scene, read=lambda _: picture)
    shown = picture.alpha > 0.5
    mask = replace(picture, valid=shown, mask=shown, alpha=np.ones_like(picture.alpha))
    with pytest.warns(CaptureWarning, match="silhouette"):
        observe(capture_of(camera, mask=Path("mask.png")), atlas, scene, read=lambda _: mask)


def test_clipped_highlights_are_no_disagreement_of_silhouettes() -> None:
    mesh = ball((0, 0, 0), 1.0, 0.0)
    scene, atlas, camera = RayScene([mesh]), build_atlas(mesh, 64), camera_at((4.0, 0.0, 0.0))
    picture = photograph(scene, camera, smooth)
    shown = picture.alpha > 0.5
    unclipped = shown.copy()
    unclipped[60:100, 60:100] = False
    clipped = replace(picture, valid=unclipped, mask=shown, alpha=np.ones_like(picture.alpha))
    # A CaptureWarning would be an error here.
    observe(capture_of(camera, mask=Path("mask.png")), atlas, scene, read=lambda _: clipped)


def test_a_rendered_capture_is_registered(shared: Path) -> None:
    """Real input: the true blend pattern predicts what neighbours share; a flip or a slip would blur it."""
    folder = shared / "captures/sphere-merl"
    capture = read_capture(folder).first(4)
    assert capture.mesh_path is not None
    mesh = read_mesh(capture.mesh_path)
    atlas = build_atlas(mesh, 256)
    found = observe(capture, atlas, RayScene([mesh])).pairs(np.arange(len(atlas)))
    assert found.radiance.min() >= 0 and found.cosine.min() >= 0.03
    truth = np.load(folder / "truth/weights.npz")
    scale = len(truth["covered"]) // 256
    index, weight = (
        truth[name][scale // 2 :: scale, scale // 2 :: scale] for name in ("index", "weight_255")
    )
    blend = np.zeros((256, 256, len(truth["materials"])))
    for slot in range(index.shape[2]):
        np.put_along_axis(
            blend, index[..., slot : slot + 1].astype(int), weight[..., slot : slot + 1] / 255.0, axis=2
        )

    def unexplained(pattern: F64) -> float:
        """Share of the radiance's variance left by a fit, in each patch of normals, to the blend weights."""
        x = pattern[atlas.row[found.texel], atlas.col[found.texel]]
        normal = atlas.normal(found.texel)
        patch = found.frame * 4096 + np.floor((normal + 1) * 7.99).astype(int) @ np.array([256, 16, 1])
        left = total = 0.0
        for number in np.unique(patch[found.cosine > 0.3]):
            rows = np.flatnonzero((patch == number) & (found.cosine > 0.3))
            if len(rows) > 100:
                y = np.log(found.radiance[rows] + 1e-3)
                fit = np.linalg.lstsq(x[rows], y, rcond=None)[0]
                left += float(((y - x[rows] @ fit) ** 2).sum())
                total += float(((y - y.mean(axis=0)) ** 2).sum())
        return left / total

    right = unexplained(blend)
    # Measured: 0.19; flips 0.54 and 0.64; a slip by four texels 0.29. The rest is the light within a patch.
    assert right < 0.5 * unexplained(blend[:, ::-1]) and right < 0.5 * unexplained(blend[::-1])
    assert right < 0.8 * unexplained(np.roll(blend, 4, axis=1))

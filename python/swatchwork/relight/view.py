# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a camera sees of the object: samples inside each pixel, more of them at edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..arrays import F32, F64, I32, I64, Bool, unit
from ..capture import Camera
from ..surface import Mesh, RayScene

RAYS_AT_ONCE = 1 << 20
INNER_RAYS = 2
"""Rays along the side of a cell inside the object: its normals and blends are averaged."""
EDGE_RAYS = 4
"""Rays along the side of a cell at an edge, where they measure coverage too."""


SPREAD_RAD = 0.017
"""Cells whose normals spread more than this (one degree) are shaded in quarters."""


@dataclass(frozen=True, eq=False)
class View:
    """What a camera's pixels show of the object; it serves every light.

    A pixel is cut into square cells. All rays of a cell that hit share one shading, which is dear, of their
    mean normal and blend, which are cheap.
    """

    camera: Camera
    pixel: I64
    """[G] number of each cell's pixel, row by row."""
    share: F32
    """[G] part of the pixel that the cell's hits stand for."""
    offsets: I64
    """[G + 1]: the hits of cell g are offsets[g] : offsets[g + 1]."""
    face: I32
    """[S] face of each hit."""
    bary: F64
    """[S, 3] where on it."""
    samples: int
    """What `see` was asked for."""

    @property
    def alpha(self) -> F32:
        """Coverage [H, W] in [0, 1]."""
        size = self.camera.width * self.camera.height
        found = np.bincount(self.pixel, self.share, minlength=size)
        return found.reshape(self.camera.height, self.camera.width).astype(np.float32)


def see(rays: RayScene, camera: Camera, samples: int = 2) -> View:
    """Cast rays in a regular grid, so that a pixel is a box and the same view gives the same image.

    Pixels that are mixed, or next to one, have samples x samples cells of 4 x 4 rays; the others half as
    many along a side (rounded up) of 2 x 2 rays. Cells where the surface bends are split.
    """
    mesh = rays.meshes[0]
    pixels = _box(mesh, camera)
    inner = -(-samples // 2)
    hits = _cast(rays, camera, pixels, inner * INNER_RAYS)
    mixed = _mixed(hits, pixels, camera)
    edge = pixels[mixed]
    plain = _cells(mesh, hits, pixels, (inner, INNER_RAYS), ~mixed)
    fine = _cast(rays, camera, edge, samples * EDGE_RAYS)
    refined = _cells(mesh, fine, edge, (samples, EDGE_RAYS), np.ones(len(edge), bool))
    pixel, share, count, face, bary = (np.concatenate([a, b]) for a, b in zip(plain, refined, strict=True))
    offsets = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    return View(camera, pixel, share, offsets, face, bary, samples)


def closer(rays: RayScene, view: View, pixels: I64) -> View:
    """Some pixels (row by row, rising) of a view by as many rays as its edges have, in cells of 2 x 2.

    A pixel has 2 samples x 2 samples cells, and more where the surface bends. Inside the object these rays
    may see less of it than the view's few did (a crack, a wire before it): its coverage is the better one.
    """
    cells = view.samples * EDGE_RAYS // INNER_RAYS
    hits = _cast(rays, view.camera, pixels, cells * INNER_RAYS)
    found = _cells(rays.meshes[0], hits, pixels, (cells, INNER_RAYS), np.ones(len(pixels), bool))
    pixel, share, count, face, bary = found
    offsets = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    return View(view.camera, pixel, share, offsets, face, bary, view.samples)


def cosine_map(rays: RayScene, camera: Camera) -> F32:
    """n.o [H, W] of the shading normal at each pixel's centre; NaN off the object."""
    pixels = _box(rays.meshes[0], camera)
    mesh, face, bary = _cast(rays, camera, pixels, 1)
    on = np.flatnonzero(mesh[:, 0] == 0)
    _, normal, to_viewer = surface_at(rays.meshes[0], camera, face[on, 0], bary[on, 0])
    found = np.full(camera.width * camera.height, np.nan, np.float32)
    found[pixels[on]] = np.einsum("sx,sx->s", normal, to_viewer)
    return found.reshape(camera.height, camera.width)


def surface_at(mesh: Mesh, camera: Camera, face: I32, bary: F64) -> tuple[F64, F64, F64]:
    """Positions, unit shading normals and unit directions to the camera [S, 3] of points on the mesh."""
    corners = mesh.faces[face]
    position = np.einsum("sc,scx->sx", bary, mesh.vertices[corners])
    normal = unit(np.einsum("sc,scx->sx", bary, mesh.normals[corners]))
    return position, normal, unit(camera.position - position)


Hits = tuple[I32, I32, F64]
"""mesh [Q, s * s], face [Q, s * s], barycentric coordinates [Q, s * s, 3] of Q pixels' subsamples."""


def _box(mesh: Mesh, camera: Camera) -> I64:
    """Pixels inside the box around the projected mesh; all where part of it lies behind the camera."""
    uv, depth = camera.project(mesh.vertices)
    low, high = np.zeros(2), np.array([camera.width, camera.height], np.float64)
    if (depth > 0).all() and np.isfinite(uv).all():
        # Lens distortion may bulge an edge beyond its ends: a margin of 5 % and two pixels.
        margin = 2 + 0.05 * (uv.max(axis=0) - uv.min(axis=0))
        low = np.clip(np.floor(uv.min(axis=0) - margin), 0, high)
        high = np.clip(np.ceil(uv.max(axis=0) + margin), low, high)
    rows, cols = np.arange(int(low[1]), int(high[1])), np.arange(int(low[0]), int(high[0]))
    return np.asarray((rows[:, None] * camera.width + cols).ravel(), dtype=np.int64)


def _cast(rays: RayScene, camera: Camera, pixels: I64, samples: int) -> Hits:
    offset = (np.arange(samples) + 0.5) / samples
    grid = np.stack(np.meshgrid(offset, offset), axis=-1).reshape(-1, 2)
    count = len(grid)
    mesh = np.empty((len(pixels), count), np.int32)
    face = np.empty((len(pixels), count), np.int32)
    bary = np.empty((len(pixels), count, 3))
    step = max(1, RAYS_AT_ONCE // count)
    for start in range(0, len(pixels), step):
        part = slice(start, start + step)
        corner = np.stack([pixels[part] % camera.width, pixels[part] // camera.width], axis=-1)
        direction = camera.rays((corner[:, None] + grid).reshape(-1, 2))
        hit = rays.first_hit(np.broadcast_to(camera.position, direction.shape), direction)
        mesh[part] = hit.mesh.reshape(-1, count)
        face[part] = hit.face.reshape(-1, count)
        bary[part] = hit.bary.reshape(-1, count, 3)
    return mesh, face, bary


def _mixed(hits: Hits, pixels: I64, camera: Camera) -> Bool:
    """Pixels whose rays, or whose neighbours', do not all see the same mesh, or all nothing."""
    if not len(pixels):
        return np.zeros(0, bool)
    width = int((pixels % camera.width).max() - pixels[0] % camera.width) + 1
    low, high = (f(hits[0], axis=1).reshape(-1, width) for f in (np.min, np.max))
    near_low, near_high = ndimage.minimum_filter(low, 3), ndimage.maximum_filter(high, 3)
    return np.asarray((near_low != near_high).ravel(), dtype=np.bool_)


def _cells(
    mesh: Mesh, hits: Hits, pixels: I64, layout: tuple[int, int], of: Bool
) -> tuple[I64, F32, I64, I32, F64]:
    """Pixel, share and number of hits of each cell that was hit; face and place of the hits, cell by cell.

    ``layout`` is cells along a pixel's side and rays along a cell's. A cell whose normals differ (a rim, an
    edge, two surfaces) falls into quarters.
    """
    cells, per_side = layout
    line = np.arange(cells * per_side)
    quarter = (line[:, None] // (per_side // 2) % 2 * 2 + line // (per_side // 2) % 2).ravel()
    cell = (line[:, None] // per_side * cells + line // per_side).ravel()
    row, ray = np.nonzero((hits[0] == 0) & of[:, None])
    key = 4 * (row * cells**2 + cell[ray]) + quarter[ray]
    order = np.argsort(key, kind="stable")
    row, ray, key = row[order], ray[order], key[order]
    face, bary = hits[1][row, ray], hits[2][row, ray]
    if not len(key):
        return pixels[row], np.zeros(0, np.float32), np.zeros(0, np.int64), face, bary

    _, first, whole, count = np.unique(key // 4, return_index=True, return_inverse=True, return_counts=True)
    normal = unit(np.einsum("sc,scx->sx", bary, mesh.normals[mesh.faces[face]]))
    mean = np.linalg.norm(np.add.reduceat(normal, first), axis=1) / count
    _, quarters = np.unique(key, return_index=True)
    # Unit vectors spread by an angle t (root mean square) have a mean of length 1 - t^2 / 2.
    split = (mean < 1 - SPREAD_RAD**2 / 2)[whole[quarters]]
    starts = np.union1d(first, quarters[split])
    count = np.diff(np.append(starts, len(key)))
    share = (count / (cells * per_side) ** 2).astype(np.float32)
    return pixels[row[starts]], share, count.astype(np.int64), face, bary

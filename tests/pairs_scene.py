# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A made-up object, a photograph of it by a known camera with a bent lens, and the page's server."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture import Camera, write_exr
from swatchwork.relight.view import cosine_map
from swatchwork.simulate.shapes import shape
from swatchwork.simulate.viewpoints import look_at
from swatchwork.surface import RayScene, mesh_from_arrays, read_mesh, write_mesh_obj
from swatchwork.workflow.pairs_server import PairsServer
from swatchwork.workflow.preparing_pairs import open_desk

CENTRE, SCALE = np.array([130.0, -55.0, 820.0]), 40.0
"""Scans are in millimetres and far from the origin, where single precision has four digits left."""


@dataclass(frozen=True)
class Scene:
    """Files on disk, and what they were made of."""

    folder: Path
    camera: Camera
    rays: RayScene

    @property
    def photograph(self) -> Path:
        return self.folder / "IMG_1.exr"

    @property
    def output(self) -> Path:
        return self.folder / "pairs.json"

    def arguments(self) -> list[str]:
        """Of the command, without its name."""
        files = [str(self.folder / name) for name in ("IMG_1.exr", "blob.obj", "lens.json", "pairs.json")]
        return [files[0], "--mesh", files[1], "--intrinsics", files[2], "-o", files[3]]

    def seen(self, uv_px: F64) -> F64:
        """The mesh's points [C, 3] that the camera sees at [C, 2]."""
        d = self.camera.rays(uv_px)
        hit = self.rays.first_hit(np.broadcast_to(self.camera.position, d.shape), d)
        assert (hit.face >= 0).all()
        mesh = self.rays.meshes[0]
        return np.einsum("ci,cix->cx", hit.bary, mesh.vertices[mesh.faces[hit.face]])


def make_scene(folder: Path) -> Scene:
    """Write mesh, photograph (dark linear EXR, 300 x 240) and intrinsics."""
    blob = shape("blob", 32)
    mesh = mesh_from_arrays(CENTRE + SCALE * blob.vertices, blob.faces, blob.normals)
    write_mesh_obj(folder / "blob.obj", mesh)
    pose = look_at(CENTRE + SCALE * np.array([0.6, -0.5, 3.6]), CENTRE + SCALE * np.array([0.05, 0.02, 0.0]))
    camera = Camera(300, 240, 440.0, 443.0, 147.0, 123.0, pose, k1=-0.2, k2=0.05, p1=1e-3, p2=-5e-4)
    rays = RayScene([read_mesh(folder / "blob.obj")])
    gray = 0.01 * np.nan_to_num(cosine_map(rays, camera))
    write_exr(folder / "IMG_1.exr", np.repeat(gray[..., None], 3, axis=-1).astype(np.float32))
    lens = {"w": 300, "h": 240, "fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    bent = {name: getattr(camera, name) for name in ("k1", "k2", "p1", "p2")}
    (folder / "lens.json").write_text(json.dumps({**lens, **bent}))
    return Scene(folder, camera, rays)


def lens_of(scene: Scene) -> Camera:
    """The camera without its pose."""
    return replace(scene.camera, world_from_camera=np.eye(4))


@contextmanager
def serving(scene: Scene) -> Iterator[PairsServer]:
    """The server at work in a thread."""
    desk = open_desk([scene.photograph], scene.output, scene.folder / "blob.obj", scene.folder / "lens.json")
    with PairsServer(desk) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()

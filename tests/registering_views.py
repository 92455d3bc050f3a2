# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs of meshes for tests of the registration: masks and gray pictures, averaged over samples."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from swatchwork.capture import Camera
from swatchwork.prepare.registering import View
from swatchwork.simulate import look_at

ORIGIN = np.zeros(3)
LENS = Camera(640, 512, 960.0, 947.0, 326.0, 250.0, np.eye(4), -0.12, 0.03, 0.001, -0.0015)
"""Of an object of unit radius at a distance of 3.8: about 480 px long."""
CAMERA = replace(LENS, world_from_camera=look_at([2.6, 2.2, 1.6]))
SAMPLES = 3
"""Along each side of a pixel; odd, so that no share is exactly half, which would put all edges outward."""


def view_of(scene, camera=CAMERA, name="view", *, masked=True):
    """A view whose region is where the mesh covers more than half of a pixel; gray by a distant lamp."""
    mesh, shape = scene.meshes[0], (camera.height, camera.width)
    share, gray = np.zeros(shape), np.zeros(shape)
    for sample in range(SAMPLES**2):
        offset = (np.array([sample % SAMPLES, sample // SAMPLES]) + 0.5) / SAMPLES - 0.5
        direction = camera.rays(camera.pixel_centres() + offset)
        hit = scene.first_hit(np.broadcast_to(camera.position, direction.shape), direction)
        on = hit.mesh == 0
        normal = np.einsum("sc,scx->sx", hit.bary, mesh.normals[mesh.faces[hit.face]])
        lit = 60 + 150 * np.clip(normal @ [0.3, 0.5, 0.8], 0, 1)
        share += on.reshape(shape)
        gray += np.where(on, lit, 20).reshape(shape)
    gray = np.round(gray / SAMPLES**2).astype(np.uint8)
    lens = replace(camera, world_from_camera=np.eye(4))
    return View(Path(f"{name}.exr"), lens, gray, share > SAMPLES**2 / 2 if masked else None)


def disturbed(camera, seed, degrees=3.0, share=0.05):
    """The camera turned about the origin, and moved by a share of its distance, in random directions."""
    rng = np.random.default_rng(seed)
    axis, way = rng.normal(size=(2, 3))
    turn = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix()
    pose = np.eye(4)
    pose[:3, :3] = turn @ camera.world_from_camera[:3, :3]
    moved = way / np.linalg.norm(way) * share * np.linalg.norm(camera.position)
    pose[:3, 3] = turn @ camera.position + moved
    return replace(camera, world_from_camera=pose)


def clicked(mesh, camera, count, seed=0, noise_px=0.0):
    """Points of the mesh that face the camera, and where a hand puts them in its image."""
    rng = np.random.default_rng(seed)
    facing = ((camera.position - mesh.vertices) * mesh.normals).sum(axis=1) > 0.2
    x = mesh.vertices[rng.choice(np.flatnonzero(facing), count, replace=False)]
    uv, _ = camera.project(x)
    return uv + rng.normal(0, noise_px, uv.shape), x

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whole synthetic capture folders, with test frames under another light."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from ..arrays import F32, F64, U32
from ..capture import Capture, EnvironmentSource, Frame, write_capture, write_exr
from ..light import Environment
from ..progress import SILENT, Progress
from ..reflectance import GenericBasis, paper
from ..surface import write_mesh_obj
from .blends import blend_pattern
from .environments import procedural_environment
from .materials import Recipe, four_materials, ggx_basis, in_basis, in_ggx
from .photographs import Subject, photograph
from .shapes import shape
from .viewpoints import camera_towards, random_directions

TEST_SEED = 10_000
"""Added to the seed of test views: none of them was photographed."""


@dataclass(frozen=True, eq=False)
class SyntheticCapture:
    """A folder that was written, and the truth behind it."""

    folder: Path
    test_folder: Path
    """Same format: other views under another light, noise-free."""
    basis: GenericBasis
    representatives: F64
    """[N, J, 3] in `basis`."""
    blend: Callable[[F64], tuple[U32, F64]]
    """Positions [S, 3] to index and weight [S, n]."""
    subject: Subject


def simulate_capture(
    folder: str | PathLike[str],
    *,
    object_shape: str = "sphere",
    rows: int = 64,
    k: int = 12,
    test_views: int = 4,
    size: int = 192,
    seed: int = 0,
    truth: str = "basis",
    basis: GenericBasis | None = None,
    masking: str = "vgroove",
    recipes: Sequence[Recipe] | None = None,
    materials: int = 4,
    blended: int = 2,
    sharp: bool = False,
    patches: float = 2.5,
    noise_percent: float = 0.0,
    read_noise: float = 0.0,
    lights: tuple[str | Environment, str | Environment] = ("room", "sky"),
    directions: F64 | None = None,
    cells: int = 1,
    progress: Progress = SILENT,
) -> SyntheticCapture:
    """Write a capture folder (design section 2) with images/, and test/ of the same format.

    Args:
        folder: where; made if need be.
        object_shape: one of `SHAPES`; ``rows`` sets the mesh's fineness.
        k: photographs, from random directions (fewer are the first of more) or ``directions`` [k, 3].
        test_views: frames under the second of ``lights`` (procedural kinds, or environments).
        size: pixels along an image's side.
        seed: of materials, blend, views, lights and noise.
        truth: ``basis``, materials within ``basis`` (the paper's by default), or ``ggx``, beyond it, with
            ``masking``.
        recipes: what to blend; ``four_materials(seed)`` by default.
        materials: N of the truth, at most as many as recipes; ``blended`` is its n.
        sharp: hard edges between patches; ``patches`` is how many (see `blend_pattern`).
        noise_percent: each measurement is multiplied by 1 + p / 100 N(0, 1).
        read_noise: standard deviation of what is added, in units of the environment's mean radiance.
        cells: shadings along a pixel's side.
    """
    if truth not in ("basis", "ggx"):
        raise ValueError(f"truth is {truth!r}; expected 'basis' or 'ggx'")
    folder = Path(folder)
    mesh = shape(object_shape, rows)
    folder.mkdir(parents=True, exist_ok=True)
    write_mesh_obj(folder / "mesh.obj", mesh)
    of = tuple(recipes or four_materials(seed))[:materials]
    used = ggx_basis(masking) if truth == "ggx" else basis or paper()
    representatives = in_ggx(of, masking) if truth == "ggx" else in_basis(of, used)

    def blend(position: F64) -> tuple[U32, F64]:
        return blend_pattern(
            position, materials=materials, blended=blended, seed=seed, sharp=sharp, patches=patches
        )

    # As fine as the pixels, so that truth's shadows are not what limits a reconstruction. Nothing shadows a
    # sphere: a few samples are enough to find that.
    sky_resolution = min(max(size, 192), 512)
    sky_samples = 64 if object_shape == "sphere" else 4000 if size < 256 else sky_resolution**2
    subject = Subject.of(mesh, used, representatives, blend, sky_resolution, sky_samples)
    train, test = (
        procedural_environment(light, seed + i) if isinstance(light, str) else light
        for i, light in enumerate(lights)
    )
    towards = random_directions(k, seed) if directions is None else directions
    away = random_directions(test_views, seed + TEST_SEED)
    radius = float(np.linalg.norm(mesh.vertices, axis=1).max())
    rng = np.random.default_rng([seed, 5])

    def noisy(image: F32) -> F32:
        colour = image[..., :3] * (1 + noise_percent / 100 * rng.normal(size=(*image.shape[:2], 3)))
        colour = colour + read_noise * rng.normal(size=colour.shape) * (image[..., 3:] > 0)
        return np.concatenate([np.maximum(colour, 0), image[..., 3:]], axis=-1).astype(np.float32)

    with progress.stage("simulate", len(towards) + len(away)) as task, ThreadPoolExecutor(2) as threads:

        def write(root: Path, views: F64, light: Environment, finish: Callable[[F32], F32]) -> None:
            (root / "images").mkdir(parents=True, exist_ok=True)
            write_exr(root / "env.exr", light.radiance)
            source = EnvironmentSource(root / "env.exr", light.convention, light.world_from_environment)
            cameras = [camera_towards(direction, size, radius) for direction in views]
            # Two at a time: the core fills the cores, but what comes before and after it does not.
            images = threads.map(lambda camera: photograph(subject, camera, light, cells), cameras)
            frames = []
            for i, (camera, image) in enumerate(zip(cameras, images, strict=True)):
                name = f"images/{i + 1:04d}.exr"
                write_exr(root / name, finish(image))
                frames.append(Frame(name, root / name, None, 1.0, camera, source))
                task.advance()
            write_capture(
                Capture(root, root / "transforms.json", folder / "mesh.obj", (), source, tuple(frames)), root
            )

        write(folder, towards, train, noisy)
        write(folder / "test", away, test, lambda image: image)
    return SyntheticCapture(folder, folder / "test", used, representatives, blend, subject)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The paper on one screen: capture -> observations -> responses -> sparse solve -> material."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from .arrays import F32, F64, U32
from .capture import Capture
from .errors import InputError
from .observe import Observations, Rendering, Weighting, environments_of, observe, stratified
from .progress import SILENT, Progress
from .reflectance import GenericBasis, basis_by_name
from .solve import Problem, Search, Solution, SolveOptions, blend, solve
from .surface import (
    Mesh,
    RayScene,
    build_atlas,
    default_resolution,
    parametrised,
    read_mesh,
    sky_masks,
)

PAIRS_AT_ONCE = 1 << 18
"""(texel, view) pairs in a blending tile: with 18 representatives their responses take 57 MB."""


@dataclass(frozen=True)
class ReconstructOptions:
    """How to reconstruct; the defaults serve most captures."""

    resolution: int | None = None
    """Atlas resolution in texels; None: from the images' sampling of the surface."""
    basis: str = "extended"
    texels: int = 4000
    """Texels that the search for n, N and the representatives runs on; every texel is blended after."""
    solve: SolveOptions = field(default_factory=SolveOptions)
    seed: int = 0
    weighting: Weighting = "projected"
    """Weights of measurements: by projected area, or `equal` as in the paper's Eq. 5."""


@dataclass(frozen=True)
class Reconstruction:
    """What was found, and what it was found from."""

    mesh: Mesh
    scene: RayScene
    observations: Observations
    rendering: Rendering
    basis: GenericBasis
    solution: Solution
    index: U32
    """[M, n] representatives blended at each texel."""
    weight: F32
    """[M, n] their weights; they sum to 1."""
    residual: F32
    """[M] relative error of each texel's measurements, NaN where no view sees it."""


def reconstruct(
    capture: Capture, options: ReconstructOptions | None = None, progress: Progress = SILENT
) -> Reconstruction:
    """Recover the representatives and their sparse blend at every texel (paper, sections 3 and 4).

    Raises:
        InputError: the capture cannot be read or says nothing about the surface; names file and value.
    """
    options = options or ReconstructOptions()
    basis = basis_by_name(options.basis)
    with progress.stage("surface"):
        mesh, scene, resolution = surface_of(capture, options.resolution)
        atlas = build_atlas(mesh, resolution)
        sky = sky_masks(scene, atlas, progress=progress)
    with progress.stage("observe"):
        observations = observe(capture, atlas, scene, progress=progress)
        rendering = Rendering(observations, *environments_of(capture), sky, options.weighting)
    with progress.stage("respond"):
        subset = rendering.pairs(stratified(observations, options.texels, options.seed))
        responses = rendering.generic(basis, subset)
    with progress.stage("solve"):
        problem = Problem(responses, subset.radiance, subset.offsets)
        solution = solve(problem, options.solve, progress)
    with progress.stage("blend"):
        found = blend_every_texel(rendering, basis, solution, options.solve.search, progress)
    return Reconstruction(mesh, scene, observations, rendering, basis, solution, *found)


def surface_of(capture: Capture, resolution: int | None) -> tuple[Mesh, RayScene, int]:
    """The object's mesh with injective UVs, the scene that blocks light and sight, and the resolution."""
    if capture.mesh_path is None:
        raise InputError("names no mesh", file=capture.file, expected='a "mesh" key')
    given = read_mesh(capture.mesh_path)
    resolution = resolution or default_resolution(given, [frame.camera for frame in capture.frames])
    mesh = parametrised(given, resolution)
    return mesh, RayScene([mesh, *map(read_mesh, capture.occluder_paths)]), resolution


def blend_every_texel(
    rendering: Rendering,
    basis: GenericBasis,
    solution: Solution,
    search: Search = "exact",
    progress: Progress = SILENT,
) -> tuple[U32, F32, F32]:
    """Blend all texels (Eq. 12) by tiles; one that no view sees takes the blend of the nearest seen."""
    observations = rendering.observations
    representatives: F64 = solution.representatives
    M, n = len(observations.offsets) - 1, solution.n
    index, weight = np.zeros((M, n), dtype=np.uint32), np.zeros((M, n), dtype=np.float32)
    residual = np.full(M, np.nan, dtype=np.float32)
    seen = np.flatnonzero(np.diff(observations.offsets) > 0)
    with progress.stage("Blending texels", len(seen)) as task:
        for tile in rendering.tiles(seen, PAIRS_AT_ONCE):
            pairs = rendering.pairs(tile)
            responses = rendering.representatives(basis, representatives, pairs)
            best = blend(responses, pairs.radiance, pairs.offsets, n, search=search)
            index[tile], weight[tile] = best.sparse(n)
            residual[tile] = rendering.relative_error(pairs, best.squared_error)
            task.advance(len(tile))
    unseen = np.flatnonzero(np.diff(observations.offsets) == 0)
    if len(unseen):
        position = observations.atlas.position
        nearest = seen[cKDTree(position[seen]).query(position[unseen])[1]]
        index[unseen], weight[unseen] = index[nearest], weight[nearest]
    return index, weight, residual

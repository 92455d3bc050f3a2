# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The paper on one screen: capture -> observations -> responses -> sparse solve -> material."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from .capture import Capture
from .errors import InputError
from .interreflection import IndirectLight, Reflecting, bounced, surroundings
from .keeping import IN_MEMORY, Array, Keeper, Part
from .observe import Lights, NoiseModel, Observations, Rendering, Weighting, observe
from .progress import SILENT, Progress
from .reflectance import GenericBasis, basis_by_name
from .solve import Solution, SolveOptions
from .streaming import (
    Budget,
    Diagnosis,
    FrameOptions,
    TexelBlend,
    blend_every_texel,
    diagnose,
    solve_on_subset,
)
from .surface import (
    Atlas,
    Mesh,
    RayScene,
    SkyMasks,
    build_atlas,
    default_resolution,
    parametrised,
    read_mesh,
    sky_masks,
    unwrap,
)


@dataclass(frozen=True)
class ReconstructOptions:
    """How to reconstruct; the defaults serve most captures."""

    resolution: int | None = None
    """Atlas resolution in texels; None: from the images' sampling of the surface."""
    basis: str = "extended"
    texels: int = 4000
    """Texels that the search for n, N and the representatives begins with; every texel is blended after."""
    solve: SolveOptions = field(default_factory=SolveOptions)
    weighting: Weighting = "projected"
    """Weights of measurements: by projected area, or `equal` as in the paper's Eq. 5."""
    noise: NoiseModel | None = None
    """Of the photographs; None: estimated from them."""
    memory: float = 2.0
    """GB that the search and the tiles may take beside atlas and photograph, about."""
    frames: FrameOptions = field(default_factory=FrameOptions)
    """What is done with photographs that the others do not agree with; in section 4's order they are kept."""
    interreflections: int = 0
    """Times to reconstruct anew under the light that the object, as then known, sends to itself."""

    def __post_init__(self) -> None:
        if self.noise is not None and not self.solve.robustly:
            other = "--search-order paper" if self.solve.robust else "--no-robust"
            raise InputError(
                f"--noise is '{self.noise.read:g},{self.noise.gain:g}' with {other}",
                expected="a fit that heeds noise",
                hint="Leave one of the two out: this fit counts every point alike.",
            )


@dataclass(frozen=True)
class Reconstruction:
    """What was found, and what it was found from."""

    mesh: Mesh
    scene: RayScene
    observations: Observations
    rendering: Rendering
    basis: GenericBasis
    solution: Solution
    blend: TexelBlend
    frames: Diagnosis
    """Each photograph against the others; ``observations`` and ``rendering`` are without those left out."""
    indirect: IndirectLight | None = None
    """What the object sends to itself, where that was asked for."""

    @property
    def surface(self) -> Reflecting:
        """What is known of the surface, for light that bounces off it."""
        known = self.solution.representatives, self.blend.index, self.blend.weight
        return Reflecting(
            self.observations.atlas, self.basis, *known, self.rendering.sky, self.rendering.lights
        )


def reconstruct(
    capture: Capture,
    options: ReconstructOptions | None = None,
    progress: Progress = SILENT,
    keeper: Keeper = IN_MEMORY,
) -> Reconstruction:
    """Recover the representatives and their sparse blend at every texel (paper, sections 3 and 4).

    Args:
        keeper: where finished parts go, and come from if an earlier run made them.

    Raises:
        InputError: the capture cannot be read or says nothing about the surface; names file and value.
    """
    options = options or ReconstructOptions()
    basis, budget = basis_by_name(options.basis), Budget(options.memory)
    suspects = frame_options(options)
    with progress.stage("surface"):
        mesh, scene, resolution = surface_of(capture, options.resolution, keeper)
        atlas = build_atlas(mesh, resolution)
        sky = shadows_of(scene, atlas, progress, keeper)
    with progress.stage("observe"):
        observations = observe(capture, atlas, scene, progress=progress, keeper=keeper, noise=options.noise)
        lights, how = Lights.of_capture(capture), options.solve
        rendering = Rendering(observations, lights, sky, options.weighting)
    with progress.stage("frames"):
        given = (capture, scene.centre, suspects, how.seed)
        frames = diagnose(rendering, basis, *given, progress, keeper)
        if frames.changes:
            observations = observations.corrected(frames.scale, frames.left_out)
            rendering = Rendering(observations, lights, sky, options.weighting)
    solution = solve_on_subset(rendering, basis, options.texels, options.solve, budget, progress, keeper)
    with progress.stage("blend"):
        blend = blend_every_texel(rendering, basis, solution, how.search, how.seed, budget, progress, keeper)
    found = Reconstruction(mesh, scene, observations, rendering, basis, solution, blend, frames)
    return under_its_own_light(found, options, progress, keeper) if options.interreflections else found


def under_its_own_light(
    found: Reconstruction,
    options: ReconstructOptions,
    progress: Progress = SILENT,
    keeper: Keeper = IN_MEMORY,
) -> Reconstruction:
    """The same with interreflections: each round solves under the light that the round before reflects.

    The first round's light has one bounce from a material that was fitted to all bounces, so that it is about
    right already; each further round adds a bounce, of the material as it then is. An object that sees
    nothing of itself stays as it was found.
    """
    how, budget, light = options.solve, Budget(options.memory), None
    pixels = found.blend.texel_of_pixel
    with progress.stage("surroundings"):
        atlas, sky = found.observations.atlas, found.rendering.sky
        around = surroundings(found.scene, atlas, sky, pixels, progress=progress, keeper=keeper)
    if not len(around):
        return replace(found, indirect=bounced(found.surface, around))
    for turn in range(1, options.interreflections + 1):
        kept = Part(keeper, f"bounce-{turn}-")
        with progress.stage("bounce"):
            light = bounced(found.surface, around, light, progress, kept)
            rendering = found.rendering.under(light)
        start, basis = found.solution, found.basis
        solution = solve_on_subset(rendering, basis, options.texels, how, budget, progress, kept, start)
        with progress.stage("blend"):
            by = how.search, how.seed
            blend = blend_every_texel(rendering, basis, solution, *by, budget, progress, kept)
        found = replace(found, rendering=rendering, solution=solution, blend=blend, indirect=light)
    return found


def frame_options(options: ReconstructOptions) -> FrameOptions:
    """What is done with suspect photographs: in the paper's order, which uses all, they are only named.

    Raises:
        InputError: every exposure is to be corrected in that order.
    """
    if options.solve.search_order == "default":
        return options.frames
    if options.frames.scale == "all":
        raise InputError(
            "section 4's search takes photographs as they are, and every exposure is to be corrected",
            expected="--search-order paper or --frame-scale all, not both",
        )
    return replace(options.frames, keep_suspects=True)


def surface_of(
    capture: Capture, resolution: int | None, keeper: Keeper = IN_MEMORY
) -> tuple[Mesh, RayScene, int]:
    """The object's mesh with injective UVs, the scene that blocks light and sight, and the resolution."""
    if capture.mesh_path is None:
        raise InputError("names no mesh", file=capture.file, expected='a "mesh" key')
    given = read_mesh(capture.mesh_path)
    resolution = resolution or default_resolution(given, [frame.camera for frame in capture.frames])

    def cut(given: Mesh, resolution: int) -> Mesh:
        kept = keeper.kept("unwrapped", lambda: vars(unwrap(given, resolution)))
        return Mesh(*(kept.rows(name) for name in ("vertices", "faces", "normals", "uv")))

    mesh = parametrised(given, resolution, cut)
    return mesh, RayScene([mesh, *map(read_mesh, capture.occluder_paths)]), resolution


def shadows_of(
    scene: RayScene, atlas: Atlas, progress: Progress = SILENT, keeper: Keeper = IN_MEMORY
) -> SkyMasks:
    """The self-shadowing of every texel."""

    def make() -> dict[str, Array]:
        found = sky_masks(scene, atlas, progress=progress)
        return {"words": found.words, "of_texel": found.of_texel}

    kept = keeper.kept("sky", make)
    return SkyMasks(kept.rows("words"), kept.rows("of_texel"))

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A capture's floor (design 7): representatives fitted with the true weights, rendered with them.

The fit uses the texels that a reconstruction of the same options searches on; the renders use the true
weights at the resolution they are given in, and the package's own relighting. What is left is what the
basis, the light's resolution and the direct-light model cannot say; what a reconstruction leaves beyond that,
the solver did not find.

    python scripts/measure/floor.py --capture ../shared/captures/sphere-merl --renders out --json floor.json
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import results
from scipy import ndimage

from swatchwork.capture import Capture, read_capture
from swatchwork.material import BasisRecord, Material
from swatchwork.observe import Lights, Rendering, observe, stratified
from swatchwork.reconstruct import ReconstructOptions, surface_of
from swatchwork.reflectance import basis_by_name
from swatchwork.relight import RelitScene, relight
from swatchwork.simulate import dense_weights
from swatchwork.solve import Problem
from swatchwork.surface import Mesh, build_atlas, padded, read_mesh, sky_masks
from swatchwork.workflow import evaluate_folders


@dataclass(frozen=True)
class TrueWeights:
    """The blend of each pixel of a map over the mesh's UVs, row 0 at v = 1; gaps take the nearest."""

    index: np.ndarray
    """[H, W, n]"""
    weight: np.ndarray
    """[H, W, n], rows sum to 1."""
    materials: int

    @classmethod
    def read(cls, capture: Path) -> TrueWeights:
        with np.load(capture / "truth" / "weights.npz") as file:
            nearest = ndimage.distance_transform_edt(
                ~file["covered"], return_distances=False, return_indices=True
            )
            index = file["index"][tuple(nearest)].astype(np.uint32)
            weight = file["weight_255"][tuple(nearest)].astype(np.float64)
            return cls(index, weight / weight.sum(axis=-1, keepdims=True), len(file["materials"]))

    def at(self, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Index and weight [P, n] of the pixels that hold UVs [P, 2]."""
        height, width = self.index.shape[:2]
        row = np.clip(((1 - uv[:, 1]) * height).astype(np.int64), 0, height - 1)
        col = np.clip((uv[:, 0] * width).astype(np.int64), 0, width - 1)
        return self.index[row, col], self.weight[row, col]


def fitted(capture: Capture, truth: TrueWeights, options: ReconstructOptions) -> tuple[Mesh, np.ndarray]:
    """The mesh and the representatives [N, J, 3] that the true weights give."""
    mesh, scene, resolution = surface_of(capture, options.resolution)
    given = read_mesh(capture.mesh_path)
    if mesh.uv is None or given.uv is None or not np.array_equal(mesh.uv, given.uv):
        raise SystemExit(
            f"{capture.root}: the mesh was unwrapped anew, so its UVs are not those of the truth"
        )
    atlas = build_atlas(mesh, resolution)
    observations = observe(capture, atlas, scene)
    rendering = Rendering(observations, Lights.of_capture(capture), sky_masks(scene, atlas))
    texels = stratified(observations, options.texels, options.solve.seed)
    pairs = rendering.pairs(texels)
    centre = np.stack([atlas.col[texels] + 0.5, resolution - (atlas.row[texels] + 0.5)], axis=-1) / resolution
    weights = dense_weights(*truth.at(centre), truth.materials)
    problem = Problem(rendering.generic(basis_by_name(options.basis), pairs), pairs.radiance, pairs.offsets)
    return mesh, problem.representatives(weights).representatives


def true_material(mesh: Mesh, representatives: np.ndarray, truth: TrueWeights, basis: str) -> Material:
    """Representatives blended by the true weights, at the resolution of the true map."""
    b, resolution = basis_by_name(basis), truth.index.shape[0]
    atlas = build_atlas(mesh, resolution)
    nearest = padded(atlas)
    assert mesh.uv is not None
    return Material(
        basis=BasisRecord(b.name, tuple(map(float, b.sigmas)), b.maskings, b.diffuse, b.fresnel),
        representatives=representatives,
        index=truth.index[atlas.row, atlas.col][nearest],
        weight=truth.weight[atlas.row, atlas.col][nearest].astype(np.float32),
        coverage=np.where(atlas.texel_at >= 0, 1, -1).astype(np.int32),
        residual=np.zeros((resolution, resolution), np.float32),
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=mesh.normals,
        uv=mesh.uv,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--capture", type=Path, required=True, help="capture with truth/ and test/")
    parser.add_argument("--basis", choices=["paper", "extended"], default="extended")
    parser.add_argument("--views", type=int, help="the first so many photographs; all by default")
    parser.add_argument("--renders", type=Path, required=True, help="folder for the renders of test/")
    parser.add_argument("--json", type=Path, help="write the figures here")
    args = parser.parse_args()
    capture = read_capture(args.capture)
    capture = capture if args.views is None else capture.first(args.views)
    truth = TrueWeights.read(args.capture)
    mesh, representatives = fitted(capture, truth, ReconstructOptions(basis=args.basis))
    scene = RelitScene.of(true_material(mesh, representatives, truth, args.basis))
    test = args.capture / "test"
    relight(scene, read_capture(test, require_images=False), args.renders, previews=False)
    found = evaluate_folders(args.renders, test, rim=True)
    print(f"{args.capture.name}, {args.basis}, {len(capture.frames)} views: floor {100 * found.nrms:.2f} %")
    results.write(args.json, found.as_dict())


if __name__ == "__main__":
    main()

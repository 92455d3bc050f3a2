# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a capture folder to a material folder: read, reconstruct, write whole, with its report."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from ..analysis import fit_error_model, spread_of_representatives
from ..arrays import F64
from ..capture import Capture, read_capture
from ..interreflection import IndirectShare, indirect_share
from ..material import BasisRecord, ErrorModel, Material, is_material_folder, write_material
from ..progress import SILENT, Progress
from ..reconstruct import Reconstruction, ReconstructOptions, reconstruct
from ..report import Report, write_report
from ..viewer import bundled_script, write_viewer
from ..whole import whole_folder
from .cautions import collected_warnings, left_out_by_frame, warn_of_bright_materials, warn_of_outliers
from .checkpoints import checkpoints
from .costs import CostRecorder
from .identity import as_it_was, fingerprints, key_of
from .pages import reconstruction_report, relit
from .summary import ReconstructSummary, summarise
from .viewing import VIEWER, viewer_of


@dataclass(frozen=True)
class Recovered:
    """A finished reconstruction with its material and summary."""

    capture: Capture
    reconstruction: Reconstruction
    material: Material
    summary: ReconstructSummary
    report: Report


def reconstruct_folder(
    capture_folder: str | PathLike[str],
    output: str | PathLike[str],
    options: ReconstructOptions | None = None,
    *,
    views: int | None = None,
    viewer: bool = True,
    progress: Progress = SILENT,
) -> ReconstructSummary:
    """Reconstruct a capture folder into a material folder, which appears whole or not at all.

    Args:
        capture_folder: the capture's folder or its transforms.json.
        output: the material folder. Until it is whole, finished parts are kept beside it in ``OUT.partial``,
            and a run after an interrupted one with the same inputs and options goes on from them.
        views: use the first so many frames only.
        viewer: also write the interactive page, ``viewer.html``.

    Raises:
        InputError: the capture is wrong, ``output`` holds something that is not a material, or the viewer's
            script was not built.
        OutputError: ``output`` cannot be written; what was there is intact.
    """
    return recover(capture_folder, output, options, views=views, viewer=viewer, progress=progress).summary


def recover(
    capture_folder: str | PathLike[str],
    output: str | PathLike[str],
    options: ReconstructOptions | None = None,
    *,
    views: int | None = None,
    viewer: bool = True,
    progress: Progress = SILENT,
) -> Recovered:
    """As :func:`reconstruct_folder`, and hands back all that was found."""
    options = options or ReconstructOptions()
    costs = CostRecorder(progress)
    start = time.perf_counter()
    # Find out that the output cannot be written before the work, not after it.
    if viewer:
        bundled_script()
    with whole_folder_is_free(output), collected_warnings() as said:
        with costs.stage("read"):
            capture = read_capture(capture_folder)
            capture = capture.first(views) if views is not None else capture
            prints = fingerprints(capture)
        with checkpoints(output, key_of(prints, options), lambda: as_it_was(capture, prints)) as keeper:
            found = reconstruct(capture, options, costs, keeper)
            resumed = bool(keeper.resumed)
            with costs.stage("trust"):
                learnt = found.rendering, found.basis, found.solution, found.blend, options.solve.seed
                trust, spread = fit_error_model(*learnt), spread_of_representatives(*learnt)
            with costs.stage("write"):
                share = share_of(found, options)
                material = material_of(found, prints, trust, spread, options.interreflections, share)
                warn_of_bright_materials(material, capture)
                warn_of_outliers(found, capture)
                at_hand = capture, output, start, options.interreflections, share
                summary = summarise(found, *at_hand, costs.costs, resumed)
                report = reconstruction_report(found, capture, material, costs.costs, said, summary.as_dict())
                if viewer:
                    report = replace(report, viewer=VIEWER)

                def write_pages(inside: Path) -> None:
                    write_report(inside / "report.html", report)
                    if viewer:
                        title, lights = capture.root.resolve().name, found.rendering.lights
                        with costs.stage("viewer"):
                            shown = viewer_of(title, relit(found), material, capture, lights)
                            write_viewer(inside / VIEWER, shown)

                write_material(output, material, write_pages)
    summary = summarise(found, *at_hand, costs.costs, resumed)
    return Recovered(capture, found, material, summary, report)


@contextmanager
def whole_folder_is_free(output: str | PathLike[str]) -> Iterator[None]:
    """Raise what :func:`whole.whole_folder` would raise for ``output``, before anything is computed."""

    class Untouched(Exception):
        pass

    try:
        with whole_folder(output, is_material_folder, "a material folder"):
            raise Untouched
    except Untouched:
        pass
    yield


def material_of(
    found: Reconstruction,
    prints: dict[str, str],
    trust: ErrorModel | None = None,
    spread: F64 | None = None,
    interreflections: int = 0,
    share: IndirectShare | None = None,
) -> Material:
    """The reconstruction as images over the atlas; gutters repeat their nearest texel, for filters."""
    atlas, basis, solution = found.observations.atlas, found.basis, found.solution
    assert found.mesh.uv is not None, "the atlas was made from them"
    coverage = np.full(atlas.resolution**2, -1, dtype=np.int32)
    coverage[atlas.pixel] = found.observations.coverage
    coverage[atlas.pixel[found.blend.undecided]] = 0
    record = BasisRecord(
        basis.name,
        tuple(map(float, basis.sigmas)),
        basis.maskings,
        basis.diffuse,
        basis.fresnel,
    )
    solver = (
        solution.summary()
        | {"weighting": found.rendering.weighting, "photographs": found.frames.as_dict()}
        | left_out_by_frame(found)
    )
    if share is not None:
        solver["interreflections"] = {"rounds": interreflections, "indirect": asdict(share)}
    return Material(
        basis=record,
        representatives=solution.representatives,
        index=found.blend.index,
        weight=found.blend.weight,
        coverage=coverage.reshape(found.blend.residual.shape),
        residual=found.blend.residual,
        vertices=found.mesh.vertices,
        faces=found.mesh.faces,
        normals=found.mesh.normals,
        uv=found.mesh.uv,
        penalties={"lambda0": solution.lambda0, "lambda1": solution.lambda1},
        solver=solver,
        trust=trust,
        spread=spread,
        inputs=prints,
    )


def share_of(found: Reconstruction, options: ReconstructOptions) -> IndirectShare | None:
    """How much of the light came by way of the object itself; None where that was not asked."""
    if found.indirect is None:
        return None
    return indirect_share(found.rendering, found.surface, options.solve.seed)

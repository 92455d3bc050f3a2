# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a capture folder to a material folder: read, reconstruct, write whole, with its report."""

from __future__ import annotations

import hashlib
import os
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis import fit_error_model, spread_of_representatives
from ..arrays import F64
from ..capture import Capture, read_capture
from ..errors import CaptureWarning
from ..interreflection import IndirectShare, indirect_share
from ..material import BasisRecord, ErrorModel, Material, is_material_folder, normal_albedo, write_material
from ..progress import SILENT, Progress
from ..reconstruct import Reconstruction, ReconstructOptions, reconstruct
from ..report import Report, write_report
from ..response import instruction_sets
from ..surface import buffers_of
from ..viewer import bundled_script, write_viewer
from ..whole import whole_folder
from .checkpoints import checkpoints
from .costs import CostRecorder, StageCost
from .pages import reconstruction_report, relit
from .viewing import VIEWER, viewer_of

BRIGHTEST_ALBEDO = 1.05
"""Directional albedo at normal incidence above which exposures are in doubt; the excess is room for noise."""

CARRIED_SHARE = 0.01
"""Share of the blend weight from which a representative counts: rare ones rest on too few measurements."""


@dataclass(frozen=True)
class ReconstructSummary:
    """What a reconstruction found and cost, in plain numbers."""

    capture: str
    output: str
    basis: str
    views: int
    """Photographs that the material rests on."""
    views_left_out: int
    """Further ones, with something wrong."""
    suspects: tuple[dict[str, Any], ...]
    """Photographs that the others do not agree with: what was found, and what was done."""
    doubt: str
    """Why there may be more of them, in words; empty where nothing speaks for that."""
    resolution: int
    texels: int
    unseen: int
    n: int
    N: int
    status: str
    misfit: float
    """Root mean square over texels of the relative error |s_hat - s| / |s_hat|; undecided ones do not count,
    unless all are."""
    lambda0: float
    lambda1: float
    left_out: float
    """Share of the measurements that were left out as outliers; 0 where none were found."""
    undecided: int
    """Texels in photographs of which no two agree there, or in one alone, where there are outliers: they have
    the nearest decided texel's blend."""
    interreflections: int
    """Rounds under the light that the object sends to itself."""
    indirect: IndirectShare | None
    """How much of the light that was; None where it was ignored."""
    seconds: float
    peak_mb: float
    resumed: bool
    """Whether it went on from an interrupted run, so that `seconds` and `stages` are the rest's."""
    stages: tuple[StageCost, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """Two lines for a person, three with interreflections."""
        unseen = f", {100 * self.unseen / self.texels:.1f} % of them in no photograph" if self.unseen else ""
        out = (
            f" {100 * self.left_out:.0f} % of the measurements left out as outliers." if self.left_out else ""
        )
        if self.undecided:
            unseen += f", {100 * self.undecided / self.texels:.1f} % undecided"
        rest = " (gone on from an interrupted run)" if self.resumed else ""
        bounced = f"{_sentence(self.indirect.in_words())}\n" if self.indirect else ""
        return (
            f"{self.N} materials, {self.n} blended at a point ({self.status}); relative misfit "
            f"{100 * self.misfit:.1f} % at {self.texels:,} surface points{unseen}.{out}\n{bounced}"
            f"{self.photographs}, {self.seconds:.1f} s{rest}, peak {self.peak_mb:.0f} MB. "
            f"Material in {self.output}"
        )

    @property
    def photographs(self) -> str:
        """How many were used, left out and scaled, and whether they could be judged."""
        scaled = sum(suspect["done"] == "scaled" for suspect in self.suspects)
        words = f"{self.views} photographs"
        words += f", {self.views_left_out} more left out" if self.views_left_out else ""
        words += f", {scaled} of them scaled" if scaled else ""
        return words + (f", {self.doubt}" if self.doubt else "")


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
        with checkpoints(output, key_of(prints, options)) as keeper:
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


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


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


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """CaptureWarnings given within, in words and without repeats; they go on to whoever listened before."""
    said: list[str] = []
    with warnings.catch_warnings():
        listener = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any) -> None:
            if issubclass(category, CaptureWarning) and str(message) not in said:
                said.append(str(message))
            listener(message, category, *rest)

        warnings.showwarning = show  # type: ignore[assignment]
        yield said


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


def warn_of_bright_materials(material: Material, capture: Capture) -> None:
    """Warn of representatives that reflect more light than they receive.

    Warns:
        CaptureWarning: some representative that carries at least 1 % of the blend weight has a directional
            albedo at normal incidence above 1.05 in a channel.
    """
    share = material.shares
    albedo = np.einsum("j,njc->nc", normal_albedo(material.basis), material.representatives)
    bright = np.flatnonzero((share >= CARRIED_SHARE) & (albedo.max(axis=1) > BRIGHTEST_ALBEDO))
    if len(bright):
        each = ", ".join(
            f"{i + 1} (albedo {albedo[i].max():.2f}, {100 * share[i]:.0f} % of it)" for i in bright
        )
        message = (
            f"{capture.file}: the object reflects more light at normal incidence than it receives: "
            f"representative {each}; expected albedos up to 1. Check that photographs and environment have "
            "one exposure and unit: the frames' exposure values, and the light probe's scale and its sun."
        )
        warnings.warn(CaptureWarning(message), stacklevel=3)


def left_out_by_frame(found: Reconstruction) -> dict[str, Any]:
    """For svbrdf.json: the share of each frame's measurements left out, where outliers were found.

    None for a frame that was left out altogether.
    """
    shares = found.blend.left_out_by_frame
    if shares is None:
        return {}
    each = zip(shares, found.frames.left_out, strict=True)
    return {"left_out_by_frame": [None if out else round(float(share), 4) for share, out in each]}


def warn_of_outliers(found: Reconstruction, capture: Capture) -> None:
    """Say what share of each frame's measurements was left out.

    Warns:
        CaptureWarning: outliers were found.
    """
    shares = found.blend.left_out_by_frame
    if shares is None:
        return
    each = ", ".join(
        f"{frame.name} {100 * share:.0f} %"
        for frame, share, out in zip(capture.frames, shares, found.frames.left_out, strict=True)
        if not out
    )
    undecided = len(found.blend.undecided) / len(found.observations.atlas)
    message = (
        f"{capture.file}: measurements that contradict those of the same point in other photographs were "
        f"left out: {each}; expected none. At {100 * undecided:.0f} % of the points no two photographs "
        "agree, or there is but one, and the nearest point's blend stands in. Look for hands, flies, "
        "labels or reflections of the room in the photographs, mask them, or use --no-robust to count every "
        "measurement."
    )
    warnings.warn(CaptureWarning(message), stacklevel=3)


def key_of(prints: dict[str, str], options: ReconstructOptions) -> dict[str, Any]:
    """What the parts of an interrupted run must agree on, to be gone on from."""
    return {
        "version": version("swatchwork"),
        "code": digest_of_the_package(),
        "kernels": instruction_sets()[-1],
        "threads": os.environ.get("RAYON_NUM_THREADS") or os.cpu_count(),
        "inputs": prints,
        "options": asdict(options),
    }


def digest_of_the_package() -> str:
    """SHA-256 of the package's sources and native core: parts of another build are not gone on from."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for file in sorted(f for f in package.rglob("*") if f.suffix in {".py", ".so", ".pyd"}):
        digest.update(file.relative_to(package).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()


def fingerprints(capture: Capture) -> dict[str, str]:
    """SHA-256 of every file the capture names, by its path from the capture's folder."""
    files = [capture.file, capture.mesh_path, *capture.occluder_paths]
    files += [
        e.file for e in (capture.environment, *(f.environment for f in capture.frames)) if e is not None
    ]
    files += [p for f in capture.frames for p in (f.image_path, f.mask_path)]
    files += [p for mesh in (capture.mesh_path, *capture.occluder_paths) if mesh for p in buffers_of(mesh)]
    found: dict[str, str] = {}
    for file in files:
        if file is not None:
            name = Path(os.path.relpath(file, capture.root)).as_posix()
            if name not in found:
                with file.open("rb") as stream:
                    found[name] = hashlib.file_digest(stream, "sha256").hexdigest()
    return found


def summarise(
    found: Reconstruction,
    capture: Capture,
    output: str | PathLike[str],
    start: float,
    interreflections: int,
    indirect: IndirectShare | None,
    costs: list[StageCost],
    resumed: bool,
) -> ReconstructSummary:
    """The plain numbers of a reconstruction begun at ``start`` (seconds of ``time.perf_counter``)."""
    atlas, seen = found.observations.atlas, found.observations.seen
    decided = np.setdiff1d(seen, found.blend.undecided, assume_unique=True)
    residual = found.blend.residual.ravel()[atlas.pixel[decided if len(decided) else seen]]
    return ReconstructSummary(
        capture=str(capture.file),
        output=str(output),
        basis=found.basis.name,
        views=len(capture.frames) - int(found.frames.left_out.sum()),
        views_left_out=int(found.frames.left_out.sum()),
        suspects=tuple(frame for frame in found.frames.as_dict()["frames"] if frame["kind"]),
        doubt=found.frames.doubt,
        resolution=atlas.resolution,
        texels=len(atlas),
        unseen=len(atlas) - len(seen),
        n=found.solution.n,
        N=len(found.solution.representatives),
        status=found.solution.status,
        misfit=float(np.sqrt(np.mean(np.square(residual), dtype=np.float64))),
        lambda0=float(found.solution.lambda0),
        lambda1=float(found.solution.lambda1),
        left_out=found.blend.left_out,
        undecided=len(found.blend.undecided),
        interreflections=interreflections,
        indirect=indirect,
        seconds=time.perf_counter() - start,
        peak_mb=max((cost.peak_mb for cost in costs), default=0.0),
        resumed=resumed,
        stages=tuple(costs),
    )

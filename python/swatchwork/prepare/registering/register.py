# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where photographs were taken from, from the clues to the last refinement (paper, section 6).

pairs, board or outline --start--> first poses --contours--> better ones
photographs --features--> tracks --grow from the first poses--> all poses --refine together--> the answer
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from swatchwork.arrays import norm
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering.bundle import Bundle, refine
from swatchwork.prepare.registering.evidence import clicked, silhouettes
from swatchwork.prepare.registering.growing import Grown, grow
from swatchwork.prepare.registering.onto_mesh import align_to_mesh
from swatchwork.prepare.registering.outlining import Silhouettes, pose_from_outline, silhouettes_around
from swatchwork.prepare.registering.pairs import Pairs
from swatchwork.prepare.registering.posing import Posed, pose_from_pairs
from swatchwork.prepare.registering.refining import iou, refine_by_contours
from swatchwork.prepare.registering.rematching import rematched
from swatchwork.prepare.registering.structure import structure_from_motion
from swatchwork.prepare.registering.tracks import Features, Tracks, find_tracks, joined
from swatchwork.prepare.registering.view import View
from swatchwork.progress import SILENT, Progress
from swatchwork.surface import RayScene

ROUNDS = 3
"""Of finding the silhouettes' contours and refining all poses by them; the third moves them by hundredths of
a pixel."""
STEP = 0.2
"""Logarithm of the ratio of distances at which the mesh's silhouettes are cast."""
FEW = 50
"""Features shared by a photograph, below which the mesh guides a second search for matches."""
Others = Literal["features", "colmap", "none"]
"""How photographs without a clue of their own are placed."""


@dataclass(frozen=True, eq=False)
class Clues:
    """What places the first photographs.

    Attributes:
        pairs: points clicked, by the photograph's name.
    """

    pairs: Mapping[str, Pairs] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class FrameFit:
    """How well a photograph fits where it was placed; None where there is nothing to say it by.

    Attributes:
        camera: its pose.
        placed_by: "pairs", "features", "silhouette", "structure from motion".
        pairs_px: rms of the clicked pairs that agree; ``pairs_out`` numbers (from 0) of those that do not.
        features: sightings that it shares with other photographs; ``features_px`` their rms.
        iou: intersection over union of its region and the mesh's silhouette.
        degrees, share: standard deviation of its direction, and of its place over the distance to the object.
    """

    camera: Camera
    placed_by: str
    pairs_px: float | None
    pairs_out: tuple[int, ...]
    features: int
    features_px: float | None
    iou: float | None
    degrees: float | None
    share: float | None


@dataclass(frozen=True, eq=False)
class Registered:
    """Poses in the mesh's world, by the photograph's name.

    Attributes:
        frames: those that could be placed.
        missing: why each of the others could not.
        suspicions: what looks wrong about those that could, in words.
        status: of the joint refinement.
    """

    frames: dict[str, FrameFit]
    missing: dict[str, str]
    suspicions: tuple[str, ...]
    status: str


def register(
    scene: RayScene,
    views: Sequence[View],
    clues: Clues,
    *,
    others: Others = "features",
    scan_error: float = 0.0,
    progress: Progress = SILENT,
) -> Registered:
    """Place photographs in the mesh's world.

    Args:
        scene: the object's mesh first.
        views: the photographs.
        clues: what places the first of them.
        others: how the rest is placed.
        scan_error: standard deviation of the scan along its normal, world units.

    Raises:
        InputError: nothing places a first photograph, pairs are of no photograph or fit no pose; pycolmap is
            wanted and missing.
    """
    by_name = {view.name: view for view in views}
    first = _from_pairs(by_name, clues.pairs)
    agreeing = {name: _agreeing(clues.pairs[name], posed) for name, posed in first.items()}
    start = {}
    with progress.stage("Aligning contours", len(first)) as task:
        for name, posed in first.items():
            start[name] = refine_by_contours(scene, by_name[name], posed.camera, agreeing[name]).camera
            task.advance()
    placed_by = dict.fromkeys(start, "pairs")
    outlines = Outlines(scene, by_name, progress)
    if not start:
        start = outlines.first()
        placed_by = dict.fromkeys(start, "silhouette")
    tracks = _no_tracks(views) if others == "none" else find_tracks(views, progress=progress)
    if others == "colmap":
        start |= _by_structure(scene, views, start)
        placed_by |= {name: "structure from motion" for name in start if name not in placed_by}
    pair_terms = clicked(agreeing)
    grown = grow(scene, views, start, tracks, (pair_terms,), scan_error=scan_error, progress=progress)
    placed_by |= {name: "features" for name in grown.cameras if name not in placed_by}
    if found_too := outlines.of([name for name in by_name if name not in grown.cameras]):
        placed_by |= dict.fromkeys(found_too, "silhouette")
        start = grown.cameras | found_too
        grown = grow(scene, views, start, tracks, (pair_terms,), scan_error=scan_error, progress=progress)
        placed_by |= {name: "features" for name in grown.cameras if name not in placed_by}
    # Where silhouettes tell, features of shiny places that move with the light would only blur it.
    bare = [n for shared, n in _shared(tracks, grown) if shared < FEW and by_name[n].region is None]
    if others != "none" and bare:
        tracks = rematched(scene, grown.cameras, tracks)
    missing = {
        name: "; ".join(filter(None, (why, outlines.why.get(name))))
        for name, why in grown.missing.items()
        if name not in grown.cameras
    }
    cameras = grown.cameras
    with progress.stage("Refining all poses together", ROUNDS) as task:
        for _ in range(ROUNDS):
            terms = (pair_terms, silhouettes(scene, views, cameras))
            found = refine(scene, views, cameras, tracks, terms, scan_error=scan_error)
            cameras = found.cameras
            task.advance()
    frames = {}
    for name, camera in found.cameras.items():
        frames[name] = _fit(scene, by_name[name], camera, placed_by[name], clues, first, grown, found)
    return Registered(frames, missing, tuple(_suspicions(first, grown)), found.status)


class Outlines:
    """Poses by silhouettes, which are sought only where nothing else places a photograph."""

    def __init__(self, scene: RayScene, views: Mapping[str, View], progress: Progress) -> None:
        self.scene, self.views, self.progress = scene, views, progress
        self.why: dict[str, str] = {}
        self._around: dict[int, Silhouettes] = {}

    def around(self, distance: float) -> Silhouettes:
        """The mesh's silhouettes from about that far, cast once for distances within a tenth."""
        step = round(np.log(distance / self.scene.radius) / STEP)
        if step not in self._around:
            self._around[step] = silhouettes_around(self.scene, self.scene.radius * np.exp(step * STEP))
        return self._around[step]

    def of(self, names: Sequence[str], enough: int | None = None) -> dict[str, Camera]:
        """Poses of those photographs whose silhouette leaves no doubt, ``enough`` of them or all."""
        masked = [name for name in names if self.views[name].region is not None]
        found: dict[str, Camera] = {}
        if not masked:
            return found
        with self.progress.stage("Comparing silhouettes", len(masked)) as task:
            for name in masked:
                result = pose_from_outline(self.scene, self.views[name], self.around)
                if result.camera is not None:
                    found[name] = result.camera
                else:
                    self.why[name] = result.why
                task.advance()
                if len(found) == enough:
                    break
        return found

    def first(self) -> dict[str, Camera]:
        """One photograph's pose, for there is no other clue; InputError where no silhouette gives one."""
        found = self.of(list(self.views), enough=1)
        if not found:
            said = "; ".join(f"{name} {why}" for name, why in list(self.why.items())[:3])
            raise InputError(
                "nothing says where any photograph was taken from" + (f": {said}" if said else ""),
                expected="6 to 12 pairs of points in one of them, or masks whose silhouettes are unlike",
                hint="Click pairs with `swatchwork prepare pairs`",
            )
        return found


def _shared(tracks: Tracks, grown: Grown) -> list[tuple[int, str]]:
    """How many sightings each placed photograph shares with another, and its name."""
    count = np.bincount(tracks.frame, minlength=len(tracks.names))
    return [(int(count[i]), name) for i, name in enumerate(tracks.names) if name in grown.cameras]


def _from_pairs(views: Mapping[str, View], pairs: Mapping[str, Pairs]) -> dict[str, Posed]:
    marked = {name: of for name, of in pairs.items() if len(of)}
    unknown = next((name for name in marked if name not in views), None)
    if unknown is not None:
        raise InputError(
            f"there are pairs of {marked[unknown].photograph}, which is none of the photographs",
            expected="one of " + ", ".join(list(views)[:8]) + (", ..." if len(views) > 8 else ""),
        )
    return {
        name: pose_from_pairs(views[name].lens, of.uv_px, of.x_in_world, name=str(views[name].file))
        for name, of in marked.items()
    }


def _agreeing(pairs: Pairs, posed: Posed) -> Pairs:
    return Pairs(pairs.photograph, pairs.uv_px[posed.inliers], pairs.x_in_world[posed.inliers])


def _no_tracks(views: Sequence[View]) -> Tracks:
    none = Features(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 128), np.float32), np.zeros(0, np.int32))
    return joined(tuple(view.name for view in views), [none] * len(views), [])


def _by_structure(scene: RayScene, views: Sequence[View], start: Mapping[str, Camera]) -> dict[str, Camera]:
    with TemporaryDirectory() as folder:
        structure = structure_from_motion(views, Path(folder))
    found = align_to_mesh(scene, structure, start)
    return {name: camera for name, camera in found.cameras.items() if name not in start}


def _fit(
    scene: RayScene,
    view: View,
    camera: Camera,
    placed_by: str,
    clues: Clues,
    first: Mapping[str, Posed],
    grown: Grown,
    found: Bundle,
) -> FrameFit:
    name = view.name
    pairs_px: float | None = None
    out: tuple[int, ...] = ()
    if name in first:
        of, posed = clues.pairs[name], first[name]
        off = camera.project(of.x_in_world)[0] - of.uv_px
        pairs_px = float(np.sqrt((off[posed.inliers] ** 2).sum(axis=1).mean()))
        out = posed.outliers
    rms = found.rms_px[name]
    deviation = found.deviation[name]
    known = bool(np.isfinite(deviation).all())
    away = float(norm(camera.position - scene.centre))
    return FrameFit(
        camera,
        placed_by,
        pairs_px,
        out,
        grown.frames[name].shared,
        float(rms) if np.isfinite(rms) else None,
        iou(scene, view, camera),
        float(np.degrees(norm(deviation[:3]))) if known else None,
        float(norm(deviation[3:]) / away) if known else None,
    )


def _suspicions(first: Mapping[str, Posed], grown: Grown) -> list[str]:
    said = []
    for name, posed in first.items():
        if posed.outliers:
            numbers = ", ".join(str(i + 1) for i in posed.outliers)
            one = len(posed.outliers) == 1
            said.append(
                f"{name}: pair {numbers} disagrees with the others and is left out"
                if one
                else f"{name}: pairs {numbers} disagree with the others and are left out"
            )
        if posed.ambiguous:
            said.append(
                f"{name}: another pose fits the pairs nearly as well ({posed.rival_px:.1f} px, this one "
                f"{posed.rms_px:.1f} px); click points at other depths"
            )
        if posed.focal_off:
            said.append(
                f"{name}: the pairs fit better with a focal length {posed.focal_fits:.3f} times that of the "
                "intrinsics; calibrate with the lens as it was for these photographs"
            )
    said += [f"{name}: {frame.why}" for name, frame in grown.frames.items() if frame.status == "contradicts"]
    return said

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Where photographs were taken from, from the clues to the last refinement (paper, section 6).

pairs, board, sphere's outline or silhouette --start--> first poses --contours--> better ones
photographs --features--> tracks --grow from the first poses--> most poses --silhouettes--> the rest
all poses --refine together--> the answer
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from swatchwork.arrays import norm
from swatchwork.capture import Camera
from swatchwork.prepare.registering.bundle import Bundle, refine
from swatchwork.prepare.registering.evidence import clicked, silhouettes
from swatchwork.prepare.registering.first import CORNER_PX, Clues, FirstPoses, first_poses
from swatchwork.prepare.registering.growing import Grown, grow
from swatchwork.prepare.registering.least import misses_px, root_mean_square
from swatchwork.prepare.registering.onto_mesh import align_to_mesh
from swatchwork.prepare.registering.outlining import Outlines
from swatchwork.prepare.registering.placing import carried
from swatchwork.prepare.registering.refining import iou
from swatchwork.prepare.registering.rematching import rematched
from swatchwork.prepare.registering.structure import structure_from_motion
from swatchwork.prepare.registering.tracks import Tracks, find_tracks, joined
from swatchwork.prepare.registering.view import View
from swatchwork.progress import SILENT, Progress
from swatchwork.surface import RayScene

ROUNDS = 3
"""Of finding the silhouettes' contours and refining all poses by them; the third moves them by hundredths of
a pixel."""
FEW = 50
"""Features shared by a photograph, below which the mesh guides a second search for matches."""
POOR_IOU = 0.85
"""Of mask and silhouette, from which down they do not belong together; a mask with a stand in it has 0.9."""
Others = Literal["features", "colmap", "none"]
"""How photographs without a clue of their own are placed."""


@dataclass(frozen=True, eq=False)
class FrameFit:
    """How well a photograph fits where it was placed; None where there is nothing to say it by.

    Attributes:
        camera: its pose.
        placed_by: "pairs", "board", "outline" (of a sphere), "silhouette", "features", or "structure from
            motion".
        board_px: rms of the board's corners from where its pose has them.
        pairs_px: rms of the clicked pairs that agree; ``pairs_out`` numbers (from 0) of those that do not.
        features: sightings that it shares with other photographs; ``features_px`` their rms.
        iou: intersection over union of its region and the mesh's silhouette.
        degrees, share: standard deviation of its direction, and of its place over the distance to the object.
    """

    camera: Camera
    placed_by: str
    board_px: float | None
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
        InputError: nothing places a first photograph, a clue is of no photograph or fits no pose; pycolmap is
            wanted and missing.
    """
    by_name = {view.name: view for view in views}
    outlines = Outlines(scene, by_name, progress)
    first = first_poses(scene, views, clues, outlines, progress)
    start, placed_by = first.cameras, dict(first.placed_by)
    held = (clicked(first.pairs), clicked(first.corners, CORNER_PX))
    tracks = joined((), [], []) if others == "none" else find_tracks(views, progress=progress)
    if others == "colmap":
        start |= _by_structure(scene, views, start)
        placed_by |= {name: "structure from motion" for name in start if name not in placed_by}
    grown = grow(scene, views, start, tracks, held, scan_error=scan_error, progress=progress)
    placed_by |= {name: "features" for name in grown.cameras if name not in placed_by}
    if clues.sphere is None and (more := outlines.of([n for n in by_name if n not in grown.cameras])):
        placed_by |= dict.fromkeys(more, "silhouette")
        start = grown.cameras | more
        grown = grow(scene, views, start, tracks, held, scan_error=scan_error, progress=progress)
        placed_by |= {name: "features" for name in grown.cameras if name not in placed_by}
    # Where silhouettes tell, features of shiny places, which move with the light, would only blur it.
    bare = [n for shared, n in _shared(tracks, grown) if shared < FEW and by_name[n].region is None]
    if others != "none" and bare:
        tracks = rematched(scene, grown.cameras, tracks)
    missing = {
        name: "; ".join(filter(None, (why, outlines.why.get(name)))) for name, why in grown.missing.items()
    }
    cameras = grown.cameras
    trusted = [view for view in views if view.name not in first.masks_off]
    with progress.stage("Refining all poses together", ROUNDS) as task:
        for _ in range(ROUNDS):
            terms = (*held, silhouettes(scene, trusted, cameras))
            found = refine(scene, views, cameras, tracks, terms, scan_error=scan_error)
            cameras = found.cameras
            task.advance()
    cameras = turned_back(found.cameras, [name for name, by in placed_by.items() if by == "outline"])
    frames = {}
    for name, camera in cameras.items():
        frames[name] = _fit(scene, by_name[name], camera, placed_by[name], clues, first, tracks, found)
    suspicions = (*first.suspicions, *_suspicions(frames, grown))
    return Registered(frames, missing, suspicions, found.status)


def _shared(tracks: Tracks, grown: Grown) -> list[tuple[int, str]]:
    """How many sightings each placed photograph shares with another, and its name."""
    count = np.bincount(tracks.frame, minlength=len(tracks.names))
    return [(int(count[i]), name) for i, name in enumerate(tracks.names) if name in grown.cameras]


def _by_structure(scene: RayScene, views: Sequence[View], start: Mapping[str, Camera]) -> dict[str, Camera]:
    with TemporaryDirectory() as folder:
        structure = structure_from_motion(views, Path(folder))
    found = align_to_mesh(scene, structure, start)
    return {name: camera for name, camera in found.cameras.items() if name not in start}


def turned_back(cameras: Mapping[str, Camera], outlined: Sequence[str]) -> dict[str, Camera]:
    """All cameras turned about the sphere's centre, the origin, until the outlined one has the world's axes.

    No outline holds that turn, so it drifts while the rest is refined; the sphere stays the same under it.
    """
    turn = np.eye(4)
    for name in outlined[:1]:
        turn[:3, :3] = cameras[name].world_from_camera[:3, :3].T
    return carried(cameras, turn) if outlined else dict(cameras)


def _fit(
    scene: RayScene,
    view: View,
    camera: Camera,
    placed_by: str,
    clues: Clues,
    first: FirstPoses,
    tracks: Tracks,
    found: Bundle,
) -> FrameFit:
    name = view.name
    pairs_px: float | None = None
    out: tuple[int, ...] = ()
    if name in first.inliers:
        of, inliers = clues.pairs[name], first.inliers[name]
        off = misses_px(camera, of.uv_px, of.x_in_world)[inliers]
        pairs_px = root_mean_square(off) if len(off) else None
        out = tuple(int(i) for i in np.flatnonzero(~inliers))
    board_px: float | None = None
    if name in first.corners:
        corners = first.corners[name]
        board_px = root_mean_square(misses_px(camera, corners.uv_px, corners.x_in_world))
    frame = tracks.names.index(name) if name in tracks.names else -1
    features = int((found.used & ~found.outliers & (tracks.frame == frame)).sum())
    rms = found.rms_px[name]
    deviation = found.deviation[name]
    # Nothing holds a sphere's turn about its centre but features; the contours' noise is no hold.
    known = bool(np.isfinite(deviation).all()) and (placed_by != "outline" or features > 0)
    away = float(norm(camera.position - scene.centre))
    return FrameFit(
        camera,
        placed_by,
        board_px,
        pairs_px,
        out,
        features,
        float(rms) if np.isfinite(rms) else None,
        iou(scene, view, camera),
        float(np.degrees(norm(deviation[:3]))) if known else None,
        float(norm(deviation[3:]) / away) if known else None,
    )


def _suspicions(frames: Mapping[str, FrameFit], grown: Grown) -> list[str]:
    said = [f"{name}: {frame.why}" for name, frame in grown.frames.items() if frame.status == "contradicts"]
    by_features = any(frame.placed_by == "features" for frame in frames.values())
    for name, frame in frames.items():
        if by_features and frame.placed_by == "silhouette" and not frame.features:
            said.append(
                f"{name}: its silhouette alone places it, and it shares no features with the others; does it "
                "show the same object?"
            )
        if frame.iou is not None and frame.iou < POOR_IOU:
            said.append(
                f"{name}: its mask and the mesh's silhouette cover each other to {frame.iou:.2f} only; is "
                "the mask, or the photograph, another one's?"
            )
    return said

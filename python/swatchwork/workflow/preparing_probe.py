# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Photographs of a mirror ball to a light probe: the files, the figures of merit, a page to check by eye."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from ..arrays import F64
from ..capture import (
    Camera,
    EnvironmentSource,
    read_capture,
    read_image,
    write_exr,
    write_exr_channels,
)
from ..errors import InputError
from ..prepare.ball import find_outline, given_outline
from ..prepare.mirror import PerspectiveBall
from ..prepare.panorama import Mirror, View
from ..prepare.probe import Probe, probe_of_views
from ..progress import SILENT, Progress
from ..report import Sheet, write_sheet
from ..whole import write_text
from .lighting import light_capture, lightable
from .preparing_calibrate import read_intrinsics
from .probe_page import probe_sheet
from .together import files_together

ORTHOGRAPHIC = (
    "No focal length was given: the camera is taken as orthographic, which puts lamps off by up to about the "
    "angle that the ball's radius takes up as seen from the camera (11 degrees at 5 radii) plus that of the "
    "ball from the optical axis."
)

PROBE = "probe.exr"
SIZE_TOLERANCE = 0.05
"""By which a ball's stated radius and distance may disagree with its outline."""


@dataclass(frozen=True)
class ProbeSummary:
    """What was made, and how good it is; the contents of probe.json."""

    probe: str
    page: str
    convention: str
    width: int
    model: str
    """ "perspective" or "orthographic"."""
    world: str
    """Which axes the directions are in."""
    views: tuple[dict[str, Any], ...]
    unseen_sr: float
    unseen_filled: str
    clipped_share: float
    """Share of the sphere's solid angle."""
    scalar_irradiance: tuple[float, float, float]
    """Integral of radiance over all directions, without a cosine."""
    clipped_scalar_irradiance_as_read: tuple[float, float, float]
    """Of what is clipped."""
    clipped_in_words: str
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """Lines for a person."""
        first = self.views[0]
        text = f"{self.probe}: {self.width} x {self.width // 2}, {self.convention}; "
        text += f"outline within {first['outline_residual_px']:.2f} px"
        for view in self.views[1:]:
            off = view["agreement_nrms"]
            text += f"; {Path(view['file']).name} differs by "
            text += f"{100 * off:.0f} % where both see" if off is not None else "unknown (no overlap)"
        if self.model == "orthographic":
            text += f". {ORTHOGRAPHIC}"
        return f"{text}\n{self.clipped_in_words}\n{self.page} shows it ({self.seconds:.0f} s)"


def prepare_probe(
    photographs: Sequence[str | PathLike[str]],
    output: str | PathLike[str],
    *,
    balls: Sequence[tuple[float, ...]] = (),
    focal_px: float | None = None,
    principal_px: tuple[float, float] | None = None,
    intrinsics: str | PathLike[str] | None = None,
    poses: Sequence[str] = (),
    radius: float | None = None,
    distance: float | None = None,
    reflectance: Sequence[float] = (1.0,),
    fresnel: bool = False,
    clip: float | None = None,
    convention: str | None = None,
    width: int | None = None,
    allow_cut: bool = False,
    capture: str | PathLike[str] | None = None,
    progress: Progress = SILENT,
) -> ProbeSummary:
    """Turn photographs of a mirror ball into probe.exr, with probe.json, probe_masks.exr and probe.html.

    Args:
        photographs: linear EXR or .hdr; PNG and JPEG are decoded from sRGB. EXR channels clipped.R, .G, .B
            and alpha 0 mark clipped pixels.
        output: the folder.
        balls: outlines in the photographs' order, (x, y, radius) or (x, y, a, b, degrees) in pixels; by
            default they are looked for.
        focal_px: focal length in pixels; by default that of the pose's frame, or else orthographic.
        principal_px: by default the frame's, or the middle.
        intrinsics: JSON of ``prepare calibrate``: the lens of all photographs, in place of the poses'.
        poses: transforms.json files, or FILE#FRAME, of the photographs in order: the world is that of the
            first. Without ``#FRAME`` the frame that has the photograph's name. Those missing are estimated.
        radius: of the ball, and ``distance`` of its centre from the first camera, in one unit: checked
            against the outline where both are given.
        reflectance: one number or three, at normal incidence.
        clip: radiance from which on a channel counts as clipped.
        convention: "blender" or "mitsuba"; by default "blender" with a pose (z up), "mitsuba" (y up) without.
        width: of the map.
        allow_cut: use a ball that the frame cuts.
        capture: a capture whose light the probe becomes; its cameras must be in the probe's world.

    Raises:
        InputError: a file, number or ball that is wrong, each by name; the capture has another light.
        OutputError: the folder cannot be written.
    """
    start = time.perf_counter()
    files = [Path(p) for p in photographs]
    _check(
        files,
        balls,
        poses,
        focal_px,
        principal_px,
        radius,
        distance,
        reflectance,
        clip,
        intrinsics is not None,
    )
    if capture is not None and not poses:
        raise InputError(
            "--capture is given without --pose",
            expected="the pose of the first photograph of the ball",
            hint="Where the camera stayed between object and ball: --pose CAPTURE/transforms.json#FRAME",
        )
    if capture is not None:
        lightable(capture, Path(PROBE).suffix)
    if intrinsics is not None and focal_px is not None:
        raise InputError("--intrinsics and --focal are given", expected="one of them")
    calibrated = read_intrinsics(intrinsics) if intrinsics is not None else None
    mirror = Mirror(np.broadcast_to(np.asarray(reflectance, dtype=np.float64), 3).copy(), fresnel)
    frames = [_pose(poses[i], files[i]) if i < len(poses) else None for i in range(len(files))]
    views = []
    with progress.stage("Finding the ball", len(files)) as task:
        for i, file in enumerate(files):
            shape = balls[i] if i < len(balls) else None
            lens = calibrated or frames[i] or (frames[0] if frames else None)
            views.append(_view(file, shape, lens, focal_px, principal_px, clip, allow_cut))
            task.advance()
    _check_size(views[0], radius, distance)
    convention = convention or ("blender" if poses else "mitsuba")
    turns = [frame.world_from_camera[:3, :3] if frame else None for frame in frames]
    with progress.stage("Making the map"):
        probe = probe_of_views(views, turns, convention=convention, width=width, mirror=mirror)
    folder = Path(output)
    summary = _summary(folder, files, views, probe, bool(poses), radius, time.perf_counter() - start)
    words = summary.clipped_in_words
    if summary.model == "orthographic":
        words = f"{ORTHOGRAPHIC} {words}"
    sheet = probe_sheet(views, probe, mirror, words, summary.world, summary.unseen_filled)
    _write(folder, probe, summary, sheet)
    if capture is not None:
        light_capture(capture, EnvironmentSource(Path(summary.probe), convention))
    return summary


def _check(
    files: Sequence[Path],
    balls: Sequence[tuple[float, ...]],
    poses: Sequence[str],
    focal_px: float | None,
    principal_px: tuple[float, float] | None,
    radius: float | None,
    distance: float | None,
    reflectance: Sequence[float],
    clip: float | None,
    calibrated: bool,
) -> None:
    if not files:
        raise InputError("no photograph is given", expected="one or more of a mirror ball")
    for name, given in (("--ball", balls), ("--pose", poses)):
        if len(given) > len(files):
            raise InputError(
                f"{name} is given {len(given)} times for {len(files)} photographs", expected="one for each"
            )
    for name, value in (
        ("--focal", focal_px),
        ("--ball-radius", radius),
        ("--ball-distance", distance),
        ("--clip", clip),
    ):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} is {value:g}", expected="a positive number")
    if radius is not None and distance is not None and distance <= radius:
        raise InputError(
            f"the camera is {distance:g} from the centre of a ball of radius {radius:g}",
            expected="a camera outside the ball, both in one unit",
        )
    if principal_px is not None and focal_px is None and not poses and not calibrated:
        raise InputError("--principal is given without a focal length", expected="--focal, too")
    if len(reflectance) not in (1, 3):
        raise InputError(f"--reflectance has {len(reflectance)} numbers", expected="one, or R,G,B")


def _pose(text: str, photograph: Path) -> Camera:
    """The camera of a frame, FILE#FRAME, or of the one that has the photograph's name."""
    file, _, name = text.partition("#")
    capture = read_capture(file, require_images=False)
    wanted = Path(name or photograph.name).stem
    found = [f for f in capture.frames if f.name == name or Path(f.name).stem == wanted]
    if len(found) != 1:
        names = ", ".join(f.name for f in capture.frames[:6])
        raise InputError(
            f"{len(found) or 'no'} frames are called {name or photograph.stem!r}",
            file=file,
            expected=f"one of {names}" + (", ..." if len(capture.frames) > 6 else ""),
            hint="Say which by --pose FILE#FRAME",
        )
    return found[0].camera


def _view(
    file: Path,
    shape: tuple[float, ...] | None,
    frame: Camera | None,
    focal_px: float | None,
    principal_px: tuple[float, float] | None,
    clip: float | None,
    allow_cut: bool,
) -> View:
    image = read_image(file)
    height, width = image.clipped.shape
    radiance, clipped = image.linear.copy(), image.clipped.copy()
    if clip is not None:
        clipped |= (radiance >= clip).any(axis=-1)
    if image.alpha is not None:
        covered = image.alpha > 0
        radiance[covered] /= image.alpha[covered][:, None]
        clipped |= ~covered
    if clipped.all():
        raise InputError("all of it is clipped", file=file, expected="a shorter exposure")
    # What was saturated is no darker than what lies around it; the file's reading may be more.
    if clipped.any():
        nearest = distance_transform_edt(clipped, return_distances=False, return_indices=True)
        radiance[clipped] = np.fmax(radiance[clipped], radiance[tuple(nearest)][clipped])
    camera = None
    if frame is not None and focal_px is None and (frame.width, frame.height) != (width, height):
        raise InputError(
            f"the photograph is {width} x {height}",
            file=file,
            expected=f"{frame.width} x {frame.height}, as its frame or intrinsics say",
        )
    if focal_px is not None:
        cx, cy = principal_px or (width / 2, height / 2)
        # A focal length by hand replaces that of the pose's frame; its distortion stays.
        lens = (frame.k1, frame.k2, frame.p1, frame.p2) if frame is not None else (0.0, 0.0, 0.0, 0.0)
        camera = Camera(width, height, focal_px, focal_px, cx, cy, np.eye(4), *lens)
    elif frame is not None:
        cx, cy = principal_px or (frame.cx, frame.cy)
        lens = frame.k1, frame.k2, frame.p1, frame.p2
        camera = Camera(width, height, frame.fx, frame.fy, cx, cy, np.eye(4), *lens)
    outline = (
        find_outline(radiance, camera, str(file), allow_cut=allow_cut)
        if shape is None
        else given_outline(shape, (width, height), camera, str(file), allow_cut=allow_cut)
    )
    return View(radiance, clipped, outline, str(file))


def _check_size(view: View, radius: float | None, distance: float | None) -> None:
    """A ball of another size than its outline says is another ball, or another focal length."""
    ball = view.outline.ball
    if distance is not None and radius is None:
        raise InputError("--ball-distance is given without --ball-radius", expected="both, in one unit")
    if radius is None or distance is None:
        return
    if not isinstance(ball, PerspectiveBall):
        raise InputError(
            "the ball's radius and distance are given without a focal length", expected="--focal, too"
        )
    if abs(ball.distance / (distance / radius) - 1) > SIZE_TOLERANCE:
        raise InputError(
            f"the outline is that of a ball {ball.distance:.3g} radii away, and {distance:g} / {radius:g} is "
            f"{distance / radius:.3g}",
            file=view.name,
            expected=f"agreement within {100 * SIZE_TOLERANCE:.0f} %",
            hint="Check the focal length in pixels, and radius (not diameter) and distance to the centre",
        )


def _summary(
    folder: Path,
    files: Sequence[Path],
    views: Sequence[View],
    probe: Probe,
    posed: bool,
    radius: float | None,
    seconds: float,
) -> ProbeSummary:
    entries = []
    for i, (file, view) in enumerate(zip(files, views, strict=True)):
        outline, ball = view.outline, view.outline.ball
        entry: dict[str, Any] = {
            "file": str(file),
            "outline_found": outline.found,
            "outline_residual_px": outline.residual_px,
            "outline_support": outline.support,
            "outline_cut": outline.cut,
            "ball_radius_px": outline.radius_px,
            "ball_distance_radii": ball.distance if isinstance(ball, PerspectiveBall) else None,
            "ball_centre_in_camera": None,
            "blind_half_angle_degrees": float(np.degrees(ball.blind_rad)),
            "world_from_camera": probe.world_from_cameras[i].tolist(),
            "rerendered_nrms": probe.rerendered[i],
        }
        if radius is not None and isinstance(ball, PerspectiveBall):
            entry["ball_centre_in_camera"] = (ball.centre * radius).tolist()
        if i:
            agreement = probe.agreements[i - 1]
            entry |= {
                "agreement_nrms": agreement.nrms,
                "exposure_ratio": agreement.exposure,
                "overlap": agreement.overlap,
                "rotation": "given" if agreement.correlation is None else "estimated",
                "rotation_correlation": agreement.correlation,
            }
        entries.append(entry)
    return ProbeSummary(
        str(folder / PROBE),
        str(folder / "probe.html"),
        probe.environment.convention,
        probe.environment.radiance.shape[1],
        views[0].outline.ball.model,
        "that of the first photograph's pose" if posed else "the first camera's axes: x right, y up, z back",
        tuple(entries),
        probe.unseen_sr,
        "means of its border weighted by 1 / angle^2" if probe.unseen_sr > 0 else "nothing to fill",
        probe.clipped_share,
        _three(probe.scalar_irradiance),
        _three(probe.clipped_scalar_irradiance),
        _clipped_in_words(probe),
        seconds,
    )


def _three(values: F64) -> tuple[float, float, float]:
    r, g, b = (float(v) for v in values)
    return r, g, b


def _clipped_in_words(probe: Probe) -> str:
    if probe.clipped_share <= 0:
        return "No pixel of the ball is clipped."
    share = probe.clipped_scalar_irradiance.sum() / max(probe.scalar_irradiance.sum(), 1e-300)
    return (
        f"{100 * probe.clipped_share:.3g} % of the sphere is clipped, which holds {100 * share:.0f} % of the "
        "map's scalar irradiance (integral of radiance over all directions) as read: in truth it is more, "
        "how much more cannot be told without shorter exposures. Of RAW files taken to sRGB a single colour "
        "can be less than read."
    )


def _write(folder: Path, probe: Probe, summary: ProbeSummary, sheet: Sheet) -> None:
    """The probe last, so that its presence says that all is there."""
    with files_together(folder, PROBE) as made:
        write_sheet(made / "probe.html", sheet)
        text = json.dumps(summary.as_dict(), indent=2, allow_nan=False)
        write_text(made / "probe.json", text + "\n")
        write_exr_channels(made / "probe_masks.exr", {"unseen": probe.unseen, "clipped": probe.clipped})
        write_exr(made / PROBE, probe.environment.radiance)

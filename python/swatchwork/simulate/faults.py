# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What goes wrong with one photograph of a capture: its exposure, its pose, its light.

The files stay as they are: what ``transforms.json`` says of the frame is no longer true of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import F64, unit
from ..capture import Capture, Frame
from ..light import vertical


def slip_exposure(capture: Capture, frame: int, factor: float) -> Capture:
    """The capture with a frame whose radiance is read ``factor`` times too bright."""
    return _with(capture, frame, exposure=capture.frames[frame].exposure / factor)


def turn_pose(
    capture: Capture,
    frame: int,
    degrees: float,
    about: Literal["object", "camera"],
    centre: F64 | None = None,
    seed: int = 0,
) -> Capture:
    """The capture with a frame whose camera is turned about an axis square to its line of sight.

    About the ``object`` (``centre`` [3], the origin by default) it goes around it and keeps looking at it;
    about the ``camera`` it stands where it was and looks beside it. ``seed`` draws the axis.
    """
    camera = capture.frames[frame].camera
    pose = camera.world_from_camera
    drawn = np.random.default_rng([seed, frame, 9]).normal(size=3)
    axis = unit(np.cross(drawn, pose[:3, 2]))
    turn = Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()
    pivot = camera.position if about == "camera" else np.zeros(3) if centre is None else centre
    turned = pose.copy()
    turned[:3, :3] = turn @ pose[:3, :3]
    turned[:3, 3] = pivot + turn @ (camera.position - pivot)
    return _with(capture, frame, camera=replace(camera, world_from_camera=turned))


def turn_light(capture: Capture, frame: int, degrees: float) -> Capture:
    """The capture with a frame whose light is said to be turned about the light's vertical."""
    source = capture.frames[frame].environment or capture.environment
    if source is None:
        raise ValueError(f"frame {capture.frames[frame].name} has no environment to turn")
    axis = vertical(source.convention, source.world_from_environment)
    turn = Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()
    return _with(
        capture,
        frame,
        environment=replace(source, world_from_environment=turn @ source.world_from_environment),
    )


def _with(capture: Capture, frame: int, **changes: object) -> Capture:
    frames = list(capture.frames)
    changed: Frame = replace(frames[frame], **changes)  # type: ignore[arg-type]
    frames[frame] = changed
    return replace(capture, frames=tuple(frames))

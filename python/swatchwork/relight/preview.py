# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Pictures to look at: PNG previews and turntables, as the paper's figures are shown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pillow

from ..arrays import F32, F64, U8
from ..capture import Camera
from ..errors import InputError, OutputError
from ..light import Environment
from ..progress import SILENT, Progress
from ..whole import whole_file
from .render import render
from .scene import RelitScene

GAMMA = 2.2


def display_image(image: F32, environment: Environment) -> U8:
    """A linear premultiplied [H, W, 4] as uint8 with straight alpha: gamma 2.2, exposure 1 / mean radiance.

    A white diffuse surface in even light comes out just white.
    """
    exposure = 1 / max(float(environment.mean_radiance.mean()), 1e-30)
    alpha = image[..., 3:]
    straight = image[..., :3] / np.where(alpha > 0, alpha, 1) * exposure
    coded = np.clip(straight, 0, 1) ** (1 / GAMMA)
    return np.round(255 * np.concatenate([coded, np.clip(alpha, 0, 1)], axis=-1)).astype(np.uint8)


def turntable(
    scene: RelitScene,
    camera: Camera,
    environment: Environment,
    path: Path,
    *,
    frames: int = 36,
    frames_per_s: float = 18.0,
    samples: int = 1,
    progress: Progress = SILENT,
) -> None:
    """Turn the object once before a camera and a light that stand still; GIF or MP4 by the file's suffix.

    It turns about the world's axis that is nearest to the camera's upward direction, through the
    object's centre, on dark grey.

    Raises:
        InputError: another suffix.
        OutputError: the file cannot be written, or OpenCV has no encoder for MP4 here.
    """
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise InputError(f"a turntable of type {path.suffix!r}", file=path, expected=".gif or .mp4")
    pictures = []
    with progress.stage("turntable", frames) as task:
        for i in range(frames):
            # The object turned by an angle is the camera and the light turned back.
            turn = _turn(_up_axis(camera), -2 * np.pi * i / frames)
            turned = _camera_turned(camera, turn, scene.rays.centre)
            shown = display_image(render(scene, turned, environment.rotated(turn), samples), environment)
            pictures.append(_on_grey(shown))
            task.advance()
    with whole_file(path) as temporary:
        if path.suffix.lower() == ".gif":
            _write_gif(temporary, pictures, frames_per_s)
        else:
            _write_mp4(temporary, pictures, frames_per_s)


def _up_axis(camera: Camera) -> F64:
    up = camera.world_from_camera[:3, 1]
    axis = np.zeros(3)
    largest = int(np.argmax(np.abs(up)))
    axis[largest] = np.sign(up[largest])
    return axis


def _turn(axis: F64, angle_rad: float) -> F64:
    """Rotation matrix [3, 3] about a unit axis."""
    return np.asarray(cv2.Rodrigues(axis * angle_rad)[0], dtype=np.float64)


def _camera_turned(camera: Camera, turn: F64, centre: F64) -> Camera:
    pose = camera.world_from_camera.copy()
    pose[:3, :3] = turn @ pose[:3, :3]
    pose[:3, 3] = turn @ (pose[:3, 3] - centre) + centre
    return replace(camera, world_from_camera=pose)


def _on_grey(shown: U8) -> U8:
    alpha = shown[..., 3:].astype(np.float64) / 255
    return np.round(shown[..., :3] * alpha + 28 * (1 - alpha)).astype(np.uint8)


def _write_gif(path: Path, pictures: list[U8], frames_per_s: float) -> None:
    images = [Pillow.fromarray(picture) for picture in pictures]
    duration_ms = round(1000 / frames_per_s)
    images[0].save(path, format="GIF", save_all=True, append_images=images[1:], duration=duration_ms, loop=0)


def _write_mp4(path: Path, pictures: list[U8], frames_per_s: float) -> None:
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), frames_per_s, (width, height))
    if not writer.isOpened():
        raise OutputError(f"{path}: OpenCV has no MP4 encoder on this machine; ask for a .gif")
    for picture in pictures:
        writer.write(np.ascontiguousarray(picture[..., ::-1]))
    writer.release()

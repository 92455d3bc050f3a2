# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A light probe put into a capture."""

from __future__ import annotations

import shutil
from dataclasses import replace
from os import PathLike
from pathlib import Path

from ..capture import EnvironmentSource, read_capture, write_capture
from ..errors import InputError, OutputError
from ..light import read_environment

NAME = "env"
"""Of the copy, with the probe's own ending."""


def light_capture(capture_folder: str | PathLike[str], light: EnvironmentSource) -> Path:
    """Copy a probe into a capture as the light of all frames that have none of their own.

    Returns:
        The capture's transforms.json.

    Raises:
        InputError: capture or probe cannot be read; the capture has another light.
        OutputError: the capture cannot be written.
    """
    capture = read_capture(capture_folder, require_images=False)
    read_environment(light)
    target = capture.root / (NAME + light.file.suffix.lower())
    if capture.environment is not None and capture.environment.file.resolve() != target.resolve():
        raise InputError(
            f"has a light already, {capture.environment.file.name}",
            file=capture.file,
            expected="a capture without one",
            hint='Take "environment" out of the file first',
        )
    partial = target.with_name(target.name + ".partial")
    try:
        shutil.copyfile(light.file, partial)
        partial.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written ({error.strerror})") from error
    finally:
        partial.unlink(missing_ok=True)
    placed = EnvironmentSource(target, light.convention, light.world_from_environment)
    frames = tuple(
        replace(frame, environment=placed) if frame.environment is capture.environment else frame
        for frame in capture.frames
    )
    return write_capture(replace(capture, environment=placed, frames=frames), capture.root)

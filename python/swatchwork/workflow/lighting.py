# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A light probe put into a capture."""

from __future__ import annotations

import shutil
from dataclasses import replace
from os import PathLike
from pathlib import Path

from ..capture import Capture, EnvironmentSource, read_capture, write_capture
from ..errors import InputError
from ..light import read_environment
from ..whole import whole_file

NAME = "env"
"""Of the copy, with the probe's own ending."""


def lightable(capture_folder: str | PathLike[str], suffix: str) -> tuple[Capture, Path]:
    """The capture, and the file that a probe ending in ``suffix`` is to become in it.

    Raises:
        InputError: the capture cannot be read or has another light; the file is there and is not its light.
    """
    capture = read_capture(capture_folder, require_images=False)
    target = capture.root / (NAME + suffix.lower())
    present = None if capture.environment is None else capture.environment.file
    if present is not None and present.resolve() != target.resolve():
        raise InputError(
            f"has a light already, {present.name}",
            file=capture.file,
            expected="a capture without one",
            hint='Take "environment" out of the file first',
        )
    if present is None and (target.exists() or target.is_symlink()):
        raise InputError(
            "is there already, and is not the capture's light",
            file=target,
            expected="no file of this name, which the probe is to have",
            hint="Move it elsewhere first",
        )
    return capture, target


def light_capture(capture_folder: str | PathLike[str], light: EnvironmentSource) -> Path:
    """Copy a probe into a capture as the light of all frames that have none of their own.

    Returns:
        The capture's transforms.json.

    Raises:
        InputError: as `lightable`; the probe cannot be read.
        OutputError: the capture cannot be written; it is as it was.
    """
    capture, target = lightable(capture_folder, light.file.suffix)
    read_environment(light)
    placed = EnvironmentSource(target, light.convention, light.world_from_environment)
    frames = tuple(
        replace(frame, environment=placed) if frame.environment is capture.environment else frame
        for frame in capture.frames
    )
    # The photographs' file first: killed before the light follows, the same command puts it there.
    with whole_file(target) as made:
        shutil.copyfile(light.file, made)
        return write_capture(replace(capture, environment=placed, frames=frames), capture.root)

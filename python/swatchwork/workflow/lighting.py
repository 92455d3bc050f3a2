# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A light probe put into a capture."""

from __future__ import annotations

import hashlib
import re
import shutil
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from pathlib import Path

from ..capture import Capture, EnvironmentSource, read_capture, write_capture
from ..errors import InputError
from ..light import read_environment
from ..whole import whole_file

NAME = "env"
"""Of the copy, with the probe's own ending; ``env-<8 hex>``, by its content, where a file has that name."""


def lightable(capture_folder: str | PathLike[str], suffix: str) -> Capture:
    """The capture that a probe ending in ``suffix`` is to light.

    Raises:
        InputError: the capture cannot be read, or has another light than a probe that was put there.
    """
    capture = read_capture(capture_folder, require_images=False)
    present = None if capture.environment is None else capture.environment.file.resolve()
    ours = rf"{NAME}(-[0-9a-f]{{8}})?{re.escape(suffix.lower())}"
    if present is not None and not (
        present.parent == capture.root.resolve() and re.fullmatch(ours, present.name)
    ):
        raise InputError(
            f"has a light already, {present.name}",
            file=capture.file,
            expected="a capture without one",
            hint='Take "environment" out of the file first',
        )
    return capture


def light_capture(capture_folder: str | PathLike[str], light: EnvironmentSource) -> Path:
    """Copy a probe into a capture as the light of all frames that have none of their own.

    A probe that is there already stays, and the new one gets a name by its content: whenever the process
    ends, the capture names a light whose convention and rotation are those beside its name.

    Returns:
        The capture's transforms.json.

    Raises:
        InputError: as `lightable`; the probe cannot be read.
        OutputError: the capture cannot be written; it is as it was.
    """
    capture = lightable(capture_folder, light.file.suffix)
    read_environment(light)
    target = _place(capture.root, light.file)
    made = not target.exists()
    if made:
        with whole_file(target) as copy:
            shutil.copyfile(light.file, copy)
    placed = EnvironmentSource(target, light.convention, light.world_from_environment)
    frames = tuple(
        replace(frame, environment=placed) if frame.environment is capture.environment else frame
        for frame in capture.frames
    )
    try:
        return write_capture(replace(capture, environment=placed, frames=frames), capture.root)
    except BaseException:
        if made:
            with suppress(OSError):
                target.unlink()
        raise


def _place(folder: Path, probe: Path) -> Path:
    """Where the copy lies, or is to lie: no other file has the name."""
    suffix, digest = probe.suffix.lower(), _digest(probe)
    plain = folder / f"{NAME}{suffix}"
    if not plain.is_symlink() and (not plain.exists() or (plain.is_file() and _digest(plain) == digest)):
        return plain
    named = folder / f"{NAME}-{digest[:8]}{suffix}"
    if named.is_symlink() or (named.exists() and not (named.is_file() and _digest(named) == digest)):
        raise InputError(
            "is there already with other content than its name says",
            file=named,
            expected="no file of this name, which the probe is to have",
            hint="Move it elsewhere first",
        )
    return named


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()

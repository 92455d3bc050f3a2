# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Build backend (PEP 517): maturin's, with the viewer's script bundled first, so that every wheel has it."""

from __future__ import annotations

from typing import Any

import build_viewer
import maturin
from maturin import (
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    return [*maturin.get_requires_for_build_wheel(config_settings), *build_viewer.requirements()]


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    return [*maturin.get_requires_for_build_editable(config_settings), *build_viewer.requirements()]


def build_wheel(directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    build_viewer.build()
    return str(maturin.build_wheel(directory, config_settings, metadata_directory))


def build_editable(directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    build_viewer.build()
    return str(maturin.build_editable(directory, config_settings, metadata_directory))


def build_sdist(directory: str, config_settings: Any = None) -> str:
    return str(maturin.build_sdist(directory, config_settings))

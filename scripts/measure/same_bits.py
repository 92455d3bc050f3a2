# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whether two runs left the same folder, bit for bit."""

from __future__ import annotations

import hashlib
from pathlib import Path

TELLS_THE_TIME = ("report.html",)
"""Files that say what the run took."""


def contents(folder: Path) -> dict[str, str]:
    """SHA-256 of every file by its path, but of those that tell the time."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in TELLS_THE_TIME]
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files
    }


def differing(folder: Path, whole: dict[str, str]) -> list[str]:
    """Files that are not the same in both, or in one alone."""
    found = contents(folder)
    return sorted(name for name in found | whole if found.get(name) != whole.get(name))

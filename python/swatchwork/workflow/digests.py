# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Arrays in a folder with a digest of each, so that what a power cut or a disk damaged is noticed."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..keeping import Array
from ..whole import sync

DIGESTS = "digests.json"


class _Digesting:
    """A stream that passes on what is written, and counts it into a digest."""

    def __init__(self, stream: BinaryIO) -> None:
        self.stream, self.digest = stream, hashlib.sha256()

    def write(self, data: bytes) -> int:
        self.digest.update(data)
        return self.stream.write(data)


def write_part(folder: Path, arrays: Mapping[str, Array]) -> None:
    """Write NAME.npy of each array into a new folder, onto the disk. Raises OSError."""
    folder.mkdir()
    digests: dict[str, str] = {}
    for name, array in arrays.items():
        with (folder / f"{name}.npy").open("wb") as stream:
            digesting = _Digesting(stream)
            np.save(digesting, array)  # type: ignore[call-overload]
            stream.flush()
            os.fsync(stream.fileno())
        digests[name] = digesting.digest.hexdigest()
    (folder / DIGESTS).write_text(json.dumps(digests), encoding="utf-8")
    sync(folder / DIGESTS)
    sync(folder)


def damage_of(folder: Path) -> str | None:
    """What is no longer as `write_part` wrote it, in words; None where all is."""
    try:
        digests = json.loads((folder / DIGESTS).read_text(encoding="utf-8"))
        for name, digest in digests.items():
            with (folder / f"{name}.npy").open("rb") as stream:
                if hashlib.file_digest(stream, "sha256").hexdigest() != digest:
                    return f"{name}.npy has other bytes than were written"
    except (OSError, ValueError, AttributeError, TypeError) as error:
        return f"it cannot be read whole ({error})"
    return None

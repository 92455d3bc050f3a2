# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What is registered: a photograph whose lens is known and whose place is not."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from swatchwork.arrays import U8, Bool
from swatchwork.capture import Camera


@dataclass(frozen=True, eq=False)
class View:
    """A photograph to be registered.

    Attributes:
        file: the photograph.
        lens: its camera at the origin, of the photograph's size.
        gray: U8[H, W], as a display shows it.
        region: Bool[H, W], where the object is; None where no mask or alpha says.
    """

    file: Path
    lens: Camera
    gray: U8
    region: Bool | None = None

    @property
    def name(self) -> str:
        """The file's name without folder and ending; other files refer to the photograph by it."""
        return self.file.stem

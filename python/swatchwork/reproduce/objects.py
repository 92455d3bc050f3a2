# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The rows of the paper's Table 1, and the simulated object that stands for each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..simulate import many_materials


@dataclass(frozen=True)
class Row:
    """A row of Table 1, and what stands for its object."""

    name: str
    k: int
    n: int
    N: int
    paper_minutes: int
    """On 8 Xeon cores."""
    shape: str
    rows: int
    """Of the shape's grid."""
    patches: float
    """Frequency of the blend's pattern: enough for all N materials to show."""
    size: int = 512
    """Pixels along an image's side."""

    def simulation(self) -> dict[str, Any]:
        """What `simulate_capture` is told of the object and its views; size and light are the caller's."""
        seed = TABLE.index(self)
        return {
            "object_shape": self.shape,
            "rows": self.rows,
            "k": self.k,
            "seed": seed,
            "truth": "ggx",
            "masking": MASKING,
            "recipes": many_materials(self.N, seed),
            "materials": self.N,
            "blended": self.n,
            "patches": self.patches,
            "noise_percent": NOISE_PERCENT,
        }


# 50,000 triangles are 4 rows^2 of a blob or a plate, 12 rows^2 of a knot.
TABLE = (
    Row("Bear", 1, 1, 10, 12, "blob", 116, 7.0),
    Row("Kitty", 5, 2, 8, 123, "blob", 116, 7.0),
    Row("Billiard", 20, 2, 6, 152, "sphere", 96, 5.0),
    Row("PaintSph", 17, 5, 6, 280, "sphere", 96, 5.0),
    Row("Pig", 54, 4, 8, 310, "knot", 68, 7.0, 1024),
    Row("Mouse", 26, 3, 9, 253, "knot", 68, 7.0, 1024),
    Row("DustSph", 22, 3, 5, 190, "sphere", 96, 5.0),
    Row("CopperPlt", 45, 5, 18, 298, "plate", 116, 7.0),
)
ROWS = {row.name: row for row in TABLE}
NOISE_PERCENT = 1.0
MASKING = "smith:0.3"
"""Beyond either basis."""

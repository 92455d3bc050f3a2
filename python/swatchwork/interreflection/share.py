# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How much of the light that the object shows came by way of the object itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..observe import Rendering, stratified
from .bounce import Reflecting

TEXELS = 4000


@dataclass(frozen=True)
class IndirectShare:
    """Share of the radiance shown to the photographs that is indirect, over the surface that they see."""

    median: float
    ninth_tenth: float
    """A tenth of the surface has more."""
    last_hundredth: float
    """A hundredth of it has more."""

    def in_words(self) -> str:
        """A part of a sentence."""
        half, tenth, hundredth = (
            f"{100 * share:.1f} %" for share in (self.median, self.ninth_tenth, self.last_hundredth)
        )
        return (
            f"light by way of the object itself is {half} of what the typical point shows, "
            f"over {tenth} at a tenth of the points and over {hundredth} at a hundredth"
        )


def indirect_share(rendering: Rendering, surface: Reflecting, seed: int = 0) -> IndirectShare:
    """What of the modelled light is indirect, at an even sample of the texels.

    Args:
        rendering: under the indirect light.
        surface: the material.
    """
    pairs = rendering.pairs(stratified(rendering.observations, TEXELS, seed))
    known = surface.basis, surface.representatives, pairs
    blend = surface.blend(pairs.seen.texel)
    total, direct = (
        np.add.reduceat(
            np.einsum("pn,pnc->p", blend, of.representatives(*known), dtype=np.float64), pairs.offsets[:-1]
        )
        for of in (rendering, rendering.under(None))
    )
    share = np.clip(1 - direct / np.maximum(total, 1e-30), 0, 1)
    return IndirectShare(*(float(q) for q in np.quantile(share, [0.5, 0.9, 0.99])))

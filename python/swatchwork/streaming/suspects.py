# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What is known of each photograph against the others, what is done with it, and how that is said."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from ..arrays import F64, Bool
from ..errors import InputError
from ..keeping import Array, Kept

Kind = Literal["", "exposure", "pose", "light", "disagrees"]
FrameScale = Literal["off", "suspects", "all"]

FEWEST_FRAMES = 4
"""Photographs below which suspects are named but kept: of three, the wrong one may have had its way."""
UNJUDGED = 0.6
"""Misfit of the typical photograph from which a wrong one may not stand out: with a fifth of the pixels
outliers it is 0.5, and double exposures and poses 5 degrees off are found; with a third of them it is 0.8,
and neither is."""
TINTED = 1.1
"""Between the scales of two channels, from where white balance is worth a word."""


@dataclass(frozen=True)
class FrameOptions:
    """What is done with photographs that the others do not agree with."""

    scale: FrameScale = "suspects"
    """Whose exposure is corrected: of none (suspects are left out), of suspects, or of every photograph.

    A corrected photograph serves as well as a sound one: of four captures of ten, novel-light NRMS is 0.75,
    0.85, 1.0 and 1.34 times that without it.
    """
    keep_suspects: bool = False
    """Name them, and use them as they are."""

    def __post_init__(self) -> None:
        if self.keep_suspects and self.scale == "all":
            raise InputError(
                "photographs are to be used as they are, and every exposure to be corrected",
                expected="--keep-suspects or --frame-scale all, not both",
            )


@dataclass(frozen=True)
class Evidence:
    """A photograph beside what the others foretell of it."""

    name: str
    points: int = 0
    """Surface points that it was compared at."""
    scale: float = 1.0
    """Median of shown over foretold radiance."""
    scale_error: float = 0.0
    """Standard error of its logarithm."""
    channels: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """The same by channel."""
    misfit: float = 0.0
    """Mean loss, 0 to 1, after the scale."""
    kind: Kind = ""
    """What is wrong."""
    about: str = ""
    """What a wrong pose is turned about: ``object`` or ``camera``."""
    degrees: float = 0.0
    """That pose or light fits best turned by."""
    explained: float = 0.0
    """Misfit that is left then."""


@dataclass(frozen=True)
class Diagnosis:
    """All photographs' evidence, and what follows from it."""

    frames: tuple[Evidence, ...]
    options: FrameOptions

    @property
    def acts(self) -> bool:
        """Whether suspects are scaled or left out."""
        return not self.options.keep_suspects and len(self.frames) >= FEWEST_FRAMES

    @property
    def suspects(self) -> tuple[Evidence, ...]:
        """Photographs with something wrong."""
        return tuple(frame for frame in self.frames if frame.kind)

    @property
    def left_out(self) -> Bool:
        """[k]"""
        return np.array([self._leaves_out(frame) for frame in self.frames])

    def _leaves_out(self, frame: Evidence) -> bool:
        scaled = frame.kind == "exposure" and self.options.scale != "off"
        return self.acts and bool(frame.kind) and not scaled

    @property
    def scale(self) -> F64:
        """[k] that each photograph's radiance is to be divided by."""
        return np.array([frame.scale if self._scales(frame) else 1.0 for frame in self.frames])

    def _scales(self, frame: Evidence) -> bool:
        every = self.options.scale == "all"
        slipped = frame.kind == "exposure" and self.options.scale == "suspects"
        return self.acts and (every or slipped) and not self._leaves_out(frame)

    @property
    def changes(self) -> bool:
        """Whether the measurements are others than the photographs'."""
        return bool(self.left_out.any() or (self.scale != 1).any())

    @property
    def usual(self) -> float:
        """Misfit of the typical photograph."""
        return float(np.median([f.misfit for f in self.frames if f.points and not f.kind] or [0.0]))

    @property
    def doubt(self) -> str:
        """Why photographs may be wrong that are not named, in words; empty where none can be."""
        if self.usual <= UNJUDGED:
            return ""
        return (
            f"too many contradictions to judge single photographs (the typical misfit is {self.usual:.2f}, "
            f"expected at most {UNJUDGED:g})"
        )

    def in_words(self) -> list[str]:
        """A sentence or two for each suspect, and one where exposures cannot be corrected as was asked."""
        said = [self._said(frame, self.usual) for frame in self.suspects]
        if self.options.scale == "all" and not self.acts:
            said.append(
                f"exposures were left as they are: {len(self.frames)} photographs, expected at least "
                f"{FEWEST_FRAMES} to tell whose is off. Add photographs or leave out --frame-scale all."
            )
        return said

    def _said(self, frame: Evidence, usual: float) -> str:
        if frame.kind == "exposure":
            high, low = max(frame.channels), min(frame.channels)
            what = (
                f"is {frame.scale:.2f} times as bright as the other photographs foretell "
                f"(+- {100 * frame.scale_error:.1f} %)"
            )
            if high > TINTED * low:
                what += f", red, green and blue {', '.join(f'{c:.2f}' for c in frame.channels)} times"
            advice = 'Check its "exposure", and that automatic exposure and white balance were off.'
        elif frame.kind == "disagrees":
            what = (
                f"shows something else than the other photographs foretell (misfit {frame.misfit:.2f}, "
                f"theirs {usual:.2f}), and neither its exposure nor a turn of its camera or light explains it"
            )
            advice = "Check that it belongs to this object, and its pose, mask and light."
        else:
            turned = {
                "object": "its camera moved around the object",
                "camera": "its camera turned where it stands",
                "": "its light turned about the vertical",
            }[frame.about]
            what = (
                f"fits the others best with {turned} by {frame.degrees:.1f} degrees (misfit "
                f"{frame.explained:.2f} instead of {frame.misfit:.2f})"
            )
            advice = (
                "Register it anew." if frame.kind == "pose" else "Check its environment's transform_matrix."
            )
        return f"frame {frame.name} {what}; {self._done(frame)}. {advice}"

    def _done(self, frame: Evidence) -> str:
        if not self.acts:
            kept = "it was kept"
            return kept if self.options.keep_suspects else f"{kept}, for there are too few to do without"
        return "it was left out" if self._leaves_out(frame) else "it was scaled to them"

    def as_dict(self) -> dict[str, Any]:
        """For JSON: what was found, and what was done."""
        done = [
            "left out" if out else "scaled" if scale != 1 else ""
            for out, scale in zip(self.left_out, self.scale, strict=True)
        ]
        return {
            "options": asdict(self.options),
            "doubt": self.doubt,
            "frames": [asdict(frame) | {"done": what} for frame, what in zip(self.frames, done, strict=True)],
        }

    def arrays(self) -> dict[str, Array]:
        """Everything, as an array that ``of`` reads."""
        text = json.dumps({"frames": [asdict(f) for f in self.frames], "options": asdict(self.options)})
        return {"diagnosis": np.frombuffer(text.encode(), dtype=np.uint8)}

    @classmethod
    def of(cls, kept: Kept) -> Diagnosis:
        """The diagnosis whose ``arrays`` were kept."""
        found = json.loads(kept.rows("diagnosis").tobytes())
        frames = [Evidence(**(frame | {"channels": tuple(frame["channels"])})) for frame in found["frames"]]
        return cls(tuple(frames), FrameOptions(**found["options"]))

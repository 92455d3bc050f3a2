# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What svbrdf.json may hold under its keys: types and ranges, so that nothing else passes in silence.

Each check raises TypeError or ValueError that says what it found; the reader adds the file. Keys that are
not known here are left alone: later versions may write more.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

Check = Callable[[str, Any], object]

LONGEST = 4096
"""Characters of a word: a status, a name of a kernel or file, a sentence about a photograph."""


def check_record(head: Mapping[str, Any]) -> None:
    """Everything whose shape is not checked where it is used."""
    table("", head, HEAD)
    solver, penalties = head["solver"], head["penalties"]
    for penalty, value in penalties.items():
        number(f"penalties.{penalty}", value)
    if solver and not penalties:
        raise ValueError("penalties is empty, and the solver's record is there")
    for key, own in (("N", head["N"]), ("n", head["n"])):
        if key in solver and solver[key] != own:
            raise ValueError(f"solver.{key} is {solver[key]}, and {key} is {own}")
    for name, print_ in head["inputs"].items():
        word(f"inputs.{name}", print_)


def number(name: str, value: Any, *, least: float = 0.0) -> float:
    """Finite, and 0 or more; true is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{name} is {value!r:.40}, no number")
    if not math.isfinite(value) or value < least:
        raise ValueError(f"{name} is {value!r:.40}")
    return float(value)


def any_number(name: str, value: Any) -> float:
    """Finite, of either sign."""
    return number(name, value, least=-math.inf)


def perhaps(check: Check) -> Check:
    """null, too: JSON has no NaN."""
    return lambda name, value: None if value is None else check(name, value)


def whole(name: str, value: Any) -> int:
    """An integer from 0 on; true is none."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise TypeError(f"{name} is {value!r:.40}, no whole number from 0 on")
    return value


def word(name: str, value: Any) -> str:
    """A string that is not a book."""
    if not isinstance(value, str) or len(value) > LONGEST:
        raise TypeError(f"{name} is {value!r:.40}, no word")
    return value


def flag(name: str, value: Any) -> bool:
    """true or false."""
    if not isinstance(value, bool):
        raise TypeError(f"{name} is {value!r:.40}, not true or false")
    return value


def listed(check: Check, *, least: int = 0) -> Check:
    """A list of such values."""

    def each(name: str, value: Any) -> None:
        if not isinstance(value, list) or len(value) < least:
            raise TypeError(f"{name} is {value!r:.40}, no list of {least} or more")
        for i, item in enumerate(value):
            check(f"{name}.{i}", item)

    return each


def table(name: str, value: Any, keys: Mapping[str, Check]) -> None:
    """An object; of ``keys``, those that are there."""
    if not isinstance(value, dict):
        raise TypeError(f"{name or 'it'} is {value!r:.40}, no object")
    for key, check in keys.items():
        if key in value:
            check(f"{name}.{key}".lstrip("."), value[key])


def of(**keys: Check) -> Check:
    """An object with values so typed under these keys, where they are there."""
    return lambda name, value: table(name, value, keys)


_STEP = of(n=whole, N=whole, alternations=whole, move=word, data=perhaps(number), objective=perhaps(number))
_FRAME = of(
    **dict.fromkeys(("name", "about", "done", "kind"), word),
    **dict.fromkeys(("degrees", "explained", "misfit", "scale", "scale_error"), perhaps(any_number)),
    points=whole,
    channels=listed(perhaps(any_number)),
)
_SOLVER = of(
    n=whole,
    N=whole,
    status=word,
    weighting=word,
    **dict.fromkeys(("data", "objective", "lambda0", "lambda1", "noise"), perhaps(number)),
    history=listed(_STEP),
    outliers=perhaps(of(**dict.fromkeys(("scale", "left_out", "undecided"), perhaps(number)))),
    left_out_by_frame=listed(perhaps(number)),
    photographs=of(frames=listed(_FRAME), options=of(scale=word, keep_suspects=flag)),
    interreflections=of(rounds=whole, indirect=of()),
)
_TRUST = of(
    appearance=listed(listed(any_number)),
    **dict.fromkeys(("mean", "spread", "coefficients"), listed(any_number)),
    held_out=whole,
)
HEAD: dict[str, Check] = {
    "n": whole,
    "N": whole,
    "schema_version": whole,
    "resolution": listed(whole),
    "basis": of(
        name=word,
        sigmas=listed(number),
        maskings=listed(word),
        diffuse=listed(word),
        fresnel=listed(whole),
    ),
    "representatives": listed(listed(listed(number))),
    "penalties": of(),
    "solver": _SOLVER,
    "trust": perhaps(_TRUST),
    "spread": perhaps(listed(number)),
    "inputs": of(),
    "mesh": of(vertices=whole, faces=whole),
}
"""By key."""

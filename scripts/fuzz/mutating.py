# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a mutation is, the list of all of them, and which a seed picks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

Make = Callable[[Path, Random], str | None]
"""Spoils a folder and says what it did; None where the folder has nothing of the kind, and is left alone."""


@dataclass(frozen=True)
class Mutation:
    """One way to spoil a capture."""

    name: str
    kind: str
    """What it is about: json, images, meshes, folder. A case takes one of a kind."""
    violation: str | None
    """The class of violation that it certainly makes, which must be reported; None: it may be harmless."""
    make: Make


ALL: dict[str, list[Mutation]] = {}
"""By kind."""


def mutation(kind: str, violation: str | None) -> Callable[[Make], Make]:
    """Put a function on the list of its kind."""

    def listed(make: Make) -> Make:
        ALL.setdefault(kind, []).append(Mutation(make.__name__.strip("_"), kind, violation, make))
        return make

    return listed


@dataclass(frozen=True)
class Done:
    """A mutation that was made."""

    name: str
    kind: str
    violation: str | None
    what: str


def spoil(folder: Path, rng: Random, kinds: tuple[str, ...]) -> list[Done]:
    """One to three mutations of different kinds.

    The JSON goes last: what it no longer names would hide a mutation of that file, and the mutations of it
    that may be harmless take no file out.
    """
    wanted = rng.sample(kinds, k=min(len(kinds), rng.choices((1, 2, 3), weights=(6, 3, 1))[0]))
    done = []
    for kind in sorted(wanted, key=lambda kind: (kind == "folder", kind == "json")):
        for _ in range(20):
            chosen = rng.choice(ALL[kind])
            what = chosen.make(folder, rng)
            if what is not None:
                done.append(Done(chosen.name, kind, chosen.violation, what))
                break
    return done


def some_file(folder: Path, rng: Random, *suffixes: str) -> Path | None:
    """One of the folder's files with such a name."""
    found = sorted(f for f in folder.rglob("*") if f.suffix.lower() in suffixes and f.is_file())
    return rng.choice(found) if found else None


def flipped(content: bytes, rng: Random, start: int = 0) -> bytes:
    """A few bits turned, from a byte on."""
    changed = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        if len(changed) > start:
            changed[rng.randrange(start, len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)

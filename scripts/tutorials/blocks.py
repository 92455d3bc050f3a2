# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What a tutorial's Markdown holds for the runner: blocks to run, output to show, pictures to make.

```sh                     run by bash, in the tutorials' folder; stops at the first command that fails
```python                 run by this Python, in a process of its own
```sh by-hand             not run: a person does it, with a browser and a mouse
```text                   right after a block: what it printed; rewritten
<!-- picture: ... -->     on the line before ![...](pictures/NAME): how that picture is made (see pictures.py)
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

FENCE = re.compile(r"^```(\S*)[ ]*(.*)$")
PICTURE = re.compile(r"^<!-- picture: (.*) -->$")
IMAGE = re.compile(r"^!\[[^\]]*\]\(([^)\s]+)\)$")
LANGUAGES = ("sh", "python")
BY_HAND = "by-hand"


class TutorialError(Exception):
    """A tutorial that cannot be read or run, with the file's name and the line."""


@dataclass(frozen=True)
class Block:
    """A fenced block to run.

    ``first_line`` is that of its fence, from 1; ``shown`` are the lines [first, last) from 0 of the text
    block that shows what it printed, without its fences, or None.
    """

    language: str
    code: str
    first_line: int
    by_hand: bool
    shown: tuple[int, int] | None


@dataclass(frozen=True)
class Picture:
    """A picture to make: the words of its recipe, and its file as the Markdown names it."""

    recipe: str
    file: str
    first_line: int


def steps_of(file: Path, text: str) -> list[Block | Picture]:
    """Blocks and pictures in their order.

    Raises:
        TutorialError: a fence is not closed or of another language, a text block follows no block, or a
            picture's recipe has no image below it.
    """
    lines = text.split("\n")
    steps: list[Block | Picture] = []
    at, last = 0, None
    while at < len(lines):
        if lines[at].startswith("<!-- picture"):
            recipe, image = (
                PICTURE.match(lines[at]),
                IMAGE.match(lines[at + 1] if at + 1 < len(lines) else ""),
            )
            if recipe is None or image is None:
                raise TutorialError(f"{file}:{at + 1}: expected <!-- picture: RECIPE -->, then ![...](FILE)")
            steps.append(Picture(recipe[1], image[1], at + 1))
            at, last = at + 2, None
            continue
        fence = FENCE.match(lines[at])
        if fence is None:
            # Only empty lines may lie between a block and what it printed.
            last = last if not lines[at].strip() else None
            at += 1
            continue
        end = next((i for i in range(at + 1, len(lines)) if lines[i] == "```"), None)
        if end is None:
            raise TutorialError(f"{file}:{at + 1}: this block is not closed")
        language, mark = fence[1], fence[2].strip()
        if language == "text":
            if last is None:
                raise TutorialError(f"{file}:{at + 1}: a text block shows what the block before it printed")
            steps[-1] = _showing(steps[-1], (at + 1, end))
            last = None
        elif language in LANGUAGES and mark in ("", BY_HAND):
            code = "\n".join(lines[at + 1 : end]) + "\n"
            steps.append(Block(language, code, at + 1, mark == BY_HAND, None))
            last = None if mark == BY_HAND else at
        else:
            raise TutorialError(
                f"{file}:{at + 1}: a block of type {fence[0][3:]!r}; expected sh, python, text or sh by-hand"
            )
        at = end + 1
    return steps


def _showing(step: Block | Picture, shown: tuple[int, int]) -> Block:
    assert isinstance(step, Block)
    return Block(step.language, step.code, step.first_line, step.by_hand, shown)


def with_output(text: str, printed: Sequence[tuple[Block, str]]) -> str:
    """The Markdown with what each block printed in the text block that follows it, where there is one."""
    lines = text.split("\n")
    # From the end, so that the places of those before stay what they were.
    for block, output in sorted(printed, key=lambda pair: -pair[0].first_line):
        if block.shown is not None:
            lines[slice(*block.shown)] = output.rstrip("\n").split("\n") if output.strip() else []
    return "\n".join(lines)


# ---- What differs from run to run ----------------------------------------------------------------
ELIDED = (
    (re.compile(r"\b\d+(?:\.\d+)? s\b"), "... s"),
    (re.compile(r"\b\d+(?:\.\d+)? min\b"), "... min"),
    (re.compile(r"\b\d+(?:\.\d+)? [kMG]B\b"), "... MB"),
)
"""Durations and sizes in memory or on disk are printed as ... so that a second run changes nothing."""


def normalised(output: str, folder: Path) -> str:
    """What is shown of what was printed: no durations, sizes, absolute places, or spaces at a line's end."""
    for pattern, words in ELIDED:
        output = pattern.sub(words, output)
    output = output.replace(f"{folder}/", "").replace(str(folder), ".")
    return "\n".join(line.rstrip() for line in output.strip("\n").split("\n"))

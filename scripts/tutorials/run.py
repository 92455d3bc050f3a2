# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Run the tutorials: every block in order, what it prints written under it, every picture made anew.

    python scripts/tutorials/run.py                                          # all of docs/tutorials
    python scripts/tutorials/run.py docs/tutorials/reading_the_analysis.md   # one, in an empty folder

The blocks run in target/tutorials, which is emptied first. The run ends with exit code 1 at the first block
that fails, and names it; the tutorial's file is then left as it was. Durations and sizes are elided
(blocks.py) and a picture that looks the same is not rewritten (pictures.py), so that `git diff` shows what
changed. Pictures of pages need playwright and Chromium; without them they are skipped, which is said, and the
old ones stay.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pictures
from blocks import Block, TutorialError, normalised, steps_of, with_output

ROOT = Path(__file__).resolve().parents[2]
TUTORIALS = ROOT / "docs" / "tutorials"
ORDER = ("first_reconstruction", "your_own_capture", "reading_the_analysis")
SCRATCH = ROOT / "target" / "tutorials"
WARNING = "warning: "


def environment() -> dict[str, str]:
    """This environment's `swatchwork` and `python` first; no colours; one width, whatever the terminal."""
    own = Path(sys.executable).parent
    path = f"{own}{os.pathsep}{os.environ.get('PATH', '')}"
    return os.environ | {"PATH": path, "NO_COLOR": "1", "COLUMNS": "110", "PYTHONUNBUFFERED": "1"}


def run_block(file: Path, block: Block, folder: Path) -> str:
    """What the block prints, normalised: standard output, and warnings before it, but no progress.

    Raises:
        TutorialError: it fails.
    """
    command = ["bash", "-euo", "pipefail", "-c", block.code]
    if block.language == "python":
        command = [sys.executable, "-c", block.code]
    done = subprocess.run(
        command,
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    if done.returncode != 0:
        raise TutorialError(
            f"{file}:{block.first_line}: this {block.language} block failed (exit code {done.returncode})\n"
            f"{block.code}{done.stdout}{done.stderr}"
        )
    warnings = "".join(f"{line}\n" for line in done.stderr.splitlines() if line.startswith(WARNING))
    return normalised(warnings + done.stdout, folder)


def run_tutorial(file: Path, folder: Path, *, blocks: int | None = None, write: bool = True) -> list[str]:
    """Run a tutorial's steps in ``folder``; rewrite its output and pictures unless ``write`` is off.

    Args:
        blocks: only so many blocks from the first, and no pictures after the last of them.

    Returns:
        What was skipped, in words.

    Raises:
        TutorialError: a block fails, or the tutorial cannot be read.
    """
    text = file.read_text(encoding="utf-8")
    printed: list[tuple[Block, str]] = []
    skipped: list[str] = []
    for step in steps_of(file, text):
        if isinstance(step, Block):
            if step.by_hand:
                continue
            if blocks is not None and len(printed) == blocks:
                break
            start = time.perf_counter()
            printed.append((step, run_block(file, step, folder)))
            print(f"{file.name}:{step.first_line}: {time.perf_counter() - start:.0f} s", flush=True)
        elif write:
            try:
                pictures.make(step.recipe, folder, file.parent / step.file)
            except pictures.NoBrowser as error:
                skipped.append(f"{step.file}: skipped, the old picture stays ({error})")
            except (OSError, ValueError) as error:
                raise TutorialError(f"{file}:{step.first_line}: no picture: {error}") from error
    if write:
        file.write_text(with_output(text, printed), encoding="utf-8")
    return skipped


def emptied(folder: Path) -> Path:
    """The folder, with nothing in it."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("tutorials", nargs="*", type=Path, help="Markdown files (default: all, in order)")
    parser.add_argument("--folder", type=Path, default=SCRATCH, help="to run in; emptied (target/tutorials)")
    given = parser.parse_args(arguments)
    folder = emptied(given.folder.resolve())
    skipped = []
    try:
        for file in given.tutorials or [TUTORIALS / f"{name}.md" for name in ORDER]:
            skipped += run_tutorial(file, folder)
    except TutorialError as error:
        print(error, file=sys.stderr)
        return 1
    print("\n".join(skipped) if skipped else "every block ran, every picture was made")
    return 0


if __name__ == "__main__":
    sys.exit(main())

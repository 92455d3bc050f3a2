# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The tutorials' pictures, each from a recipe beside it in the Markdown.

    row FILE FILE ...           images side by side on white; the EXRs of a row are equally bright
    page FILE SELECTOR          part of a page that was written, as a headless Chromium shows it
    viewer FILE                 the interactive page, a few passes of its still picture drawn

Pictures are small, for a page on GitHub. One that looks the same as the file that is there is not written:
other processors and browsers round differently, and `git diff` is to show what changed.
"""

from __future__ import annotations

import shlex
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Pillow

from swatchwork.arrays import U8
from swatchwork.capture import read_image

ROW_PX, GAP_PX, WIDEST_PX = 240, 12, 960
LARGEST_BYTES = 150_000
QUALITY = 88
SAME_LEVELS, BLOCK_PX = 2.0, 16
"""A picture is the same if no block of 16 x 16 pixels differs by more than 2 of 255 levels in the mean."""
WINDOW = {"width": 960, "height": 620}
VIEWER_WINDOW = {"width": 720, "height": 420}
PASSES, FINISHED_AFTER_S = 4, 400
"""Of the 64 of a finished still picture: software takes seconds for each, and the rest changes little."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]


class NoBrowser(Exception):
    """A picture of a page, and nothing to take it with."""


def make(recipe: str, folder: Path, file: Path) -> bool:
    """Make a picture of what lies in ``folder``; whether ``file`` was written.

    Raises:
        NoBrowser: it is one of a page, and playwright or Chromium is missing.
        ValueError: the recipe is not understood, or the picture comes out too large.
    """
    kind, *words = shlex.split(recipe)
    makers: dict[str, Callable[[list[Path | str]], Pillow.Image]] = {
        "row": lambda given: row([Path(g) for g in given]),
        "page": lambda given: of_page(Path(given[0]), str(given[1])),
        "viewer": lambda given: of_viewer(Path(given[0])),
    }
    if kind not in makers or len(words) != {"row": len(words) or 1, "page": 2, "viewer": 1}[kind]:
        raise ValueError(f"{recipe!r}: expected row FILE ..., page FILE SELECTOR, or viewer FILE")
    places: list[Path | str] = [
        folder / word if kind != "page" or i == 0 else word for i, word in enumerate(words)
    ]
    picture = makers[kind](places)
    if picture.width > WIDEST_PX:
        picture = picture.resize(
            (WIDEST_PX, round(picture.height * WIDEST_PX / picture.width)), Pillow.Resampling.LANCZOS
        )
    coded = encoded(picture, file.suffix)
    if len(coded) > LARGEST_BYTES:
        raise ValueError(
            f"{file.name} has {len(coded)} bytes; expected {LARGEST_BYTES} at most: show less of it"
        )
    if file.exists() and same(file.read_bytes(), coded):
        return False
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(coded)
    return True


def encoded(picture: Pillow.Image, suffix: str) -> bytes:
    """A PNG, or a JPEG for photographs."""
    out = BytesIO()
    if suffix == ".jpg":
        picture.convert("RGB").save(out, "JPEG", quality=QUALITY)
    else:
        picture.convert("RGB").save(out, "PNG", optimize=True)
    return out.getvalue()


def same(old: bytes, new: bytes) -> bool:
    """Whether two coded pictures look the same."""
    a, b = (np.asarray(Pillow.open(BytesIO(data)).convert("RGB"), np.float64) for data in (old, new))
    if a.shape != b.shape:
        return False
    off = np.abs(a - b).mean(axis=2)
    off = np.pad(off, [(0, -length % BLOCK_PX) for length in off.shape])
    blocks = off.reshape(off.shape[0] // BLOCK_PX, BLOCK_PX, -1, BLOCK_PX).mean(axis=(1, 3))
    return bool(blocks.max() <= SAME_LEVELS)


# ---- Images --------------------------------------------------------------------------------------
def row(files: list[Path]) -> Pillow.Image:
    """Images at one height, left to right, on white."""
    linear = {file: read_image(file) for file in files if file.suffix == ".exr"}
    # Highlights of a hundredth of the object may be white.
    lit = [image.linear[alpha_of(image) > 0.5] for image in linear.values()]
    white = float(np.quantile(np.concatenate(lit), 0.98)) if lit else 1.0
    cells = []
    for file in files:
        if file in linear:
            shown = on_white(linear[file].linear / white, alpha_of(linear[file]))
        else:
            picture = Pillow.open(file).convert("RGBA")
            shown = np.asarray(Pillow.alpha_composite(Pillow.new("RGBA", picture.size, "white"), picture))[
                ..., :3
            ]
        size = round(shown.shape[1] * ROW_PX / shown.shape[0]), ROW_PX
        cells.append(np.asarray(Pillow.fromarray(shown).resize(size, Pillow.Resampling.LANCZOS)))
    gap = np.full((ROW_PX, GAP_PX, 3), 255, np.uint8)
    return Pillow.fromarray(np.hstack([part for cell in cells for part in (cell, gap)][:-1]))


def alpha_of(image: Any) -> np.ndarray:
    """Coverage [H, W]; 1 of images without."""
    return np.ones(image.linear.shape[:2], np.float32) if image.alpha is None else image.alpha


def on_white(premultiplied: np.ndarray, alpha: np.ndarray) -> U8:
    """Linear radiance over white, as displayed."""
    shown = np.clip(premultiplied + (1 - alpha[..., None]), 0, 1) ** (1 / 2.2)
    return np.asarray(shown * 255 + 0.5).astype(np.uint8)


# ---- Pages ---------------------------------------------------------------------------------------
@contextmanager
def browsing(file: Path, window: dict[str, int]) -> Iterator[Any]:
    """The page in a headless browser, in light colours."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        raise NoBrowser("playwright is not installed") from error
    found = next((path for path in map(shutil.which, BROWSERS) if path), None)
    if found is None:
        raise NoBrowser("there is no Chromium on this machine")
    if not file.is_file():
        raise ValueError(f"{file} is not there")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=FLAGS)
        page = browser.new_page(viewport=window, color_scheme="light")
        page.goto(file.resolve().as_uri())
        yield page
        browser.close()


def of_page(file: Path, selector: str) -> Pillow.Image:
    """The first element that a selector of playwright finds."""
    with browsing(file, WINDOW) as page:
        found = page.locator(selector)
        if found.count() == 0:
            raise ValueError(f"{file.name} has nothing that {selector} finds")
        return Pillow.open(BytesIO(found.first.screenshot()))


def of_viewer(file: Path) -> Pillow.Image:
    """The whole window, once a few passes of the still picture are drawn."""
    with browsing(file, VIEWER_WINDOW) as page:
        page.evaluate("swatchworkReady")
        end = time.monotonic() + FINISHED_AFTER_S
        # The page's policy forbids what playwright's own wait does.
        while (passes := page.evaluate("swatchwork.stage.stats.passes")) < PASSES:
            if time.monotonic() > end:
                raise ValueError(
                    f"{file.name}: {passes} passes after {FINISHED_AFTER_S} s; expected {PASSES}"
                )
            time.sleep(0.2)
        page.evaluate("swatchwork.stage.paused = true")
        return Pillow.open(BytesIO(page.screenshot()))

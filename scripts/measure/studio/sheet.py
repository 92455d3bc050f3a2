# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A contact sheet of the whole way: what the camera wrote, poses, light, and what comes out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pillow

from swatchwork.arrays import F32, F64, U8, Float
from swatchwork.capture import Camera, read_image
from swatchwork.light import Environment
from swatchwork.relight import see
from swatchwork.surface import Mesh, RayScene

from .figures import on_map

CELL = (360, 270)
CAPTION_PX = 24
OUTLINE = (255, 40, 160)
MAP_WIDTH = 256


@dataclass(frozen=True, eq=False)
class Story:
    """What is shown."""

    taken: Sequence[Sequence[Path]]
    of_balls: Sequence[Sequence[Path]]
    linear: Sequence[Float]
    cameras: Sequence[Camera]
    mesh: Mesh
    light: Environment
    found_light: Environment
    scale: F64
    tests: Sequence[F32]
    renders: Path
    perfect_renders: Path


def write(file: Path, story: Story) -> None:
    """Write the sheet as a JPEG."""
    bright = 0.8 / float(np.quantile(story.linear[0], 0.98))
    rows = [_card(story), _poses(story, bright), _lights(story), *_outcome(story)]
    sheet = np.vstack([np.hstack(row) for row in rows])
    file.parent.mkdir(parents=True, exist_ok=True)
    Pillow.fromarray(sheet).save(file, quality=88)


def _card(story: Story) -> list[U8]:
    first = story.taken[0]
    cells = [_cell(_file(f), f"{f.name}: a bracket") for f in first]
    ball = story.of_balls[0][len(story.of_balls[0]) // 2]
    return [*cells, _cell(_file(ball), f"{ball.name}: the ball")]


def _poses(story: Story, bright: float) -> list[U8]:
    rays = RayScene([story.mesh])
    cells = []
    for i in np.linspace(0, len(story.cameras) - 1, 4).round().astype(int):
        picture = _shown(story.linear[i] * bright)
        on = (see(rays, story.cameras[i], 1).alpha > 0.5).astype(np.uint8)
        lines, _ = cv2.findContours(on, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(picture, lines, -1, OUTLINE, 2)
        cells.append(_cell(picture, f"view {i + 1}, linear; the mesh's outline by its pose"))
    return cells


def _lights(story: Story) -> list[U8]:
    true = on_map(story.light, MAP_WIDTH)
    found = on_map(story.found_light, MAP_WIDTH) / story.scale
    bright = 0.5 / float(np.median(true.max(axis=-1)))
    off = np.abs(found - true).mean(axis=-1, keepdims=True) / true.mean()
    pictures = (_shown(true * bright), _shown(found * bright), _shown(np.repeat(off, 3, axis=-1)))
    words = ("the true light", "the light from the balls", "difference over the mean, white at 1")
    cells = [_cell(picture, text) for picture, text in zip(pictures, words, strict=True)]
    return [*cells, np.full_like(cells[0], 255)]


def _outcome(story: Story) -> list[list[U8]]:
    """Two novel views under the novel light: true, from photographs, from the perfect capture."""
    rows = []
    for i, test in enumerate(story.tests[:2]):
        true = test[..., :3]
        on = test[..., 3] > 0.5
        bright = 0.9 / float(np.quantile(true[on], 0.97))
        ours, perfect = (
            read_image(folder / f"T{i + 1:02d}.exr").linear
            for folder in (story.renders, story.perfect_renders)
        )
        off = np.repeat(np.abs(ours - true).mean(axis=-1, keepdims=True), 3, axis=-1)
        pictures = [true, ours, perfect, off]
        words = ("novel light and view, true", "from photographs", "from the perfect capture")
        words += ("difference from photographs",)
        rows.append(
            [_cell(_cropped(_shown(p * bright), on), w) for p, w in zip(pictures, words, strict=True)]
        )
    return rows


def _cropped(picture: U8, on: np.ndarray) -> U8:
    """The object with a little around it."""
    y, x = np.nonzero(on)
    top, left = max(0, y.min() - 8), max(0, x.min() - 8)
    return picture[top : y.max() + 8, left : x.max() + 8]


def _file(file: Path) -> U8:
    picture = cv2.imread(str(file))
    return np.asarray(picture[..., ::-1], dtype=np.uint8)


def _shown(linear: Float) -> U8:
    return (np.clip(linear, 0, 1) ** (1 / 2.2) * 255 + 0.5).astype(np.uint8)


def _cell(picture: U8, caption: str) -> U8:
    """A picture fitted into a cell, its caption below."""
    width, height = CELL
    scale = min((width - 4) / picture.shape[1], (height - 4) / picture.shape[0])
    size = (max(1, int(picture.shape[1] * scale)), max(1, int(picture.shape[0] * scale)))
    small = cv2.resize(
        np.ascontiguousarray(picture), size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    )
    cell = np.full((height + CAPTION_PX, width, 3), 255, np.uint8)
    top, left = (height - size[1]) // 2, (width - size[0]) // 2
    cell[top : top + size[1], left : left + size[0]] = small
    at = (6, height + CAPTION_PX - 8)
    cv2.putText(cell, caption, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, (40, 40, 40), 1, cv2.LINE_AA)
    return cell

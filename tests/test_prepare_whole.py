# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From a camera's JPEG brackets of a made-up object to its material, by the commands' own steps."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from swatchwork import ReconstructOptions
from swatchwork.capture import read_image
from swatchwork.prepare import LinearizeOptions
from swatchwork.simulate import simulate_capture
from swatchwork.solve import SolveOptions
from swatchwork.workflow import check_capture, linearize_photographs, reconstruct_folder, relight_folder

TIMES = (1 / 800, 1 / 200, 1 / 50, 1 / 12)
GAMMA = 1.9
SCALE = 0.214 / 0.5**GAMMA
"""A recovered response is scaled to sRGB's at half of full scale, where this camera's is 0.5^1.9 = 0.268."""
VIEWS, SIZE = 6, 64


def bracketed(folder: Path, radiance: np.ndarray, name: str) -> list[str]:
    """JPEGs at ISO 100 and f/8, the reference's but for their times: full scale is 1 / (100 time)."""
    names = []
    for i, time in enumerate(TIMES):
        names.append(f"{name}-{i}.jpg")
        exif = Pillow.Exif()
        exif.get_ifd(0x8769).update({33434: time, 33437: 8.0, 34855: 100})
        code = np.clip(radiance * time * 100, 0, 1) ** (1 / GAMMA) * 255
        picture = Pillow.fromarray((code + 0.5).astype(np.uint8))
        picture.save(folder / names[-1], quality=98, subsampling=0, exif=exif)
    return names


def test_jpeg_brackets_become_a_material(tmp_path: Path) -> None:
    capture, card = tmp_path / "capture", tmp_path / "card"
    simulate_capture(
        capture, object_shape="knot", rows=24, k=VIEWS, test_views=1, size=SIZE, materials=2, blended=1
    )
    card.mkdir()
    groups, alphas = {}, {}
    for i in range(VIEWS):
        name = f"{i + 1:04d}"
        image = read_image(capture / f"images/{name}.exr")
        assert image.alpha is not None
        # A dim backdrop: without one the photographs are black beside the object, as none is.
        backdrop = np.linspace(0.05, 0.8, SIZE)[:, None, None] * np.ones(3)
        groups[name] = bracketed(card, image.linear + (1 - image.alpha[..., None]) * backdrop, name)
        alphas[name] = image.alpha
    (tmp_path / "groups.json").write_text(json.dumps(groups), encoding="utf-8")
    options = LinearizeOptions(groups=tmp_path / "groups.json")
    linear = linearize_photographs([card], capture / "linear", options)
    assert (linear.views, linear.photographs, linear.response) == (VIEWS, 4 * VIEWS, "recovered")
    transforms = json.loads((capture / "transforms.json").read_text(encoding="utf-8"))
    for frame in transforms["frames"]:
        name = Path(frame["file_path"]).stem
        Pillow.fromarray(((alphas[name] > 0.99) * 255).astype(np.uint8)).save(capture / f"linear/{name}.png")
        frame |= {"file_path": f"linear/{name}.exr", "mask_path": f"linear/{name}.png"}
        inside = alphas[name] > 0.99
        truth = read_image(capture / f"images/{name}.exr").linear[inside]
        got = read_image(capture / f"linear/{name}.exr")
        # Highlights beyond the shortest exposure's 8.
        assert got.clipped[inside].mean() < 0.03
        bright = (truth > 0.05) & ~got.clipped[inside][:, None]
        ratio = got.linear[inside][bright] / truth[bright]
        # Measured: 0.4 % and 4 % a pixel, of 8 bits and a response from 6 small brackets.
        assert abs(np.median(ratio) / SCALE - 1) < 0.01 and np.log(ratio).std() < 0.06
    found = rendered(capture, transforms, tmp_path / "found") / SCALE
    assert check_capture(capture, tmp_path / "check.html").findings == ()
    truth = read_image(capture / "test/images/0001.exr").linear
    off = np.sqrt(((found - truth) ** 2).sum() / (truth**2).sum())
    # Measured: 0.19; from the radiance itself 0.33: six pictures of 64 pixels and 200 texels tell no more.
    assert off < 0.35


def rendered(capture: Path, transforms: dict, output: Path) -> np.ndarray:
    """The material's image from the test view under the test light."""
    (capture / "transforms.json").write_text(json.dumps(transforms), encoding="utf-8")
    options = ReconstructOptions(32, "paper", texels=200, solve=SolveOptions(n=1, N=2))
    assert reconstruct_folder(capture, output, options).views == VIEWS
    done = relight_folder(output, capture / "test", output.with_name(f"{output.name}-renders"))
    return read_image(Path(done.files[0])).linear

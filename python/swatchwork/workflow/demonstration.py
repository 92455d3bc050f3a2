# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The demo: a made-up capture, its material recovered, relit, measured, and a page about it."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from .. import report as page
from ..arrays import U8
from ..capture import read_capture, read_image, read_photograph
from ..evaluate import Evaluation
from ..progress import SILENT, Progress
from ..reconstruct import ReconstructOptions
from ..relight import Lighting, relight, render
from ..simulate import satin_materials, simulate_capture
from ..solve import SolveOptions
from ..whole import whole_file, whole_folder
from .costs import CostRecorder
from .measuring import evaluate_folders
from .pages import relit
from .pictures import compare_pictures
from .recovery import Recovered, recover
from .viewing import VIEWER

MARKER = "demo.json"
SHAPE, LIGHTS, MATERIALS, BLENDED = "peanut", ("atelier", "overcast"), 4, 2
VIEWS, TEST_VIEWS, SIZE_PX, NOISE_PERCENT = 9, 3, 288, 1.0
MASKING, PATCHES = "smith:0.2", 5.0
"""The truth's lobes are GGX, which the method's bases lack; its masking is one that `extended` has. Its
roughness is 0.08 to 0.3, and no light is small, so that pictures of this size sample highlights well."""
RESOLUTION, TEXELS, EXPLORED = 128, 2000, 500
"""Small enough for a minute on two cores; a capture of one's own takes the defaults of reconstruct."""


@dataclass(frozen=True)
class DemoSummary:
    """What the demo found, against the truth it knows."""

    folder: str
    report: str
    seed: int
    views: int
    n: int
    N: int
    true_n: int
    true_N: int
    misfit: float
    novel_light_nrms: float
    psnr_h: float
    psnr_l: float
    ssim: float
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def in_words(self) -> str:
        """What came out, and where to look next."""
        return (
            f"Recovered {self.N} materials, {self.n} blended at a point, from {self.views} photographs "
            f"(the truth has {self.true_N} and {self.true_n}).\n"
            f"Under a light and from cameras it never saw, it is off by {100 * self.novel_light_nrms:.1f} % "
            f"(NRMS). It took {self.seconds:.0f} s.\n\n"
            f"Look next at\n"
            f"  {self.report}   the page about it, for any browser\n"
            f"  {self.folder}/capture        what a capture looks like; make your own like it\n"
            f"  {self.folder}/material       the material found\n"
            f"Then run  swatchwork reconstruct YOUR-CAPTURE -o YOUR-MATERIAL"
        )


def run_demo(
    folder: str | PathLike[str],
    *,
    seed: int = 0,
    picture: str | PathLike[str] | None = None,
    progress: Progress = SILENT,
) -> DemoSummary:
    """Make a capture up, recover its material, relight it, measure it, write ``folder/report.html``.

    The folder appears whole or not at all; an earlier demo's is replaced.

    Raises:
        InputError: ``folder`` holds something that is not an earlier demo's.
        OutputError: it cannot be written.
    """
    start = time.perf_counter()
    costs = CostRecorder(progress)
    with whole_folder(folder, lambda path: (path / MARKER).is_file(), "an earlier demo") as fresh:
        capture, test = fresh / "capture", fresh / "capture" / "test"
        with costs.stage("make a capture up"):
            simulate_capture(
                capture,
                object_shape=SHAPE,
                rows=64,
                k=VIEWS,
                test_views=TEST_VIEWS,
                size=SIZE_PX,
                seed=seed,
                truth="ggx",
                noise_percent=NOISE_PERCENT,
                lights=LIGHTS,
                materials=MATERIALS,
                blended=BLENDED,
                recipes=satin_materials(seed),
                masking=MASKING,
                patches=PATCHES,
                progress=costs,
            )
        solve = SolveOptions(explore_texels=EXPLORED, seed=seed)
        options = ReconstructOptions(RESOLUTION, texels=TEXELS, solve=solve)
        found = recover(capture, fresh / "material", options, progress=progress)
        with costs.stage("relight"):
            relight(relit(found.reconstruction), read_capture(test), fresh / "renders", progress=costs)
        with costs.stage("evaluate"):
            measured = evaluate_folders(fresh / "renders", test, rim=True, progress=costs)
        summary = _summary(folder, seed, found, measured, time.perf_counter() - start)
        with costs.stage("report"):
            report = demo_report(found, measured, test, fresh / "renders")
            stages = (costs.costs[0], *found.summary.stages, *costs.costs[1:])
            shown = tuple(page.StageCost(c.name, c.seconds, c.peak_mb) for c in stages)
            took = page.Figure(f"{time.perf_counter() - start:.0f} s", "altogether", "photographs included")
            figures = (*report.figures[:-1], took)
            page.write_report(fresh / "report.html", replace(report, costs=shown, figures=figures))
        (fresh / MARKER).write_text(json.dumps(summary.as_dict(), indent=2) + "\n", encoding="utf-8")
    if picture is not None:
        write_picture(Path(picture), report)
    return replace(summary, seconds=time.perf_counter() - start)


def demo_report(found: Recovered, measured: Evaluation, test: Path, renders: Path) -> page.Report:
    """The reconstruction's page, with the test that only a known truth allows."""
    novel = []
    for frame in read_capture(test).frames:
        reference = read_photograph(frame)
        rendered = read_image(renders / Path(frame.name).name)
        alpha = (
            rendered.alpha if rendered.alpha is not None else np.ones(rendered.linear.shape[:2], np.float32)
        )
        pixels = np.concatenate([rendered.linear, alpha[..., None]], axis=-1)
        name, words = f"test/{Path(frame.name).name}", ("the truth", "recovered")
        novel.append(compare_pictures(name, reference.radiance, reference.alpha, pixels, words=words)[0])
    return replace(
        found.report,
        title="A pebble that does not exist",
        summary=(
            f"{VIEWS} photographs of a made-up object in an {LIGHTS[0]}, with {NOISE_PERCENT:g} % noise; the "
            "material recovered from them; and a check against the truth under another light. The truth "
            f"blends {BLENDED} of {MATERIALS} materials at each point. Their highlights are GGX lobes of "
            "roughness 0.08 to 0.3, which the method's basis can only approximate; their masking is one that "
            "it knows."
        ),
        hero=(*found.report.hero, page.Picture("under a light it never saw", relit_first_view(found, test))),
        figures=(
            page.Figure(f"{100 * measured.nrms:.1f} %", "error under new light", "NRMS from unseen cameras"),
            *found.report.figures[1:],
        ),
        novel=tuple(novel),
        viewer=f"material/{VIEWER}",
        novel_light=f"an {LIGHTS[1]} sky; the photographs were taken in an {LIGHTS[0]} with large windows",
        next_steps=(
            ("Your own capture, with a transforms.json like capture/transforms.json here:",
             "swatchwork reconstruct my-capture -o my-material"),
            ("The demo's material under its other light, from its other cameras:",
             "swatchwork relight material --cameras capture/test/transforms.json -o renders"),
            ("Measure those renders:", "swatchwork evaluate renders capture/test --capture"),
        ),
    )  # fmt: skip


def relit_first_view(found: Recovered, test: Path) -> U8:
    """The view of the page's first photograph under the light of the test."""
    held_out, camera = read_capture(test), found.capture.frames[0].camera
    light = Lighting().of(held_out, held_out.frames[0])
    pixels = render(relit(found.reconstruction), camera, light, samples=1)
    shown = compare_pictures("", pixels[..., :3], pixels[..., 3], pixels)[0]
    return shown.rendered.pixels


def write_picture(file: Path, report: page.Report) -> None:
    """The page's opening pictures side by side on white, as one small PNG."""
    pictures = [_on_white(p.pixels) for p in report.hero]
    height = max(p.shape[0] for p in pictures)
    gap = np.full((height, 16, 3), 255, dtype=np.uint8)
    row: list[U8] = []
    for p in pictures:
        padding = height - p.shape[0]
        row += [np.pad(p, ((padding // 2, padding - padding // 2), (0, 0), (0, 0)), constant_values=255), gap]
    with whole_file(file) as made:
        Image.fromarray(np.concatenate(row[:-1], axis=1)).save(made, optimize=True)


def _on_white(rgba: U8) -> U8:
    alpha = rgba[..., 3:].astype(np.float32) / 255
    return np.asarray(rgba[..., :3] * alpha + 255 * (1 - alpha), dtype=np.uint8)


def _summary(
    folder: str | PathLike[str], seed: int, found: Recovered, measured: Evaluation, seconds: float
) -> DemoSummary:
    return DemoSummary(
        folder=str(folder),
        report=str(Path(folder) / "report.html"),
        seed=seed,
        views=found.summary.views,
        n=found.summary.n,
        N=found.summary.N,
        true_n=BLENDED,
        true_N=MATERIALS,
        misfit=found.summary.misfit,
        novel_light_nrms=measured.nrms,
        psnr_h=measured.psnr_h,
        psnr_l=measured.psnr_l,
        ssim=measured.ssim,
        seconds=seconds,
    )

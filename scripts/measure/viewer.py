# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The viewer's page in headless Chromium: its still canvas beside `relight`, its size, its first picture.

    python scripts/measure/viewer.py --captures ../shared/captures --json target/validation/viewer.json

Pages are those of `swatchwork view` for materials reconstructed here. *worst*, *mean*: NRMS (A > 0.5) of
the still canvas against `relight`, from three test cameras, under two of the page's lights, by 16 x
16-pixel windows drawn evenly from those that show the object, for drawing a whole one by software takes an
hour; *fine*: the worst against `relight --samples 8`; *sampling*: of `relight` against that, the worst.
*first picture*: seconds from opening the file, median of five loads in a window of 1280 x 800. Chromium
draws by software (SwiftShader).
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import headless
import numpy as np
import results

from swatchwork import ReconstructOptions, reconstruct_folder
from swatchwork.arrays import F32
from swatchwork.capture import Camera, EnvironmentSource, read_capture
from swatchwork.light import Environment, read_environment
from swatchwork.material import read_material
from swatchwork.relight import RelitScene, render
from swatchwork.relight.view import see
from swatchwork.simulate import simulate_capture
from swatchwork.solve import SolveOptions
from swatchwork.workflow import view_folder

LOADS, FINE, WINDOW = 5, 8, 16
QUICK = {"texels": 400, "solve": SolveOptions(n=2, N=4)}
"""How well the material was found does not matter here."""
CANVAS_HEAD = ["page", "canvas", "windows", "passes", "worst", "mean", "fine", "sampling"]
PAGE_HEAD = ["page", "triangles", "atlas", "photographs", "size", "first picture"]


@dataclass(frozen=True)
class Subject:
    """A material's page, and the capture that it is of."""

    name: str
    capture: Path
    material: Path
    page: Path


def subject(name: str, capture: Path, work: Path, resolution: int | None = None) -> Subject:
    """Reconstruct, and write the page with the capture's photographs and its test light."""
    material, page = work / f"{name}-material", work / f"{name}.html"
    if not page.is_file():
        reconstruct_folder(
            capture, material, ReconstructOptions(resolution=resolution, **QUICK), viewer=False
        )
        source = _test_light(capture)
        view_folder(material, page, capture=capture, lights=[source.file], convention=source.convention)
    return Subject(name, capture, material, page)


def _test_light(capture: Path) -> EnvironmentSource:
    found = read_capture(capture / "test", require_images=False).environment
    assert found is not None
    return found


def lights_of(capture: Path) -> Iterable[tuple[str, Environment]]:
    """The capture's own light and the one added, as the page lists them first."""
    own = read_capture(capture).environment
    assert own is not None
    return (("its own", read_environment(own)), ("another", read_environment(_test_light(capture))))


def scaled(camera: Camera, size: int) -> Camera:
    """The camera with so many pixels along its longer side, and no distortion."""
    s = size / max(camera.width, camera.height)
    width, height = round(camera.width * s), round(camera.height * s)
    lens = {name: getattr(camera, name) * s for name in ("fx", "fy", "cx", "cy")}
    return replace(camera, width=width, height=height, k1=0.0, k2=0.0, p1=0.0, p2=0.0, **lens)


def windows(scene: RelitScene, camera: Camera, count: int, seed: int) -> list[Camera]:
    """Cameras of ``count`` windows of a picture, evenly drawn from those that show the object."""
    across, down = camera.width // WINDOW, camera.height // WINDOW
    small = {name: getattr(camera, name) / WINDOW for name in ("fx", "fy", "cx", "cy")}
    alpha = render_alpha(scene, replace(camera, width=across, height=down, **small))
    rows, columns = np.nonzero(alpha > 0)
    step = max(1.0, len(rows) / count)
    first = np.random.default_rng([seed, 11]).random() * step
    chosen = np.unique(np.arange(first, len(rows), step).astype(int))
    return [
        replace(
            camera,
            width=WINDOW,
            height=WINDOW,
            cx=camera.cx - WINDOW * int(columns[i]),
            cy=camera.cy - WINDOW * int(rows[i]),
        )
        for i in chosen
    ]


def render_alpha(scene: RelitScene, camera: Camera) -> F32:
    """Coverage [H, W] of a small picture."""
    return see(scene.rays, camera, 2).alpha


def canvas(browser: Any, of: Subject, size: int, passes: int, count: int) -> dict[str, Any]:
    """Windows of large canvases against relight, and relight against itself with more samples."""
    shown = headless.Shown(browser, of.page)
    scene = RelitScene.of(read_material(of.material))
    frames = read_capture(of.capture / "test").frames[:3]
    rows = []
    for number, (light, environment) in enumerate(lights_of(of.capture)):
        shown.run(f"swatchwork.setLight({number})")
        for seed, frame in enumerate(frames):
            off = np.zeros(3)
            energy = np.zeros(2)
            for camera in windows(scene, scaled(frame.camera, size), count, seed):
                picture = shown.still(camera, passes)
                usual, many = (render(scene, camera, environment, samples) for samples in (2, FINE))
                off += [_squares(picture, usual), _squares(picture, many), _squares(usual, many)]
                energy += [_squares(0 * usual, usual), _squares(0 * many, many)]
            nrms, fine, sampling = np.sqrt(off / energy[[0, 1, 1]])
            row = {"light": light, "frame": frame.name, "nrms": nrms, "fine": fine, "sampling": sampling}
            rows.append({key: v if isinstance(v, str) else float(v) for key, v in row.items()})
            print(of.name, rows[-1], flush=True)
    assert shown.said == [] and len(shown.asked) == 1, (shown.said, shown.asked)
    shown.page.close()
    found = {"name": of.name, "size": size, "passes": passes, "windows": count, "pictures": rows}
    worst = {key: max(row[key] for row in rows) for key in ("nrms", "fine", "sampling")}
    return found | worst | {"mean": float(np.mean([row["nrms"] for row in rows]))}


def _squares(picture: F32, reference: F32) -> float:
    """Sum of squared differences where the reference shows the object."""
    on = reference[..., 3] > 0.5
    return float(((picture[..., :3][on].astype(np.float64) - reference[..., :3][on]) ** 2).sum())


def page(browser: Any, of: Subject, pictures: Path | None) -> dict[str, Any]:
    """Size and first picture."""
    seconds = []
    for load in range(LOADS):
        shown = headless.Shown(browser, of.page, 1280, 800)
        seconds.append(shown.first_picture_s)
        if load == 0 and pictures is not None:
            shown.page.screenshot(path=pictures / f"{of.name}.png")
        shown.page.close()
    material, capture = read_material(of.material), read_capture(of.capture)
    return {
        "name": of.name,
        "triangles": len(material.faces),
        "atlas": material.coverage.shape[0],
        "photographs": len(capture.frames),
        "megabytes": of.page.stat().st_size / 1e6,
        "first_picture_s": float(np.median(seconds)),
        "loads_s": seconds,
        "load_average": os.getloadavg()[0],
    }


def canvas_cells(r: dict[str, Any]) -> list[str]:
    head = [r["name"], f"{r['size']} px", str(r["windows"]), str(r["passes"])]
    return [*head, *(f"{100 * r[key]:.2f} %" for key in ("nrms", "mean", "fine", "sampling"))]


def page_cells(r: dict[str, Any]) -> list[str]:
    return [
        r["name"],
        f"{r['triangles']:,}",
        str(r["atlas"]),
        str(r["photographs"]),
        f"{r['megabytes']:.1f} MB",
        f"{r['first_picture_s']:.1f} s",
    ]


def before(path: Path | None) -> dict[str, Any]:
    """The figures of an earlier run, of which ``--only`` measures a part anew."""
    kept = json.loads(path.read_text(encoding="utf-8")) if path is not None and path.exists() else {}
    return {key: kept.get(key, []) for key in ("pages", "canvases")}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--captures", type=Path, required=True, help="folder with igea-merl/")
    parser.add_argument("--size", type=int, default=400, help="pixels along the compared canvases")
    parser.add_argument("--windows", type=int, default=14, help=f"of {WINDOW} x {WINDOW} pixels in each")
    parser.add_argument(
        "--canvases", nargs="+", default=["sphere", "knot", "igea-merl"], help="of which pages"
    )
    parser.add_argument("--passes", type=int, default=64, help="of the 64 that a finished picture has")
    parser.add_argument("--only", choices=["pages", "canvases"], help="first pictures want an idle machine")
    parser.add_argument("--work", type=Path, help="keep captures, materials and pages here")
    parser.add_argument("--pictures", type=Path, help="write a screenshot of each page here")
    parser.add_argument("--json", type=Path, help="write the figures here")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary, headless.browser() as browser:
        work = args.work or Path(temporary)
        subjects = []
        for name, shape, resolution in (
            ("sphere", "sphere", 192),
            ("knot", "knot", 256),
            ("large", "knot", 1024),
        ):
            folder = work / name
            if not folder.is_dir():
                simulate_capture(folder, object_shape=shape, rows=96, k=12, test_views=3, size=256)
            subjects.append(subject(name, folder, work, resolution))
        subjects.append(subject("igea-merl", args.captures / "igea-merl", work))
        found = before(args.json)
        if args.only != "canvases":
            found["pages"] = [page(browser, of, args.pictures) for of in subjects]
            print(results.table(PAGE_HEAD, [page_cells(r) for r in found["pages"]]))
            results.write(args.json, found)
        if args.only != "pages":
            found["canvases"] = []
            for of in subjects:
                if of.name in args.canvases:
                    found["canvases"].append(canvas(browser, of, args.size, args.passes, args.windows))
                    results.write(args.json, found)
            print(results.table(CANVAS_HEAD, [canvas_cells(r) for r in found["canvases"]]))


if __name__ == "__main__":
    main()

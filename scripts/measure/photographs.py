# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""From photographs to a material, every step against the truth: what `swatchwork prepare` costs.

    python scripts/measure/photographs.py --data ../shared/data --json target/validation/photographs.json

Mitsuba 3 renders a scanned mesh, painted with photographed metal, and a mirror ball under a real probe,
through a distorted lens (studio/). A simulated camera takes brackets of them, and photographs of a board. The
public commands go the whole way: calibrate, linearize, register, probe, check, reconstruct, relight,
evaluate. Beside it goes the perfect capture: the same radiance, poses and light as they are. Renders are kept
in --work and not made again.

--true-poses leaves out `prepare register`. --ablations recovers captures with one step's error alone, too.
Needs `mitsuba` (extra: oracle) and LLVM 17 or newer (Debian: libllvm19).
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import results
from studio import board, camera_model, figures, lens, renderer, sheet, steps, subject

from swatchwork.arrays import F32
from swatchwork.capture import Camera, EnvironmentSource, read_exr_channels, read_image, write_exr_channels
from swatchwork.light import Environment, read_environment
from swatchwork.surface import Mesh

Figures = dict[str, Any]
LIGHT, NOVEL = "uffizi", "rnl"
"""Of the capture, and of the test."""
VIEWS, BALLS, BOARDS, TEST = 8, (0, 2), 12, 4
"""Photographs; those from whose tripods the ball was taken, a quarter turn apart; boards; novel views."""
SAMPLES = {"object": 96, "ball": 32, "test": 192, "noise": 32}
"""Rays a pixel; ``noise`` of the pictures that tell how far the others are from their mean."""
BRACKETS = {"object": 3, "ball": 5, "board": 1}
TURN = np.diag([-1.0, 1.0, -1.0])
"""World from the probes' own axes."""
WRONG_CLICKS = 0.3


class Studio:
    """What is true: renders, made once."""

    def __init__(self, data: Path, work: Path, light: str, novel: str) -> None:
        self.work, self.data = work, data
        self.subject = subject.subject(data, work / "object")
        self.mesh: Mesh = self.subject.mesh
        self.mesh_file = work / "object" / "mesh.obj"
        self.light, self.novel = (subject.environment(data, name) for name in (light, novel))
        self.light_file, self.novel_file = (self._kept_light(name) for name in (light, novel))
        centre, radius = self.mesh.bounds
        self.cameras = subject.cameras(self.mesh, VIEWS, 1)
        self.test_cameras = subject.cameras(self.mesh, TEST, 2, subject.smaller(subject.LENS, 2), turned=0.4)
        painted = (renderer.painted_object, self.subject)
        ball = (renderer.mirror_ball, centre, radius * subject.BALL_RADIUS)
        key = f"{light}-{novel}"
        self.photographs = self._renders(
            f"object-{light}", painted, self.light, self.cameras, SAMPLES["object"], background=True
        )
        self.balls = self._renders(
            f"ball-{light}",
            ball,
            self.light,
            [self.cameras[i] for i in BALLS],
            SAMPLES["ball"],
            background=True,
        )
        self.tests = self._renders(
            f"test-{novel}", painted, self.novel, self.test_cameras, SAMPLES["test"], background=False
        )
        self.again = [
            self._renders(
                f"again-{light}", painted, self.light, self.cameras[:1], SAMPLES["noise"], background=True
            ),
            self._renders(
                f"again-{novel}", painted, self.novel, self.test_cameras, SAMPLES["noise"], background=False
            ),
        ]
        self.key = key

    def _kept_light(self, name: str) -> Path:
        file = self.data / "envmaps" / "latlong" / f"{name}_1024x512.hdr"
        there = self.work / "object" / file.name
        if not there.exists():
            there.write_bytes(file.read_bytes())
        return there

    def _renders(
        self,
        name: str,
        shape: tuple[Any, ...],
        light: Environment,
        cameras: list[Camera],
        samples: int,
        *,
        background: bool,
    ) -> list[F32]:
        # What the code says, not how it is laid out.
        sources = [ast.dump(ast.parse(Path(str(m.__file__)).read_bytes())) for m in (lens, renderer, subject)]
        said = repr((samples, background, *((c.world_from_camera.tolist(), repr(c)) for c in cameras)))
        digest = hashlib.sha256("".join([*sources, said]).encode()).hexdigest()[:12]
        folder = self.work / "renders" / f"{name}-{digest}"
        if not folder.exists():
            begun = folder.with_suffix(".part")
            begun.mkdir(parents=True, exist_ok=True)
            scene = renderer.Scene(shape[0](*shape[1:]), light, background=background)
            for i, camera in enumerate(cameras):
                image = scene.seen_by(camera, samples, seed=samples * 100 + i)
                write_exr_channels(begun / f"{i}.exr", {c: image[..., k] for k, c in enumerate("RGBA")})
                print(f"rendered {name} {i + 1} of {len(cameras)}", flush=True)
            begun.rename(folder)
        read = [read_exr_channels(folder / f"{i}.exr") for i in range(len(cameras))]
        return [np.stack([channels[c] for c in "RGBA"], axis=-1) for channels in read]

    def noise(self) -> dict[str, float]:
        """What the renders' own noise is: NRMS on the object, from others of fewer rays."""
        found = {}
        for name, pictures, again in zip(
            ("object", "test"), (self.photographs, self.tests), self.again, strict=True
        ):
            pairs = [
                (b[p[..., 3] > 0.999], p[p[..., 3] > 0.999]) for p, b in zip(pictures, again, strict=False)
            ]
            other, own = (np.concatenate([pair[i][:, :3] for pair in pairs]) for i in (0, 1))
            # Variances add, each the inverse of its rays.
            share = 1 / (1 + SAMPLES[name] / SAMPLES["noise"])
            found[name] = figures.nrms(other, own) * float(np.sqrt(share))
        return found

    def test(self) -> Path:
        """The pictures to compare with, as a capture under the novel light."""
        folder = self.work / "test" / self.key
        names = [f"T{i + 1:02d}" for i in range(TEST)]
        images = steps.write_images(folder / "references", self.tests, names)
        masks = steps.write_masks(folder / "coverage", [t[..., 3] > 0.5 for t in self.tests], names)
        light = EnvironmentSource(self.novel_file, "mitsuba", TURN)
        parts = steps.Parts(images, masks, tuple(self.test_cameras), self.mesh_file, light)
        return steps.put_together(folder / "capture", parts).parent


def timed(took: dict[str, float], name: str, work: Callable[[], Any]) -> Any:
    """What ``work`` gives; its seconds go to ``took``."""
    start = time.perf_counter()
    found = work()
    took[name] = round(time.perf_counter() - start, 1)
    print(f"{name}: {took[name]:.0f} s", flush=True)
    return found


def true_probe(studio: Studio) -> EnvironmentSource:
    return EnvironmentSource(studio.light_file, "mitsuba", TURN)


def measure(studio: Studio, kind_name: str, options: argparse.Namespace) -> Figures:
    """The whole way of one camera, and each step's figures."""
    kind = camera_model.CAMERAS[kind_name]
    work = studio.work / f"{kind_name}-{studio.key}"
    card = work / "card"
    took: dict[str, float] = {}
    true = [picture[..., :3] for picture in studio.photographs]
    balls = [picture[..., :3] for picture in studio.balls]
    boards = [board.seen_by(subject.LENS, pose) for pose in board.poses(BOARDS, 0)]
    times = {
        "object": camera_model.times_for(true, BRACKETS["object"]),
        "ball": camera_model.times_for(balls, BRACKETS["ball"]),
        "board": camera_model.times_for(boards, BRACKETS["board"]),
    }
    camera_model.photograph(kind, card / "board", boards, times["board"], name="BRD", seed=3)
    taken = camera_model.photograph(kind, card / "object", true, times["object"], name="IMG", seed=4)
    of_balls = camera_model.photograph(kind, card / "ball", balls, times["ball"], name="BAL", seed=5)

    # Prepare.
    intrinsics = work / "intrinsics.json"
    found = timed(took, "calibrate", lambda: steps.calibrated(card / "board", intrinsics))
    lens_found = steps.lens_of(found)
    linear = timed(took, "linearize", lambda: steps.linearized(taken, kind, work / "linear"))
    response = work / "linear" / "linearize.json"
    shared = response if kind.response == "recover" else None
    linear_balls = timed(
        took, "linearize balls", lambda: steps.linearized(of_balls, kind, work / "balls", shared)
    )
    names = [file.stem for file in linear]
    masks = steps.write_masks(work / "masks", [p[..., 3] > 0.5 for p in studio.photographs], names)
    if options.true_poses:
        cameras = figures.with_lens(studio.cameras, lens_found)
    else:
        pairs = work / "pairs.json"
        steps.write_clicks(
            pairs,
            linear[0],
            studio.mesh_file,
            studio.mesh,
            studio.cameras[0],
            wrong=options.wrong_clicks,
            seed=6,
        )
        cameras = tuple(
            timed(
                took,
                "register",
                lambda: steps.registered(
                    linear, studio.mesh_file, intrinsics, pairs, masks[0].parent, work / "registered"
                ),
            )
        )
    first = cameras[BALLS[0]]
    reflectance = subject.BALL_REFLECTANCE
    probe = timed(
        took, "probe", lambda: steps.probed(linear_balls, intrinsics, reflectance, first, work / "probe")
    )
    light = EnvironmentSource(work / "probe" / "probe.exr", "mitsuba")

    # Each step against the truth.
    read = [read_image(file) for file in linear]
    on_object = [(p[..., 3] > 0.999) & ~r.clipped for p, r in zip(studio.photographs, read, strict=True)]
    scale = figures.factor([r.linear for r in read], true, on_object)
    read_balls = [read_image(file) for file in linear_balls]
    on_ball = [(p[..., 3] > 0.999) & ~r.clipped for p, r in zip(studio.balls, read_balls, strict=True)]
    of_ball = figures.factor([r.linear for r in read_balls], balls, on_ball)
    unseen = read_exr_channels(work / "probe" / "probe_masks.exr")["unseen"]
    about = studio.mesh.bounds[0]
    perfect_balls = steps.write_images(work / "perfect-balls", balls, [f.stem for f in linear_balls])
    true_lens = steps.write_lens(work / "true-lens.json", subject.LENS)
    perfect_probe = steps.probed(
        perfect_balls, true_lens, reflectance, studio.cameras[BALLS[0]], work / "perfect-probe"
    )
    perfect_unseen = read_exr_channels(work / "perfect-probe" / "probe_masks.exr")["unseen"]
    one = np.ones(3)
    step_figures = {
        "lens": figures.of_lens(subject.LENS, lens_found),
        "calibration_rms_px": found["figures"]["rms_px"],
        "response_rms_log": figures.of_response(kind, str(response) if shared else kind.response),
        "radiance_nrms": figures.of_radiance([r.linear for r in read], true, on_object, scale),
        "radiance_of_blocks_nrms": figures.of_blocks([r.linear for r in read], true, on_object, scale),
        "radiance_of_balls_nrms": figures.of_radiance(
            [r.linear for r in read_balls], balls, on_ball, of_ball
        ),
        "balls_over_photographs": (of_ball / scale).tolist(),
        "clipped": {
            "object": float(np.mean([r.clipped.mean() for r in read])),
            "ball": float(np.mean([r.clipped.mean() for r in read_balls])),
        },
        "poses": figures.of_poses(cameras, studio.cameras, about) | {"true": options.true_poses},
        "probe": figures.of_probe(read_environment(light), studio.light, unseen, scale),
        "probe_of_perfect_balls": figures.of_probe(
            read_environment(EnvironmentSource(work / "perfect-probe" / "probe.exr", "mitsuba")),
            studio.light,
            perfect_unseen,
            one,
        ),
        "second_ball_degrees": second_ball(probe, studio),
        "second_perfect_ball_degrees": second_ball(perfect_probe, studio),
        "outline_px": [view["outline_residual_px"] for view in probe["views"]],
    }
    print(json.dumps(step_figures, indent=1), flush=True)

    # The whole way, beside the perfect capture and those with one step's error.
    perfect = steps.Parts(
        steps.write_images(work / "perfect-images", true, names),
        masks,
        tuple(studio.cameras),
        studio.mesh_file,
        true_probe(studio),
    )
    parts = {
        "perfect": perfect,
        "pictures": steps.Parts(tuple(linear), masks, cameras, studio.mesh_file, light),
    }
    if options.ablations:
        parts |= {
            "only poses and lens": replace(perfect, cameras=cameras),
            "only probe": replace(perfect, light=scaled_light(light, scale, work / "scaled")),
            "only radiance": replace(perfect, images=scaled_images(linear, scale, work / "scaled")),
        }
    captures = steps.by_name(parts, work / "captures")
    check = timed(took, "check", lambda: steps.checked(captures["pictures"]))
    test = studio.test()
    choice = ["--resolution", str(options.resolution)] if options.resolution else []
    ways = {}
    for name, capture in captures.items():
        ways[name] = timed(took, f"recover {name}", lambda c=capture: steps.recovered(c, test, choice))
        print(f"{name}: {100 * ways[name]['evaluation']['nrms']:.2f} %", flush=True)
    if options.picture is not None:
        sheet.write(
            options.picture,
            sheet.Story(
                taken,
                of_balls,
                [r.linear / scale for r in read],
                cameras,
                studio.mesh,
                studio.light,
                read_environment(light),
                scale,
                studio.tests,
                captures["pictures"] / "renders",
                captures["perfect"] / "renders",
            ),
        )
    return {
        "camera": kind_name,
        "times": times,
        "steps": step_figures,
        "check": check.get("findings", []),
        "ways": ways,
        "seconds": took,
    }


def second_ball(probe: Figures, studio: Studio) -> float:
    """How far the second ball's rotation to the first one is off, in degrees."""
    turns = [np.array(view["world_from_camera"]) for view in probe["views"]]
    true = [studio.cameras[i].world_from_camera[:3, :3] for i in BALLS]
    return figures.turned_apart(turns[0].T @ turns[1], true[0].T @ true[1])


def scaled_light(light: EnvironmentSource, scale: np.ndarray, folder: Path) -> EnvironmentSource:
    """The recovered probe in the truth's unit."""
    radiance = read_environment(light).radiance / scale
    (file,) = steps.write_images(folder, [radiance], ["probe"])
    return replace(light, file=file)


def scaled_images(files: list[Path], scale: np.ndarray, folder: Path) -> tuple[Path, ...]:
    """Linear photographs in the truth's unit, their saturated pixels marked."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in files:
        channels = read_exr_channels(file)
        for c, name in enumerate("RGB"):
            channels[name] = (channels[name] / scale[c]).astype(np.float32)
        write_exr_channels(folder / file.name, channels)
    return tuple(folder / file.name for file in files)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder with envmaps, meshes, textures")
    parser.add_argument("--work", type=Path, default=results.ROOT / "target" / "validation" / "photographs")
    parser.add_argument("--cameras", nargs="+", choices=camera_model.CAMERAS, default=["jpeg"])
    parser.add_argument("--light", default=LIGHT, help="of the capture: a probe in envmaps/latlong")
    parser.add_argument("--novel", default=NOVEL, help="of the test")
    parser.add_argument("--true-poses", action="store_true", help="do not register")
    parser.add_argument("--wrong-clicks", type=float, default=0.0, metavar="SHARE")
    parser.add_argument("--ablations", action="store_true", help="each step's error alone, too")
    parser.add_argument("--resolution", type=int, help="of `swatchwork reconstruct`")
    parser.add_argument("--picture", type=Path, help="write a contact sheet here (JPEG)")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    start = time.perf_counter()
    studio = Studio(args.data, args.work, args.light, args.novel)
    print(f"renders: {time.perf_counter() - start:.0f} s", flush=True)
    rows = [measure(studio, name, args) for name in args.cameras]
    results.write(
        args.json,
        {
            "light": args.light,
            "novel": args.novel,
            "views": VIEWS,
            "triangles": len(studio.mesh.faces),
            "size": [subject.LENS.width, subject.LENS.height],
            "noise": studio.noise(),
            "samples": SAMPLES,
            "picture": os.path.basename(args.picture) if args.picture else None,
            "rows": rows,
            "seconds": time.perf_counter() - start,
        },
    )


if __name__ == "__main__":
    main()

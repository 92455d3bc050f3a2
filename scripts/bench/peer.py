# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The outside peer: Mitsuba 3 fits textures of a `principled` BSDF to a capture by gradient descent.

    python scripts/bench/peer.py CAPTURE --seconds 300 --json peer.json
    python scripts/bench/peer.py CAPTURE --at 20 100 --until-converged --seconds 3600 --json peer.json

Geometry, cameras and light are given to it as to `swatchwork reconstruct`. Its best schedule on sphere-merl:
base colour, roughness and metallic textures and one specular coefficient; random pixels of all views;
direct light by Mitsuba's emitter and BSDF sampling with multiple importance, derivatives by Dr.Jit through
the BSDF (detached sampling); a squared loss that is unbiased, for it multiplies the residuals of two
independent estimates; total variation; Adam, whose rate decays to a tenth by each checkpoint; textures
refined from 32 to --resolution by the first one. Checkpoints double in time (or are --at), so one run gives
error against time. It has converged, as who fits it can see, where twice the time brings its misfit to the
photographs down by less than 1 %.

The clock starts with the script and stands while a checkpoint is scored: the misfit is taken at a million
pixels of the photographs, test/ is rendered and `swatchwork evaluate` compares it. Needs
`mitsuba` (extra: oracle) and LLVM 17 or newer (Debian: libllvm19).
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shared
from studio import llvm

from swatchwork.capture import Camera, Capture, read_capture, read_photograph, write_exr
from swatchwork.errors import InputError
from swatchwork.light import Environment
from swatchwork.observe import Lights
from swatchwork.surface import Mesh, parametrised, read_mesh

STARTED = time.perf_counter()
CONVERGED = 0.01
"""Relative gain of the misfit in doubling the time below which the fit has converged."""
MISFIT_DRAWS = 16
"""Of a step's pixels each, for a checkpoint's misfit: the same ones at every checkpoint."""
CHANNELS = {"base_color": 3, "roughness": 1, "metallic": 1}
COARSEST = 32


dr, mi = llvm.start("llvm_ad_rgb")


@dataclass(frozen=True)
class Schedule:
    """How it descends; the defaults did best on sphere-merl."""

    resolution: int = 256
    """Side of the textures at the end."""
    pixels: int = 1 << 16
    """Drawn at random from all views, an iteration."""
    rate: float = 0.02
    decay: float = 0.1
    """Rate at a checkpoint over that after the last one."""
    variation: float = 1e-4
    """Weight of total variation beside the relative squared error."""
    compression: float = 0.0
    """Residuals are divided by (mean + radiance) to this power."""


# ---- the scene -----------------------------------------------------------------------------------
def light_of(capture: Capture) -> Environment:
    groups = list(Lights.of_capture(capture).groups())
    if len(groups) != 1:
        raise InputError(f"{len(groups)} lights", file=capture.file, expected="one, for this peer")
    environment, turn, _ = groups[0]
    return environment.rotated(turn)


class Scene:
    """The mesh with its textures under a light."""

    def __init__(
        self, mesh: Mesh, light: Environment, textures: dict[str, np.ndarray], specular: float
    ) -> None:
        images = {name: llvm.bitmap(mi, values) for name, values in textures.items()}
        shape = llvm.textured_mesh(mi, mesh, {"type": "principled", "specular": specular, **images})
        sky = {"type": "envmap", "bitmap": mi.Bitmap(llvm.raster(light))}
        self.scene = mi.load_dict({"type": "scene", "object": shape, "light": sky})
        self.params = mi.traverse(self.scene)
        self.names = {
            name: next(k for k, _ in self.params if k.endswith(f"{name}.data")) for name in textures
        }
        self.specular = next(k for k, _ in self.params if k.endswith("specular"))

    def radiance(self, ray: mi.Ray3f, sampler: mi.Sampler) -> tuple[mi.Color3f, mi.Bool]:
        """Direct light that a ray brings and whether it hits; derivatives through the BSDF's value alone."""
        si = self.scene.ray_intersect(ray)
        bsdf, context, hit = si.bsdf(), mi.BSDFContext(), si.is_valid()

        aimed, weight = self.scene.sample_emitter_direction(si, sampler.next_2d(hit), True, hit)
        value, density = bsdf.eval_pdf(context, si, si.to_local(aimed.d), hit)
        found = dr.select(hit, value * weight * share(aimed.pdf, dr.detach(density)), 0)

        with dr.suspend_grad():
            drawn, _ = bsdf.sample(context, si, sampler.next_1d(hit), sampler.next_2d(hit), hit)
            onward = hit & (drawn.pdf > 0)
            there = self.scene.ray_intersect(si.spawn_ray(si.to_world(drawn.wo)), onward)
            sky = there.emitter(self.scene, onward)
            light = sky.eval(there, onward)
            rival = self.scene.pdf_emitter_direction(si, mi.DirectionSample3f(self.scene, there, si), onward)
        value = bsdf.eval(context, si, drawn.wo, onward)
        density = dr.select(onward, drawn.pdf, 1)
        found += dr.select(onward, value * light * (share(drawn.pdf, rival) / density), 0)
        # Rare samples at grazing angles are not numbers.
        return dr.select(dr.all(dr.isfinite(found)), found, 0), hit


def share(density: mi.Float, rival: mi.Float) -> mi.Float:
    """Balance heuristic, 0 where neither samples."""
    return dr.select(density > 0, density / (density + rival), 0)


class Cameras:
    """Pinholes of all frames, for rays through arbitrary pixels of arbitrary frames."""

    def __init__(self, cameras: list[Camera]) -> None:
        if any(any((c.k1, c.k2, c.p1, c.p2)) for c in cameras):
            raise SystemExit("this peer knows no lens distortion")
        pose = np.stack([c.world_from_camera for c in cameras])
        self.pose = [[mi.Float(pose[:, i, j].astype(np.float32)) for j in range(4)] for i in range(3)]
        numbers = np.array([[c.fx, c.fy, c.cx, c.cy] for c in cameras], np.float32)
        self.numbers = [mi.Float(column) for column in numbers.T]

    def rays(self, frame: mi.UInt32, x: mi.Float, y: mi.Float) -> mi.Ray3f:
        fx, fy, cx, cy = (dr.gather(mi.Float, column, frame) for column in self.numbers)
        local = ((x - cx) / fx, -(y - cy) / fy, mi.Float(-1))
        pose = [[dr.gather(mi.Float, cell, frame) for cell in row] for row in self.pose]
        d = mi.Vector3f(*(sum(row[j] * local[j] for j in range(3)) for row in pose))
        return mi.Ray3f(mi.Point3f(*(row[3] for row in pose)), dr.normalize(d))


# ---- descent -------------------------------------------------------------------------------------
class Descent:
    """Textures on their way down, and the clock."""

    def __init__(self, capture: Capture, schedule: Schedule) -> None:
        self.schedule, self.iterations = schedule, 0
        self.mesh, self.light = parametrised(read_mesh(capture.mesh_path)), light_of(capture)
        self.cameras = Cameras([frame.camera for frame in capture.frames])
        place, colour = [], []
        for i, frame in enumerate(capture.frames):
            photograph = read_photograph(frame)
            y, x = np.nonzero((photograph.alpha > 0.5) & photograph.valid)
            place.append(np.stack([np.full(len(x), i), x, y]))
            colour.append(photograph.radiance[y, x])
        self.place = [mi.UInt32(row.astype(np.uint32)) for row in np.concatenate(place, axis=1)]
        radiance = np.concatenate(colour).astype(np.float32)
        self.count, self.mean = len(radiance), float(radiance.mean())
        scale = (self.mean + radiance.mean(axis=1, keepdims=True)) ** -schedule.compression
        self.energy = float(np.mean((radiance * scale) ** 2))
        self.reference = [mi.Float(column) for column in radiance.T.copy()]
        self.scale = mi.Float(scale[:, 0])
        start = {"base_color": 0.4, "roughness": 0.5, "metallic": 0.3}
        self.textures = {
            name: np.full((COARSEST, COARSEST, c), start[name], np.float32) for name, c in CHANNELS.items()
        }
        self.specular = 0.5
        self.sampler = mi.load_dict({"type": "independent"})
        self.scene = Scene(self.mesh, self.light, self.textures, self.specular)
        self._refine(COARSEST)

    def _refine(self, resolution: int) -> None:
        """Continue with textures of another resolution; Adam's moments begin anew."""
        at = (np.arange(resolution) + 0.5) / resolution
        for name, old in self.textures.items():
            p = at * len(old) - 0.5
            low = np.floor(p).astype(int)
            t = (p - low).astype(np.float32)
            a, b = low % len(old), (low + 1) % len(old)
            rows = old[a] * (1 - t)[:, None, None] + old[b] * t[:, None, None]
            self.textures[name] = rows[:, a] * (1 - t)[:, None] + rows[:, b] * t[:, None]
        self.optimiser = mi.ad.Adam(lr=self.schedule.rate)
        for name, key in self.scene.names.items():
            self.optimiser[key] = mi.TensorXf(self.textures[name])
        self.optimiser[self.scene.specular] = mi.Float(self.specular)
        self.scene.params.update(self.optimiser)

    def _keep(self) -> None:
        """The textures as arrays."""
        for name, key in self.scene.names.items():
            self.textures[name] = np.array(self.optimiser[key])
        self.specular = float(np.array(self.optimiser[self.scene.specular]).ravel()[0])

    def run(self, clock: Any, until: float, first: bool) -> None:
        """Descend until the clock shows ``until``, the rate decaying on the way."""
        start = clock()
        steps = int(np.log2(self.schedule.resolution / COARSEST)) if first else 0
        level = 0
        while (now := clock()) < until:
            t = (now - start) / max(until - start, 1e-9)
            # Refined at even times within the first half, so that the finest has half of the time.
            if level < steps and t > 0.5 * (level + 1) / steps:
                level += 1
                self._keep()
                self._refine(COARSEST << level)
            self.optimiser.set_learning_rate(self.schedule.rate * self.schedule.decay**t)
            self._step()
        self._keep()
        if level < steps:
            self._refine(self.schedule.resolution)

    def _loss(self, seed: int) -> mi.Float:
        """Of random pixels, a number each: the unbiased weighted square of their residual."""
        count = self.schedule.pixels
        self.sampler.seed(seed, count)
        at = mi.UInt32(self.sampler.next_1d() * self.count)
        frame, x, y = (dr.gather(mi.UInt32, row, at) for row in self.place)
        reference = mi.Color3f(*(dr.gather(mi.Float, column, at) for column in self.reference))
        residual = []
        for _ in range(2):
            jitter = self.sampler.next_2d()
            ray = self.cameras.rays(frame, mi.Float(x) + jitter.x, mi.Float(y) + jitter.y)
            residual.append(self.scene.radiance(ray, self.sampler)[0] - reference)
        weight = dr.square(dr.gather(mi.Float, self.scale, at))
        return weight * dr.mean(residual[0] * residual[1]) / self.energy

    def misfit(self) -> dict[str, float]:
        """Root mean square of the residuals over that of the photographs, both times their weights; and its
        standard error, which is mostly that of the choice of pixels, the same at every checkpoint."""
        with dr.suspend_grad():
            found = [dr.mean(self._loss(1 << 30 | draw))[0] for draw in range(MISFIT_DRAWS)]
        misfit = float(np.sqrt(max(np.mean(found), 1e-12)))
        return {"misfit": misfit, "misfit_error": float(np.std(found)) / len(found) ** 0.5 / (2 * misfit)}

    def _step(self) -> None:
        self.iterations += 1
        # Gradients of a sum are its terms': without the mean the samples are computed once, not twice.
        dr.backward(self._loss(self.iterations) / self.schedule.pixels)
        for key in self.scene.names.values():
            dr.backward(self.schedule.variation * total_variation(self.optimiser[key]))
        for key in (*self.scene.names.values(), self.scene.specular):
            gradient = dr.grad(self.optimiser[key])
            dr.set_grad(self.optimiser[key], dr.select(dr.isfinite(gradient), gradient, 0))
        self.optimiser.step()
        for name, key in self.scene.names.items():
            low, high = (0.06, 1.0) if name == "roughness" else (0.0, 1.0)
            self.optimiser[key] = dr.clip(self.optimiser[key], low, high)
        self.optimiser[self.scene.specular] = dr.clip(self.optimiser[self.scene.specular], 0.02, 1.0)
        self.scene.params.update(self.optimiser)
        # Steps are queued: without waiting, the clock would run ahead of the work.
        dr.sync_thread()


def total_variation(texture: mi.TensorXf) -> mi.Float:
    """Integral of |gradient| over the unit square, summed over axes and channels."""
    along = (texture[1:] - texture[:-1], texture[:, 1:] - texture[:, :-1])
    return sum(dr.mean(dr.abs(step.array)) for step in along) * texture.shape[0]


def render(descent: Descent, test: Capture, folder: Path, samples: int) -> None:
    """Frames of the test, RGBA with RGB premultiplied, under its own light."""
    scene = Scene(descent.mesh, light_of(test), descent.textures, descent.specular)
    cameras = Cameras([frame.camera for frame in test.frames])
    folder.mkdir(parents=True, exist_ok=True)
    at_once = 16
    for i, frame in enumerate(test.frames):
        width, height = frame.camera.width, frame.camera.height
        pixel = dr.arange(mi.UInt32, width * height * at_once) // at_once
        image = np.zeros((height, width, 4))
        for part in range(samples // at_once):
            descent.sampler.seed(1_000_000 + part, width * height * at_once)
            jitter = descent.sampler.next_2d()
            x, y = mi.Float(pixel % width) + jitter.x, mi.Float(pixel // width) + jitter.y
            ray = cameras.rays(dr.full(mi.UInt32, i, width * height * at_once), x, y)
            colour, hit = scene.radiance(ray, descent.sampler)
            columns = (*colour, dr.select(hit, mi.Float(1), mi.Float(0)))
            sums = [np.array(dr.block_sum(column, at_once)) for column in columns]
            image += np.stack(sums, axis=-1).reshape(height, width, 4) / (samples // at_once * at_once)
        write_exr(folder / Path(frame.name).name, image.astype(np.float32))


# ---- the curve -----------------------------------------------------------------------------------
def checkpoints(at: list[float], most: float) -> list[float]:
    """Times at which to score: those given, then doubling up to ``most``."""
    times = sorted(t for t in at if t < most) or [most / 4]
    # The last is ``most`` itself, and none comes just before it.
    while 2.1 * times[-1] < most:
        times.append(2 * times[-1])
    return [*times, most]


def converged(curve: list[dict[str, Any]]) -> bool:
    """Whether the last doubling of the time (or more) gained less than CONVERGED."""
    last = curve[-1]
    before = [point for point in curve if point["seconds"] <= last["seconds"] / 1.9]
    return bool(before) and last["misfit"] > (1 - CONVERGED) * min(point["misfit"] for point in before)


def fit(capture: Path, schedule: Schedule, times: list[float], to_end: bool, work: Path, samples: int) -> Any:
    """Descend through the checkpoints; the curve."""
    paused = 0.0

    def clock() -> float:
        return time.perf_counter() - STARTED - paused

    test = read_capture(capture / "test")
    descent = Descent(read_capture(capture), schedule)
    curve: list[dict[str, Any]] = []
    for until in times:
        descent.run(clock, until, first=not curve)
        stopped = time.perf_counter()
        # Scoring renders more at once than fitting does: only the peak before the first counts.
        peak = curve[0]["peak_mb"] if curve else peak_mb()
        point: dict[str, Any] = {"seconds": clock(), "peak_mb": peak} | descent.misfit()
        render(descent, test, work, samples)
        point |= {"iterations": descent.iterations} | shared.score(work, capture / "test")
        curve.append(point)
        print(line(point), file=sys.stderr, flush=True)
        paused += time.perf_counter() - stopped
        if not to_end and converged(curve):
            break
    return {"curve": curve, "converged": converged(curve), "specular": descent.specular}


def peak_mb() -> float:
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def line(point: dict[str, Any]) -> str:
    return (
        f"{point['seconds']:7.1f} s {point['iterations']:6d} iterations {point['peak_mb']:6.0f} MB  "
        f"misfit {100 * point['misfit']:.2f} +- {100 * point['misfit_error']:.2f} %  "
        f"novel light {100 * point['nrms']:.2f} %"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("capture", type=Path)
    parser.add_argument("--seconds", type=float, default=300, help="the last checkpoint")
    parser.add_argument("--at", type=float, nargs="+", default=[], help="earlier checkpoints, in seconds")
    parser.add_argument("--until-converged", action="store_true", help="stop sooner, once it has")
    parser.add_argument("--samples", type=int, default=128, help="a pixel of the test's renders")
    parser.add_argument("--renders", type=Path, default=shared.BENCH / "peer" / "renders")
    parser.add_argument("--json", type=Path)
    for name, value in vars(Schedule()).items():
        parser.add_argument(f"--{name}", type=type(value), default=value)
    args = parser.parse_args()
    schedule = replace(Schedule(), **{name: getattr(args, name) for name in vars(Schedule())})
    times = checkpoints(args.at, args.seconds)
    try:
        found = fit(args.capture, schedule, times, not args.until_converged, args.renders, args.samples)
    except InputError as error:
        raise SystemExit(str(error)) from None
    print("\n".join(map(line, found["curve"])))
    shared.write(
        args.json,
        {"capture": args.capture.name, "mitsuba": mi.__version__, "schedule": vars(schedule)} | found,
    )


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A made-up memory card: what a person brings home from a shoot, of an object whose material is known.

    python scripts/tutorials/card.py card

card/scan.obj is the object's mesh and card/masks has a mask for each view. card/object has JPEG brackets of
the object, card/ball of a mirror ball in its place, card/board single photographs of a checkerboard, all by
one simulated camera: a distorted lens, photon and read noise, a response of its own, exposures in EXIF.
card/truth is a capture under another light, noise-free: it is what a real shoot does not have.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from PIL.TiffImagePlugin import IFDRational
from scipy.spatial.transform import Rotation

from swatchwork.arrays import F32, F64, Float, dot, unit
from swatchwork.capture import Camera, Capture, EnvironmentSource, Frame, write_capture, write_exr, write_png
from swatchwork.light import Environment
from swatchwork.simulate import (
    Subject,
    blend_pattern,
    camera_towards,
    ggx_basis,
    in_ggx,
    look_at,
    photograph,
    procedural_environment,
    random_directions,
    satin_materials,
    shape,
)
from swatchwork.surface import write_mesh_obj

LENS = Camera(480, 360, 565.0, 563.0, 244.0, 177.0, np.eye(4), k1=-0.1, k2=0.03, p1=5e-4, p2=-4e-4)
SHAPE, ROWS, MASKING, PATCHES = "blob", 64, "smith:0.2", 5.0
LIGHT, NOVEL = "atelier", "overcast"
VIEWS, BALLS, BOARDS, TEST_VIEWS, TEST_PX = 10, (0, 3), 10, 3, 240
"""Photographs of the object; those from whose tripods the ball was taken; of the board; of the truth."""
AWAY = 3.4
"""Of the camera from the object, in its radii."""
BRACKETS = {"object": 3, "ball": 5}
STOPS, BRIGHTEST = 4.0, 0.8
"""Factor between the exposures of a bracket; share of full scale that the shortest one's lights come to."""
BALL_RADIUS, BALL_REFLECTANCE = 0.8, 0.6
COLUMNS, RANKS = 9, 6
"""Inner corners of the board."""
FULL_WELL, READ_NOISE = 30_000.0, 6.0
"""Electrons."""
CONTRAST, QUALITY = 0.2, 95
"""Of the S-curve that the camera puts over sRGB's; of its JPEGs."""
SAMPLES = 3
"""Along a pixel's side, of ball and board."""


# ---- What is before the lens ---------------------------------------------------------------------
def object_cameras() -> list[Camera]:
    """Around the object at four heights, aimed as well as a person aims."""
    rng = np.random.default_rng(1)
    cameras = []
    for i in range(VIEWS):
        azimuth, height = 2 * np.pi * i / VIEWS, np.deg2rad((10.0, 35.0, -15.0, 55.0)[i % 4])
        d = np.array([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)])
        pose = look_at(d * AWAY * rng.uniform(0.97, 1.03), rng.normal(0, 0.03, 3))
        cameras.append(replace(LENS, world_from_camera=pose))
    return cameras


def of_object(subject: Subject, camera: Camera, light: Environment) -> tuple[F32, F32]:
    """Radiance F32[H, W, 3] of the object before its surroundings, and its coverage F32[H, W]."""
    image = photograph(subject, camera, light)
    behind = light.lookup(camera.rays(camera.pixel_centres())).reshape(camera.height, camera.width, 3)
    return (image[..., :3] + (1 - image[..., 3:]) * behind).astype(np.float32), image[..., 3]


def averaged(camera: Camera, seen: object) -> F32:
    """The mean of ``seen(directions)`` over the samples of each pixel, F32[H, W, 3]."""
    assert callable(seen)
    total = np.zeros((camera.width * camera.height, 3))
    for sample in range(SAMPLES**2):
        offset = (np.array([sample % SAMPLES, sample // SAMPLES]) + 0.5) / SAMPLES - 0.5
        total += seen(camera.rays(camera.pixel_centres() + offset))
    return (total / SAMPLES**2).reshape(camera.height, camera.width, 3).astype(np.float32)


def of_ball(camera: Camera, light: Environment) -> F32:
    """A mirror ball in the object's place."""

    def seen(d: F64) -> F64:
        along = d @ camera.position
        inside = along**2 - camera.position @ camera.position + BALL_RADIUS**2
        t = -along - np.sqrt(np.maximum(inside, 0))
        normal = unit(camera.position + t[:, None] * d)
        mirrored = d - 2 * dot(d, normal)[:, None] * normal
        hit = (inside > 0)[:, None]
        return np.where(hit, BALL_REFLECTANCE, 1) * light.lookup(np.where(hit, mirrored, d))

    return averaged(camera, seen)


def of_board(index: int) -> F32:
    """A checkerboard before the camera, tilted another way each time; lengths in squares."""
    rng = np.random.default_rng([2, index])
    axis = 2 * np.pi * index * 5 / BOARDS
    turn = Rotation.from_rotvec(np.deg2rad(rng.uniform(15, 38)) * np.array([np.cos(axis), np.sin(axis), 0.0]))
    depth = rng.uniform(15, 20)
    place = depth * np.array([0.15 * (index % 4 - 1.5) / 1.5, 0.09 * (index // 4 % 3 - 1), -1.0])
    board_from_camera = turn.as_matrix().T

    def seen(d: F64) -> F64:
        start, way = board_from_camera @ -place, d @ board_from_camera.T
        x = start[:2] - start[2] / way[:, 2:] * way[:, :2]
        half = np.array([COLUMNS + 1, RANKS + 1]) / 2
        dark = np.floor(x + half).sum(axis=1) % 2 == 0
        squares, paper = (np.abs(x) < half).all(axis=1), (np.abs(x) < half + 1).all(axis=1)
        value = np.where(squares & dark, 0.04, np.where(paper, 0.7, 0.18))
        return np.repeat(value[:, None], 3, axis=1)

    return averaged(LENS, seen)


# ---- What the camera writes ----------------------------------------------------------------------
def take(folder: Path, name: str, pictures: list[F32], exposures: int) -> list[str]:
    """JPEGs NAME_0001.jpg and on, each picture's bracket one after the other; the first name of each."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng([3, len(pictures), exposures])
    brightest = max(float(np.quantile(picture, 0.9995)) for picture in pictures)
    times = [float(f"{BRIGHTEST / brightest / 100 * STOPS**i:.2g}") for i in range(exposures)]
    first = []
    for i, picture in enumerate(pictures):
        for j, time_s in enumerate(times):
            file = folder / f"{name}_{i * exposures + j + 1:04d}.jpg"
            # Radiance 1 fills the sensor in 1/100 s.
            electrons = picture.astype(np.float64) * time_s * 100 * FULL_WELL
            read = rng.poisson(electrons) + READ_NOISE * rng.normal(size=electrons.shape)
            write_jpeg(file, np.clip(read / FULL_WELL, 0, 1), time_s)
            if j == 0:
                first.append(file.stem)
    return first


def write_jpeg(file: Path, signal: Float, time_s: float) -> None:
    """Signals in [0, 1] through the camera's response; time, ISO 100 and f/8 in EXIF."""
    srgb = np.where(
        signal <= 0.0031308, 12.92 * signal, 1.055 * np.maximum(signal, 1e-9) ** (1 / 2.4) - 0.055
    )
    code = srgb + CONTRAST * (srgb * srgb * (3 - 2 * srgb) - srgb)
    exif = Pillow.Exif()
    time, aperture = IFDRational(round(time_s * 1_000_000), 1_000_000), IFDRational(8, 1)
    exif.get_ifd(0x8769).update({33434: time, 33437: aperture, 34855: 100})
    Pillow.fromarray((code * 255 + 0.5).astype(np.uint8)).save(file, quality=QUALITY, exif=exif)


# ---- The folder ----------------------------------------------------------------------------------
def write_truth(folder: Path, subject: Subject, mesh: Path) -> None:
    """A capture under another light, by a plain lens."""
    (folder / "images").mkdir(parents=True)
    light = procedural_environment(NOVEL, 1)
    write_exr(folder / "env.exr", light.radiance)
    source = EnvironmentSource(folder / "env.exr", light.convention, light.world_from_environment)
    frames = []
    for i, towards in enumerate(random_directions(TEST_VIEWS, 4)):
        camera = camera_towards(towards, TEST_PX)
        name = f"images/{i + 1:04d}.exr"
        write_exr(folder / name, photograph(subject, camera, light))
        frames.append(Frame(name, folder / name, None, 1.0, camera, source))
    write_capture(Capture(folder, folder / "transforms.json", mesh, (), source, tuple(frames)), folder)


def write_card(folder: Path) -> None:
    """Everything; ``folder`` must be new."""
    folder.mkdir(parents=True)
    mesh, light = shape(SHAPE, ROWS), procedural_environment(LIGHT, 0)
    write_mesh_obj(folder / "scan.obj", mesh)

    def blend(x: F64):  # type: ignore[no-untyped-def]
        return blend_pattern(x, materials=4, blended=2, seed=0, patches=PATCHES)

    subject = Subject.of(mesh, ggx_basis(MASKING), in_ggx(satin_materials(0), MASKING), blend)
    cameras = object_cameras()
    seen = [of_object(subject, camera, light) for camera in cameras]
    names = take(folder / "object", "IMG", [radiance for radiance, _ in seen], BRACKETS["object"])
    take(folder / "ball", "BAL", [of_ball(cameras[i], light) for i in BALLS], BRACKETS["ball"])
    take(folder / "board", "BRD", [of_board(i) for i in range(BOARDS)], 1)
    (folder / "masks").mkdir()
    for name, (_, coverage) in zip(names, seen, strict=True):
        mask = np.where(coverage > 0.5, 255, 0).astype(np.uint8)
        write_png(folder / "masks" / f"{name}.png", np.repeat(mask[..., None], 3, axis=-1))
    write_truth(folder / "truth", subject, folder / "scan.obj")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="folder to make")
    folder = parser.parse_args().folder
    if folder.exists():
        raise SystemExit(f"{folder} is there already: remove it, or name another folder")
    write_card(folder)
    print(f"{folder}: {VIEWS} views of the object, {len(BALLS)} of the ball, {BOARDS} of the board")


if __name__ == "__main__":
    main()

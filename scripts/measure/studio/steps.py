# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The way from a memory card to a material, each step by its own command."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.arrays import Bool, Float
from swatchwork.capture import (
    Camera,
    Capture,
    EnvironmentSource,
    Frame,
    read_capture,
    write_capture,
    write_exr,
    write_png,
)
from swatchwork.surface import Mesh, RayScene

from . import board
from .camera_model import CameraKind

CLICKS, CLICK_NOISE_PX = 12, 1.0
TOOL = str(Path(sys.executable).with_name("swatchwork"))


def run(*words: str | Path) -> dict[str, Any]:
    """The JSON that a command of swatchwork prints."""
    command = [TOOL, *map(str, words), "--json", "-q"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


# ---- prepare -------------------------------------------------------------------------------------
def calibrated(boards: Path, output: Path) -> dict[str, Any]:
    """Intrinsics of the photographs of a board in a folder."""
    return run("prepare", "calibrate", boards, "--board", f"{board.COLUMNS}x{board.ROWS}", "-o", output)


def linearized(
    taken: Sequence[Sequence[Path]], kind: CameraKind, output: Path, response: Path | None = None
) -> list[Path]:
    """The EXRs of brackets, with the camera's response or that of a linearize.json."""
    files = [file for own in taken for file in own]
    words: list[str | Path] = ["prepare", "linearize", *files, "-o", output, "--per-view", str(len(taken[0]))]
    words += ["--response", response if response is not None else kind.response]
    if kind.suffix == ".png":
        words += ["--exposures", files[0].parent / "exposures.csv"]
    run(*words)
    return [output / f"{own[0].stem}.exr" for own in taken]


def probed(
    balls: Sequence[Path], intrinsics: Path, reflectance: float, first: Camera, output: Path
) -> dict[str, Any]:
    """The light probe of balls, in the world of the first one's camera; the second's turn is looked for."""
    pose = output.with_name(f"{output.name}-pose.json")
    frame = {"file_path": balls[0].name, "transform_matrix": first.world_from_camera.tolist()}
    pose.write_text(json.dumps(_lens(first) | {"frames": [frame]}), encoding="utf-8")
    words: list[str | Path] = ["prepare", "probe", *balls, "--pose", f"{pose}#{balls[0].name}"]
    words += ["--reflectance", str(reflectance), "--convention", "mitsuba", "-o", output]
    return run(*words, "--intrinsics", intrinsics)


def registered(
    photographs: Sequence[Path], mesh: Path, intrinsics: Path, pairs: Path, masks: Path, output: Path
) -> list[Camera]:
    """The cameras of photographs, in their order, from clicks in the first one."""
    # The command writes to a new folder only; this one may be an earlier measurement's.
    shutil.rmtree(output, ignore_errors=True)
    words: list[str | Path] = ["prepare", "register", *photographs, "--mesh", mesh]
    words += ["--intrinsics", intrinsics, "--pairs", pairs, "--masks", masks, "-o", output]
    run(*words)
    by_name = {Path(f.name).stem: f.camera for f in read_capture(output, require_images=False).frames}
    return [by_name[file.stem] for file in photographs]


def write_clicks(
    file: Path, photograph: Path, mesh_file: Path, mesh: Mesh, camera: Camera, *, wrong: float, seed: int
) -> None:
    """Vertices that a photograph shows, far apart, as a person would click them; a share of them is wrong."""
    rng = np.random.default_rng(seed)
    seen = _in_sight(mesh, camera)
    vertices = mesh.vertices[seen]
    chosen = [int(rng.integers(len(vertices)))]
    for _ in range(CLICKS - 1):
        apart = np.linalg.norm(vertices[:, None] - vertices[chosen], axis=-1).min(axis=1)
        chosen.append(int(apart.argmax()))
    x = vertices[chosen]
    uv = camera.project(x)[0] + rng.normal(size=(CLICKS, 2)) * CLICK_NOISE_PX
    bad = rng.permutation(CLICKS)[: round(wrong * CLICKS)]
    # A wrong click is the right place of another vertex.
    uv[bad] = camera.project(vertices[rng.integers(len(vertices), size=len(bad))])[0]
    pairs = [{"uv_px": a.tolist(), "x_in_mesh": b.tolist()} for a, b in zip(uv, x, strict=True)]
    document = {"mesh": mesh_file.name, "photographs": {photograph.name: pairs}}
    file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _in_sight(mesh: Mesh, camera: Camera) -> np.ndarray:
    """Numbers of vertices that face the camera well and nothing hides."""
    towards = camera.position - mesh.vertices
    distance = np.linalg.norm(towards, axis=1)
    facing = np.flatnonzero((towards * mesh.normals).sum(axis=1) > 0.5 * distance)
    d = -towards[facing] / distance[facing, None]
    hit = RayScene([mesh]).first_hit(np.broadcast_to(camera.position, d.shape).copy(), d)
    corners = mesh.vertices[mesh.faces[np.maximum(hit.face, 0)]]
    at = np.einsum("pc,pcx->px", hit.bary, corners)
    near = np.linalg.norm(at - mesh.vertices[facing], axis=1) < 1e-3 * mesh.bounds[1]
    return np.asarray(facing[near & (hit.mesh == 0)])


def _lens(camera: Camera) -> dict[str, float]:
    names = {"w": "width", "h": "height", "fl_x": "fx", "fl_y": "fy"}
    names |= {name: name for name in ("cx", "cy", "k1", "k2", "p1", "p2")}
    return {key: getattr(camera, attribute) for key, attribute in names.items()}


def lens_of(intrinsics: dict[str, Any]) -> Camera:
    """The camera of `prepare calibrate`'s JSON, at the origin."""
    size = int(intrinsics["w"]), int(intrinsics["h"])
    numbers = [float(intrinsics[key]) for key in ("fl_x", "fl_y", "cx", "cy")]
    return Camera(*size, *numbers, np.eye(4), *(float(intrinsics[k]) for k in ("k1", "k2", "p1", "p2")))


def write_lens(file: Path, camera: Camera) -> Path:
    """The true lens, as `prepare calibrate` would write it."""
    file.write_text(json.dumps(_lens(camera)), encoding="utf-8")
    return file


# ---- captures ------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Parts:
    """What a capture is put together from."""

    images: tuple[Path, ...]
    masks: tuple[Path, ...]
    cameras: tuple[Camera, ...]
    mesh: Path
    light: EnvironmentSource


def write_masks(folder: Path, masks: Sequence[Bool], names: Sequence[str]) -> tuple[Path, ...]:
    """A PNG for each photograph, 255 on the object."""
    folder.mkdir(parents=True, exist_ok=True)
    files = tuple(folder / f"{name}.png" for name in names)
    for file, mask in zip(files, masks, strict=True):
        write_png(file, np.repeat(np.where(mask, 255, 0).astype(np.uint8)[..., None], 3, axis=-1))
    return files


def write_images(folder: Path, images: Sequence[Float], names: Sequence[str]) -> tuple[Path, ...]:
    """An EXR for each picture."""
    folder.mkdir(parents=True, exist_ok=True)
    files = tuple(folder / f"{name}.exr" for name in names)
    for file, image in zip(files, images, strict=True):
        write_exr(file, image)
    return files


def put_together(folder: Path, parts: Parts) -> Path:
    """A capture folder of its own, of links to the parts."""
    shutil.rmtree(folder, ignore_errors=True)
    images, masks = folder / "images", folder / "masks"
    images.mkdir(parents=True)
    masks.mkdir()

    def there(file: Path, at: Path) -> Path:
        os.link(file, at / file.name)
        return at / file.name

    frames = []
    for image, mask, camera in zip(parts.images, parts.masks, parts.cameras, strict=True):
        here = there(image, images)
        frames.append(Frame(f"images/{image.name}", here, there(mask, masks), 1.0, camera, None))
    light = replace(parts.light, file=there(parts.light.file, folder))
    file = folder / "transforms.json"
    return write_capture(Capture(folder, file, there(parts.mesh, folder), (), light, tuple(frames)), folder)


def recovered(capture: Path, test: Path, options: Sequence[str]) -> dict[str, Any]:
    """Reconstruct a capture, relight it from the test's cameras under its light, and compare."""
    material, renders = capture / "material", capture / "renders"
    made = run("reconstruct", capture, "-o", material, *options)
    run("relight", material, "--cameras", test / "transforms.json", "-o", renders)
    found = run("evaluate", renders, test, "--capture")
    return {"evaluation": found, "n": made["n"], "N": made["N"], "seconds": made["seconds"]}


def checked(capture: Path) -> dict[str, Any]:
    """What `swatchwork check` says."""
    return run("check", capture, "-o", capture / "check.html")


def by_name(parts: Mapping[str, Parts], folder: Path) -> dict[str, Path]:
    """A folder for each."""
    return {name: put_together(folder / name, own).parent for name, own in parts.items()}

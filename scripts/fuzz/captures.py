# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The valid folders that are spoilt: small captures of every kind of file, a material, foreign projects."""

from __future__ import annotations

import json
import shutil
import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from swatchwork import ReconstructOptions, SolveOptions, reconstruct_folder
from swatchwork.capture import read_capture, read_image, write_exr
from swatchwork.errors import CaptureWarning
from swatchwork.simulate import procedural_environment, simulate_capture
from swatchwork.surface import Mesh, read_mesh

SIZE, VIEWS = 24, 3
QUICK = ReconstructOptions(resolution=16, basis="paper", texels=40, solve=SolveOptions(n=1, N=1))
"""As small as a whole reconstruction gets."""


def make_bases(root: Path) -> None:
    """Write each base into a folder of its name in ``root``, unless it is there."""
    marker = root / "whole"
    if marker.is_file():
        return
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    plain = root / "exr"
    simulate_capture(plain, rows=8, k=VIEWS, test_views=1, size=SIZE, materials=2, blended=1, cells=1)
    write_exr(plain / "env.exr", procedural_environment("room", 0, height=16).radiance)
    shutil.rmtree(plain / "test")
    for name, change in FLAVOURS.items():
        folder = root / name
        shutil.copytree(plain, folder)
        head = json.loads((folder / "transforms.json").read_text(encoding="utf-8"))
        change(folder, head)
        (folder / "transforms.json").write_text(json.dumps(head, indent=1), encoding="utf-8")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            read_capture(folder)
    with warnings.catch_warnings(action="ignore", category=CaptureWarning):
        # So few texels leave outliers, which are said.
        reconstruct_folder(plain, root / "material", QUICK, viewer=False)
    _foreign(root, plain)
    marker.write_text("", encoding="utf-8")


def _png(folder: Path, head: dict[str, Any]) -> None:
    """8-bit PNG with straight alpha, masks, a binary PLY, a .hdr probe."""
    (folder / "masks").mkdir()
    for frame in head["frames"]:
        file = folder / frame["file_path"]
        alpha = _coded(folder, frame, ".png", straight=True)
        frame["mask_path"] = f"masks/{file.stem}.png"
        Image.fromarray((alpha * 255).astype(np.uint8)).save(folder / frame["mask_path"])
    head["mesh"] = _ply(folder / "mesh.obj", binary=True)
    head["environment"]["file"] = _hdr(folder / "env.exr")


def _jpg(folder: Path, head: dict[str, Any]) -> None:
    """JPEG with masks in EXR, a GLB, an occluder in ASCII PLY, an angular probe."""
    (folder / "masks").mkdir()
    for frame in head["frames"]:
        alpha = _coded(folder, frame, ".jpg", straight=False)
        frame["mask_path"] = f"masks/{Path(frame['file_path']).stem}.exr"
        write_exr(folder / frame["mask_path"], np.repeat(alpha[..., None], 3, axis=-1))
    mesh = read_mesh(folder / "mesh.obj")
    table = Mesh(mesh.vertices * 0.2 + [0, 0, -3], mesh.faces, mesh.normals)
    head["occluders"] = [_write_ply(folder / "table.ply", table, binary=False)]
    head["mesh"] = _gltf(folder, mesh, "glb")
    probe = procedural_environment("room", 0, height=16).radiance[:, :16]
    write_exr(folder / "env.exr", probe)
    head["environment"] = {"file": "env.exr", "convention": "debevec-angular"}
    (folder / "mesh.obj").unlink()


def _hdr_photographs(folder: Path, head: dict[str, Any]) -> None:
    """.hdr photographs, a glTF with its buffer beside it, light and intrinsics of each frame, distortion."""
    mesh = read_mesh(folder / "mesh.obj")
    head["mesh"] = _gltf(folder, mesh, "gltf")
    shared = {key: head.pop(key) for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")}
    light = head.pop("environment")
    turn = np.eye(4)
    turn[:2, :2] = [[0, -1], [1, 0]]
    for i, frame in enumerate(head["frames"]):
        file = folder / frame["file_path"]
        frame["file_path"] = f"images/{_hdr(file)}"
        frame |= shared | {"k1": 0.01 * i, "k2": -0.001, "p1": 1e-4, "p2": 0.0, "exposure": 1.0 + i}
        frame["environment"] = light | ({"transform_matrix": turn.tolist()} if i else {})
    (folder / "mesh.obj").unlink()


def _png16(folder: Path, head: dict[str, Any]) -> None:
    """16-bit PNG without its suffix in the JSON, a glTF with its buffer inside, the angle of NeRF-Blender."""
    for frame in head["frames"]:
        _coded(folder, frame, ".png", straight=True, bits=16)
        frame["file_path"] = frame["file_path"].removesuffix(".png")
    head["mesh"] = _gltf(folder, read_mesh(folder / "mesh.obj"), "gltf", inside=True)
    head["camera_angle_x"] = float(2 * np.arctan(0.5 * SIZE / head["fl_x"]))
    for key in ("fl_x", "fl_y", "cx", "cy", "w", "h"):
        del head[key]
    (folder / "mesh.obj").unlink()


FLAVOURS: dict[str, Callable[[Path, dict[str, Any]], None]] = {
    "png": _png,
    "jpg": _jpg,
    "hdr": _hdr_photographs,
    "png16": _png16,
}
CAPTURES = ("exr", *FLAVOURS)


def _coded(folder: Path, frame: dict[str, Any], suffix: str, *, straight: bool, bits: int = 8) -> np.ndarray:
    """Turn a frame's EXR into PNG or JPEG; gives its alpha."""
    file = folder / frame["file_path"]
    image = read_image(file)
    assert image.alpha is not None
    alpha = np.asarray(image.alpha > 0.5, dtype=np.float64)
    largest = 2**bits - 1
    colour = np.clip(0.5 * image.linear, 0, 0.98) ** (1 / 2.2) * largest
    pixels = np.concatenate([colour, alpha[..., None] * largest], axis=-1).astype(f"uint{bits}")
    target = file.with_suffix(suffix)
    channels = pixels[..., [2, 1, 0, 3]] if straight else pixels[..., [2, 1, 0]]
    assert cv2.imwrite(str(target), channels)
    file.unlink()
    frame["file_path"] = f"images/{target.name}"
    return alpha


def _hdr(file: Path) -> str:
    target = file.with_suffix(".hdr")
    assert cv2.imwrite(str(target), np.ascontiguousarray(read_image(file).linear[..., ::-1]))
    file.unlink()
    return target.name


def _ply(obj: Path, *, binary: bool) -> str:
    mesh = read_mesh(obj)
    obj.unlink()
    return _write_ply(obj.with_suffix(".ply"), mesh, binary=binary)


def _write_ply(path: Path, mesh: Mesh, *, binary: bool) -> str:
    kind = "binary_little_endian" if binary else "ascii"
    head = f"ply\nformat {kind} 1.0\nelement vertex {len(mesh.vertices)}\n"
    head += "property float x\nproperty float y\nproperty float z\n"
    head += f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    if binary:
        body = mesh.vertices.astype("<f4").tobytes()
        body += b"".join(struct.pack("<Biii", 3, *face) for face in mesh.faces.tolist())
    else:
        lines = [f"{x:.6g} {y:.6g} {z:.6g}" for x, y, z in mesh.vertices]
        lines += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
        body = ("\n".join(lines) + "\n").encode()
    path.write_bytes(head.encode() + body)
    return path.name


def _gltf(folder: Path, mesh: Mesh, suffix: str, *, inside: bool = False) -> str:
    import base64

    assert mesh.uv is not None
    blocks = [
        mesh.faces.astype("<u4").tobytes(),
        mesh.vertices.astype("<f4").tobytes(),
        mesh.normals.astype("<f4").tobytes(),
        (mesh.uv * [1, -1] + [0, 1]).astype("<f4").tobytes(),
    ]
    binary = b"".join(blocks)
    starts = np.cumsum([0, *map(len, blocks)]).tolist()
    kinds = [(5125, "SCALAR", mesh.faces.size)]
    kinds += [(5126, name, len(mesh.vertices)) for name in ("VEC3", "VEC3", "VEC2")]
    head: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 1, "NORMAL": 2, "TEXCOORD_0": 3},
                        "indices": 0,
                        "material": 0,
                    }
                ]
            }
        ],
        "materials": [{}],
        "accessors": [
            {"bufferView": i, "componentType": c, "type": t, "count": n} for i, (c, t, n) in enumerate(kinds)
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": s, "byteLength": len(b)} for s, b in zip(starts, blocks, strict=False)
        ],
        "buffers": [{"byteLength": len(binary)}],
    }
    target = folder / f"mesh.{suffix}"
    if suffix == "glb":
        text = json.dumps(head).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
        target.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        return target.name
    if inside:
        head["buffers"][0]["uri"] = (
            "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
        )
    else:
        (folder / "mesh.bin").write_bytes(binary)
        head["buffers"][0]["uri"] = "mesh.bin"
    target.write_text(json.dumps(head), encoding="utf-8")
    return target.name


def _foreign(root: Path, plain: Path) -> None:
    """A Metashape and a COLMAP project of the same photographs, and files of `prepare`."""
    head = json.loads((plain / "transforms.json").read_text(encoding="utf-8"))
    focal = head["fl_x"]
    folder = root / "foreign"
    for part in ("metashape", "colmap/images", "colmap/sparse/0", "files"):
        (folder / part).mkdir(parents=True)
    cameras, images = [], []
    for i, frame in enumerate(head["frames"]):
        name = Path(frame["file_path"]).name
        shutil.copy(plain / frame["file_path"], folder / "metashape" / name)
        shutil.copy(plain / frame["file_path"], folder / "colmap/images" / name)
        world_from_cv = np.array(frame["transform_matrix"]) @ np.diag([1.0, -1, -1, 1])
        text = " ".join(map(repr, world_from_cv.ravel().tolist()))
        cameras.append(
            f'<camera id="{i}" sensor_id="0" label="{name}"><transform>{text}</transform></camera>'
        )
        pose = np.linalg.inv(world_from_cv)
        numbers = [*_quaternion(pose[:3, :3]), *pose[:3, 3].tolist()]
        images += [f"{i + 1} {' '.join(map(repr, numbers))} 1 {name}", ""]
    (folder / "metashape/cameras.xml").write_text(
        '<?xml version="1.0" encoding="UTF-8"?><document version="2.0.0"><chunk label="Chunk 1"><sensors>'
        f'<sensor id="0" label="s" type="frame"><resolution width="{SIZE}" height="{SIZE}"/>'
        f'<calibration type="frame" class="adjusted"><resolution width="{SIZE}" height="{SIZE}"/>'
        f"<f>{focal}</f>"
        f"</calibration></sensor></sensors><cameras>{''.join(cameras)}</cameras></chunk></document>",
        encoding="utf-8",
    )
    sparse = folder / "colmap/sparse/0"
    (sparse / "cameras.txt").write_text(
        f"1 SIMPLE_PINHOLE {SIZE} {SIZE} {focal} {SIZE / 2} {SIZE / 2}\n", encoding="utf-8"
    )
    (sparse / "images.txt").write_text("\n".join(images) + "\n", encoding="utf-8")
    (sparse / "points3D.txt").write_text("", encoding="utf-8")
    for name, content in FILES.items():
        (folder / "files" / name).write_text(
            content if isinstance(content, str) else json.dumps(content), encoding="utf-8"
        )


FILES: dict[str, Any] = {
    "linearize.json": {"white_balance": {"multipliers": [2.0, 1.0, 1.5]}},
    "pairs.json": {
        "mesh": "mesh.obj",
        "photographs": {"0001.exr": [{"uv_px": [1.5, 2.5], "x_in_mesh": [0.1, 0.2, 0.3]}] * 4},
    },
    "intrinsics.json": {"w": 24, "h": 24, "fl_x": 30.0, "fl_y": 30.0, "cx": 12.0, "cy": 12.0, "k1": 0.01},
    "groups.json": {"one": ["a.jpg", "b.jpg"], "two": ["c.jpg"]},
    "exposures.json": {name: {"time": "1/80", "iso": 100, "aperture": 8} for name in ("a.jpg", "b.jpg")},
    "exposures.csv": "file,time,iso,aperture\na.jpg,1/80,100,8\nb.jpg,1/40,100,8\n",
}


def _quaternion(r: np.ndarray) -> list[float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(r).as_quat().tolist()
    return [w, x, y, z]

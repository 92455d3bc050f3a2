# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What the page of ``prepare pairs`` asks for: pictures, points of the mesh, a pose, its outline, a file.

Requests are plain JSON values from outside, so each is checked here and refused with an InputError. The
page works "in the ball": (x_in_mesh - centre) / radius of the mesh's bounding ball, where single precision
suffices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

import cv2
import numpy as np

from ..arrays import F64, Bool
from ..capture import Camera
from ..errors import InputError
from ..prepare.registering import Pairs, Posed, pose_from_pairs, write_pairs
from ..prepare.registering.posing import FEWEST, RECOMMENDED
from ..report.pictures import PALETTE
from ..surface import RayScene
from .pairs_outline import outline
from .pairs_pictures import Pictures

LARGEST_PX = 2400
"""Side of an outline's picture: more than a window has on any screen."""
MOST_STOPS = 16.0


class Desk:
    """The mesh, the photographs and the pairs' file behind one page. Safe to call from several threads.

    Args:
        rays: the mesh, alone.
        mesh_name: as pairs.json has it.
        photographs: files of distinct names, whatever their endings, all of the lens's size.
        lens: their camera, at the origin.
        output: pairs.json.
        pairs: those of ``output`` by photograph's name, to go on from.
    """

    def __init__(
        self,
        rays: RayScene,
        mesh_name: str,
        photographs: Sequence[Path],
        lens: Camera,
        output: Path,
        pairs: Mapping[str, Pairs] | None = None,
    ) -> None:
        self.rays, self.mesh_name, self.lens, self.output = rays, mesh_name, lens, output
        self.pictures = Pictures(photographs)
        self.names = [file.name for file in photographs]
        self.pairs = dict(pairs or {})
        self.saved: dict[str, Pairs] | None = None
        """What was last written, all of the file; None where nothing was."""
        self._writing = Lock()

    def state(self) -> dict[str, Any]:
        """What the page needs before anything else."""
        mesh, lens = self.rays.meshes[0], self.lens
        return {
            "mesh": {
                "name": self.mesh_name,
                "vertices": len(mesh.vertices),
                "faces": len(mesh.faces),
                "centre": self.rays.centre.tolist(),
                "radius": self.rays.radius,
            },
            "lens": {name: getattr(lens, name) for name in ("width", "height", "fx", "fy", "cx", "cy")},
            "photographs": self.names,
            "pairs": self._shown(),
            "output": self.output.name,
            "fewest": FEWEST,
            "recommended": RECOMMENDED,
            "palette": list(PALETTE),
        }

    @cached_property
    def mesh_buffer(self) -> bytes:
        """Positions in the ball F32[V, 3], normals F32[V, 3], faces U32[F, 3], one after the other."""
        mesh = self.rays.meshes[0]
        position = self.rays.in_unit_ball(mesh.vertices)
        return b"".join(
            (
                position.astype("<f4").tobytes(),
                mesh.normals.astype("<f4").tobytes(),
                mesh.faces.astype("<u4").tobytes(),
            )
        )

    def picture(self, photograph: Any, stops: Any = 0.0) -> bytes:
        """A photograph as JPEG, brightened by ``stops``."""
        return self.pictures.jpeg(self._number(photograph), _number(stops, "stops", -MOST_STOPS, MOST_STOPS))

    def pick(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Where a ray, ``origin`` and ``direction`` [3] in the ball, first meets the mesh; null where not."""
        origin, direction = (_points([request.get(k)], 3, k) for k in ("origin", "direction"))
        length = np.linalg.norm(direction)
        if length < 1e-12:
            raise InputError("the direction is zero", expected="a direction")
        hit = self.rays.first_hit(self._in_mesh(origin), direction / length)
        if hit.face[0] < 0:
            return {"x_in_mesh": None}
        mesh = self.rays.meshes[0]
        return {"x_in_mesh": (hit.bary[0] @ mesh.vertices[mesh.faces[hit.face[0]]]).tolist()}

    def hidden(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Which ``x_in_mesh`` [C, 3] the mesh hides from an ``eye`` [3] in the ball."""
        eye = self._in_mesh(_points([request.get("eye")], 3, "eye"))
        x_in_mesh = _points(request.get("x_in_mesh"), 3, "x_in_mesh")
        # Stop a little short of the surface that the points lie on; farther than a texel's lift, since
        # a marker is many pixels wide.
        to_point = x_in_mesh - eye
        return {"hidden": self.rays.occluded(np.repeat(eye, len(to_point), 0), to_point, 0.999).tolist()}

    def pose(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """The pose from ``uv_px`` [C, 2] and ``x_in_mesh`` [C, 3]; where there is none, the reason."""
        uv_px, x_in_mesh = (
            _points(request.get(key), columns, key) for key, columns in (("uv_px", 2), ("x_in_mesh", 3))
        )
        if len(uv_px) != len(x_in_mesh):
            raise InputError(f"{len(uv_px)} points of the photograph and {len(x_in_mesh)} of the mesh")
        if len(uv_px) < FEWEST:
            return {"reason": f"{len(uv_px)} pairs; a pose takes {FEWEST}"}
        try:
            posed: Posed = pose_from_pairs(self.lens, uv_px, x_in_mesh)
        except InputError as error:
            return {"reason": str(error)}
        projected, _ = posed.camera.project(x_in_mesh)
        return {
            "world_from_camera": posed.camera.world_from_camera.tolist(),
            "rms_px": posed.rms_px,
            "inliers": posed.inliers.tolist(),
            "residual_px": _finite(posed.residual_px),
            "projected_px": [_finite(row) for row in projected],
            "ambiguous": posed.ambiguous,
            "focal_fits": posed.focal_fits if posed.focal_off else None,
        }

    def outline(self, request: Mapping[str, Any]) -> bytes:
        """PNG of the mesh's outline as a camera at ``world_from_camera`` has it.

        ``window`` [4] is left, top, right, bottom in the photograph's pixels, drawn at ``size`` [2].
        """
        try:
            camera = replace(self.lens, world_from_camera=np.array(request["world_from_camera"], np.float64))
        except (KeyError, ValueError, TypeError) as error:
            raise InputError("world_from_camera is no matrix", expected="4 x 4 numbers") from error
        window = _points([request.get("window")], 4, "window")[0]
        size = _points([request.get("size")], 2, "size")[0]
        if not (window[2] > window[0] and window[3] > window[1]):
            raise InputError(f"the window is {window.tolist()}", expected="left, top, right, bottom")
        width, height = (int(_number(v, "size", 1, LARGEST_PX)) for v in size.tolist())
        drawn = outline(self.rays, camera, window, (width, height))
        return bytes(cv2.imencode(".png", drawn[..., [2, 1, 0, 3]], [cv2.IMWRITE_PNG_COMPRESSION, 1])[1])

    def save(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Write pairs.json anew from ``photographs``, of the file's own form; whole or not at all.

        Raises:
            InputError: a pair is damaged, of no photograph of the page, or far outside of it.
            OutputError: the file cannot be written; the one there is intact.
        """
        photographs = request.get("photographs")
        if not isinstance(photographs, Mapping):
            raise InputError("photographs is missing", expected="an object of lists of pairs by file name")
        pairs = [self._pairs(name, listed) for name, listed in photographs.items()]
        clicked = {p.name: p for p in pairs if len(p)}
        with self._writing:
            # Pairs of photographs that this page does not show stay.
            shown = {Path(name).stem for name in self.names}
            others = {name: p for name, p in self.pairs.items() if name not in shown}
            written = {**others, **clicked}
            write_pairs(self.output, written, self.mesh_name)
            self.saved = written
        return {"saved": self.output.name, "pairs": sum(len(p) for p in clicked.values())}

    def _shown(self) -> dict[str, Any]:
        """The pairs as they are on disk, by the file name of the page's photographs."""
        kept = self.saved if self.saved is not None else self.pairs
        found = {name: kept[Path(name).stem] for name in self.names if Path(name).stem in kept}
        return {
            name: [
                {"uv_px": uv, "x_in_mesh": x}
                for uv, x in zip(p.uv_px.tolist(), p.x_in_world.tolist(), strict=True)
            ]
            for name, p in found.items()
        }

    def _pairs(self, name: str, listed: Any) -> Pairs:
        if name not in self.names:
            raise InputError(f"pairs of {name!r}", expected="one of " + ", ".join(self.names))
        if not isinstance(listed, list) or not all(isinstance(pair, Mapping) for pair in listed):
            raise InputError(
                f"the pairs of {name} are no list", expected='[{"uv_px": ..., "x_in_mesh": ...}]'
            )
        uv_px = _points([pair.get("uv_px") for pair in listed], 2, f"uv_px of {name}")
        # An object may reach over the border, and a click with it; farther off is no click.
        size = np.array([self.lens.width, self.lens.height])
        far = np.flatnonzero(((uv_px < -size) | (uv_px > 2 * size)).any(axis=1))
        if far.size:
            u, v = uv_px[far[0]]
            raise InputError(
                f"pair {far[0] + 1} of {name} is at {u:g}, {v:g}",
                expected=f"pixels of a photograph of {size[0]} x {size[1]}",
            )
        return Pairs(
            name, uv_px, _points([pair.get("x_in_mesh") for pair in listed], 3, f"x_in_mesh of {name}")
        )

    def _number(self, photograph: Any) -> int:
        try:
            number = int(photograph)
        except (TypeError, ValueError):
            number = -1
        if not 0 <= number < len(self.names):
            raise InputError(f"photograph {photograph!r}", expected=f"0 to {len(self.names) - 1}")
        return number

    def _in_mesh(self, x_in_ball: F64) -> F64:
        return self.rays.centre + self.rays.radius * x_in_ball


def _points(value: Any, columns: int, what: str) -> F64:
    """[C, columns] from lists of numbers."""
    listed = value if isinstance(value, list) else [None]
    for row in listed:
        if not (isinstance(row, list) and len(row) == columns and all(map(_is_number, row))):
            raise InputError(f"{what} has {str(row)[:60]}", expected=f"lists of {columns} finite numbers")
    return np.array(listed, dtype=np.float64).reshape(-1, columns)


def _is_number(value: Any) -> bool:
    # JSON's integers have no end, those of float64 do.
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _number(value: Any, what: str, low: float, high: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not low <= number <= high:
        raise InputError(f"{what} is {str(value)[:60]}", expected=f"a number from {low:g} to {high:g}")
    return number


def _finite(values: F64) -> list[float | None]:
    """JSON has no NaN: a point that the camera does not see is null."""
    seen: Bool = np.isfinite(values)
    return [float(v) if s else None for v, s in zip(values, seen, strict=True)]

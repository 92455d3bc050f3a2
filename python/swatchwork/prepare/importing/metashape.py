# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Agisoft Metashape's exported cameras (File > Export > Export Cameras, Agisoft XML).

Conventions (Metashape Professional manual, appendix "Camera models", frame cameras; Agisoft's forum on
axes and chunk transforms):

- camera axes x right, y down, z forward; a camera's transform is chunk_from_camera;
- the chunk's (in newer files the component's) transform takes the chunk to the world:
  x_world = scale rotation x_chunk + translation;
- with x = X / Z, y = Y / Z, r^2 = x^2 + y^2, d = 1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8, and
  t = 1 + p3 r^2 + p4 r^4:
  x' = x d + (p1 (r^2 + 2 x^2) + 2 p2 x y) t, y' = y d + (p2 (r^2 + 2 y^2) + 2 p1 x y) t,
  u = w / 2 + cx + x' f + x' b1 + y' b2, v = h / 2 + cy + y' f.
  So p1 and p2 are OpenCV's p2 and p1, and cx, cy are offsets from the image's centre;
- pixel coordinates start at the image's corner, as ours.

The mesh must be exported in the same local coordinates. A georeferenced chunk is refused: its world is
geocentric, while its meshes are exported in a map projection.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture import Camera, need_file, rigid
from swatchwork.capture.guarding import MOST_JSON_BYTES
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.prepare.importing.found import (
    Found,
    Layout,
    Request,
    Shot,
    image_folder,
    image_named,
    mask_for,
    world_from_gl_camera,
)
from swatchwork.prepare.importing.metashape_lens import (
    FITTED_PX,
    OTHERS,
    OURS,
    OurLens,
    our_lens,
)

Element = ElementTree.Element


def matches(source: Path) -> bool:
    """Whether it is, or holds, one XML file of cameras."""
    try:
        return _parsed(_file(source)).find("chunk") is not None
    except InputError:
        return False


def read(request: Request) -> Found:
    """The aligned and enabled cameras.

    Raises:
        InputError: the XML is wrong, georeferenced, of another projection or lens than we have, or a
            photograph is not found.
    """
    file = _file(request.source)
    chunks = _parsed(file).findall("chunk")
    if len(chunks) != 1:
        raise InputError(f"has {len(chunks)} chunks", file=file, expected="the cameras of one chunk")
    chunk = chunks[0]
    placements = _placements(chunk, file)
    sensors = {sensor.get("id", ""): sensor for sensor in chunk.findall("sensors/sensor")}
    beside = file.parent
    folder = image_folder(request, (beside / "images", beside / "photos", beside))
    shots, skipped = [], []
    lenses: dict[str, Camera] = {}
    for camera in chunk.iterfind("cameras//camera"):
        label = camera.get("label", "")
        enabled = camera.get("enabled", "true").lower() in ("true", "1")
        pose = camera.find("transform")
        if not enabled or pose is None:
            skipped.append(label)
            continue
        if camera.get("master_id") is not None:
            raise InputError(
                f"the camera {label} is one of a rig", file=file, expected="cameras with poses of their own"
            )
        sensor = sensors.get(camera.get("sensor_id", ""))
        if sensor is None:
            raise InputError(f"the camera {label} has no sensor", file=file, expected="a sensor_id")
        scale, world_from_chunk = placements.get(camera.get("component_id", ""), placements[""])
        chunk_from_camera = _values(pose, 16, f"the transform of {label}", file).reshape(4, 4)
        chunk_from_camera[:3, 3] *= scale
        placed = world_from_gl_camera(world_from_chunk @ chunk_from_camera, label, file)
        image = image_named(folder, label, file)
        name = image.relative_to(folder).as_posix()
        mask = mask_for(request.masks, name)
        sensor_id = camera.get("sensor_id", "")
        if sensor_id not in lenses:
            lenses[sensor_id] = _camera(sensor, label, file)
        shots.append(Shot(name, image, replace(lenses[sensor_id], world_from_camera=placed), mask))
    if skipped:
        warnings.warn(
            CaptureWarning(
                f"{file}: {len(skipped)} cameras are disabled or not aligned and are left out: "
                + ", ".join(skipped[:5])
                + (", ..." if len(skipped) > 5 else "")
            ),
            stacklevel=2,
        )
    return Found(tuple(shots), skipped=tuple(skipped))


def _file(source: Path) -> Path:
    if source.is_file():
        return source
    files = sorted(source.glob("*.xml"))
    if len(files) != 1:
        raise InputError(
            f"has {len(files)} XML files",
            file=source,
            expected="one, the exported cameras",
            hint="Give the file",
        )
    return files[0]


MOST_ELEMENTS = 1 << 22
"""Of an XML file; ten thousand cameras have some 100,000."""


def _parsed(file: Path) -> Element:
    """The document's root. A document type is refused: it could name files and expand without bound."""
    need_file(file, "cameras as Metashape exports them", most=MOST_JSON_BYTES)
    try:
        text = file.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=file) from error
    if b"<!DOCTYPE" in text.replace(b"\0", b"") or b"<!ENTITY" in text.replace(b"\0", b""):
        raise InputError("has a document type", file=file, expected="cameras as Metashape exports them")
    if text.count(b"<") > MOST_ELEMENTS:
        raise InputError(f"has more than {MOST_ELEMENTS} elements", file=file, expected="cameras")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"is not XML ({error})", file=file, hint="It may be truncated") from error


def _placements(chunk: Element, file: Path) -> dict[str, tuple[float, F64]]:
    """Scale and rigid world_from_chunk F64[4, 4] of each component; of "" where none is named."""
    found = {"": (1.0, np.eye(4))}
    whole = chunk.find("transform")
    parts = {c.get("id", ""): c.find("transform") for c in chunk.findall("components/component")}
    given = {name: element for name, element in parts.items() if element is not None}
    if whole is not None and given:
        raise InputError(
            "has a transform of the chunk and of its components", file=file, expected="the one or the other"
        )
    if whole is not None:
        given[""] = whole
    reference = (chunk.findtext("reference") or "").strip()
    if given and reference and not reference.startswith("LOCAL_CS"):
        raise InputError(
            f"the chunk is georeferenced ({reference.split(',')[0][:40]})",
            file=file,
            expected="local coordinates",
            hint="In the Reference pane choose Local Coordinates, update, and export cameras and mesh again",
        )
    for name, element in given.items():
        matrix = np.eye(4)
        # What is not there was never changed.
        for key, count in (("rotation", 9), ("translation", 3)):
            if (part := element.find(key)) is not None:
                values = _values(part, count, f"the chunk's {key}", file)
                if key == "rotation":
                    matrix[:3, :3] = values.reshape(3, 3)
                else:
                    matrix[:3, 3] = values
        scale = _number(element, "scale", 1.0, "the chunk", file)
        if scale <= 0:
            raise InputError(f"the chunk's scale is {scale:g}", file=file, expected="a positive number")
        try:
            found[name] = scale, rigid(matrix, "the chunk's transform")
        except InputError as error:
            raise InputError(error.found, file=file, expected=error.expected) from error
    return found


def _camera(sensor: Element, label: str, file: Path) -> Camera:
    """Its lens, at the origin."""
    what = f"the sensor of {label}"
    calibrations = {c.get("class", "adjusted"): c for c in sensor.findall("calibration")}
    calibration = calibrations.get("adjusted", calibrations.get("initial"))
    if calibration is None:
        raise InputError(f"{what} has no calibration", file=file, expected="an adjusted calibration")
    kinds = {sensor.get("type", "frame"), calibration.get("type", "frame")}
    if kinds != {"frame"}:
        raise InputError(
            f"{what} is of type {', '.join(sorted(kinds - {'frame'}))}", file=file, expected="frame"
        )
    size = calibration.find("resolution")
    size = sensor.find("resolution") if size is None else size
    try:
        width, height = (int(size.get(key, "")) for key in ("width", "height"))  # type: ignore[union-attr]
    except (AttributeError, ValueError):
        raise InputError(f"{what} has no resolution", file=file, expected="width and height") from None
    given = {"f": _number(calibration, "f", None, what, file)}
    given |= {key: _number(calibration, key, 0.0, what, file) for key in (*OURS[1:], *OTHERS)}
    ours = our_lens(given, width, height)
    _tell(ours, given, what, file)
    f, b1, cx, cy, k1, k2, p1, p2 = (ours.values[key] for key in OURS)
    try:
        return Camera(
            width, height, f + b1, f, width / 2 + cx, height / 2 + cy, np.eye(4), k1=k1, k2=k2, p1=p2, p2=p1
        )
    except InputError as error:
        raise InputError(f"{what}: {error.found}", file=file, expected=error.expected) from error


def _tell(ours: OurLens, given: Mapping[str, float], what: str, file: Path) -> None:
    """Warn of a lens that is not quite the given one; refuse one that is not it at all."""
    others = ", ".join(f"{key} = {given[key]:g}" for key in OTHERS if given[key])
    # Written so that NaN is refused too.
    if not ours.off_px < FITTED_PX:
        raise InputError(
            f"{what} has {others}; a lens of f, cx, cy, b1, k1, k2, p1, p2 is off by {ours.off_px:.2g} px",
            file=file,
            expected=f"less than {FITTED_PX:g} px over the image",
            hint="Export undistorted photographs and their cameras from Metashape",
        )
    if others:
        how = "f, b1, cx, cy, k1, k2, p1, p2 are fitted to it" if ours.fitted else "it is left out"
        warnings.warn(
            CaptureWarning(
                f"{file}: {what} has {others}, which our lens has not; {how}, to {ours.off_px:.2g} px at most"
            ),
            stacklevel=4,
        )


def _number(parent: Element, key: str, default: float | None, what: str, file: Path) -> float:
    element = parent.find(key)
    if element is None:
        if default is None:
            raise InputError(f"{what} has no <{key}>", file=file, expected=f"a number for {key}")
        return default
    return float(_values(element, 1, f"<{key}> of {what}", file)[0])


def _values(element: Element, count: int, what: str, file: Path) -> F64:
    try:
        values = np.array((element.text or "").split(), dtype=np.float64)
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or not np.isfinite(values).all():
        raise InputError(
            f"{what} is {(element.text or '').strip()[:60]!r}", file=file, expected=f"{count} finite numbers"
        )
    return values


LAYOUT = Layout("metashape", matches, read)

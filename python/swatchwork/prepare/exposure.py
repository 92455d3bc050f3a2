# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How much light a photograph took in: from EXIF, or from a table where EXIF is missing or wrong."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from PIL import Image as Pillow

from ..capture import need_file, parsed_json
from ..capture.guarding import MOST_JSON_BYTES
from ..errors import InputError, is_out_of_memory
from .raw import RAW_SUFFIXES, raw_exposure

_EXIF_FOLDER, _TIME, _APERTURE, _ISO = 0x8769, 33434, 33437, 34855

COLUMNS = ("time", "iso", "aperture")
"""Of a table of exposures: seconds (0.0125 or 1/80), ISO speed, f-number."""

TABLE = 'a CSV with the columns file, time, iso, aperture, or JSON {"a.jpg": {"time": "1/80", ...}}'


@dataclass(frozen=True)
class Exposure:
    """Exposure time in seconds, ISO speed, f-number."""

    time_s: float
    iso: float
    aperture: float

    @property
    def light(self) -> float:
        """What the sensor's signal is proportional to: time * (ISO / 100) / aperture^2."""
        return self.time_s * self.iso / 100 / self.aperture**2

    def as_dict(self) -> dict[str, float]:
        """For JSON, with a table's own names."""
        return {"time": self.time_s, "iso": self.iso, "aperture": self.aperture}


REFERENCE = Exposure(time_s=1 / 100, iso=100, aperture=8)
"""Radiance 1 is what brings a photograph taken so to full scale. Photographs and light probe agree because
both are divided by their own exposure relative to this one, whatever it is."""


def exposures_of(files: Sequence[Path], table: Path | None = None) -> dict[Path, Exposure]:
    """The exposure of each file: what the table says; its empty cells come from EXIF.

    Raises:
        InputError: the table is damaged, leaves a file out or gives no positive number; a file's time, ISO
            speed or aperture is in neither.
    """
    said = _read_table(table, {file.name for file in files}) if table is not None else {}
    return {file: _exposure(file, said.get(file.name, {}), table) for file in files}


def _exposure(file: Path, said: Mapping[str, float], table: Path | None) -> Exposure:
    missing = [name for name in COLUMNS if name not in said]
    values = {**(_from_file(file) if missing else {}), **said}
    missing = [name for name in COLUMNS if name not in values]
    if missing:
        sources = "its EXIF" if table is None else f"its EXIF and {table}"
        raise InputError(
            f"{sources} does not say {' or '.join(missing)}"
            if table is None
            else f"neither {sources} say {' or '.join(missing)}",
            file=file,
            expected="exposure time, ISO speed and aperture",
            hint=f"Give --exposures FILE: {TABLE}",
        )
    return Exposure(values["time"], values["iso"], values["aperture"])


def _from_file(file: Path) -> dict[str, float]:
    if file.suffix.lower() in RAW_SUFFIXES:
        found = raw_exposure(file)
    else:
        need_file(file, "a photograph")
        try:
            with Pillow.open(file, formats=("JPEG", "PNG")) as picture:
                exif = picture.getexif().get_ifd(_EXIF_FOLDER)
        except Exception as error:
            if is_out_of_memory(error):
                raise
            raise InputError(
                f"cannot be read as an image ({error})", file=file, expected="a complete image file"
            ) from error
        found = {}
        for name, tag in zip(COLUMNS, (_TIME, _ISO, _APERTURE), strict=True):
            value = exif.get(tag)
            # Some writers give ISO as a pair (standard output sensitivity first).
            found[name] = _number(value[0] if isinstance(value, tuple) and value else value)
    return {name: value for name, value in found.items() if math.isfinite(value) and value > 0}


def _number(value: Any) -> float:
    """A number, or text such as 0.0125, 1/80 or f/5.6; NaN where it is none."""
    try:
        if isinstance(value, str):
            return float(Fraction(value.strip().lower().removeprefix("f/")))
        return math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return math.nan


def _read_table(table: Path, names: set[str]) -> dict[str, dict[str, float]]:
    entries: dict[str, dict[str, float]] = {}
    for name, row in _rows(table).items():
        unknown = [key for key in row if key not in COLUMNS]
        if unknown:
            raise InputError(
                f'"{name}" has the unknown key "{unknown[0]}"', file=table, expected=", ".join(COLUMNS)
            )
        entries[name] = {}
        for key, text in row.items():
            value = _number(text)
            if not (math.isfinite(value) and value > 0):
                raise InputError(
                    f'{key} of "{name}" is {text!r}',
                    file=table,
                    expected="a positive number, or such as 1/80",
                )
            entries[name][key] = value
    # More rows than photographs are welcome: one table may serve the photographs and the light probe.
    left_out = sorted(names - set(entries))
    if left_out:
        raise InputError(f'"{left_out[0]}" is not in it', file=table, expected="a row for each photograph")
    return entries


def _rows(table: Path) -> dict[str, dict[str, Any]]:
    """File names with their raw entries; a CSV's empty cells are left out."""
    need_file(table, TABLE, most=MOST_JSON_BYTES)
    try:
        text = table.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({error})", file=table, expected=TABLE) from error
    if table.suffix.lower() == ".json":
        document = parsed_json(text, table, TABLE)
        if not isinstance(document, dict) or not all(isinstance(row, dict) for row in document.values()):
            raise InputError("is not an object of objects", file=table, expected=TABLE)
        return document
    reader = csv.DictReader(io.StringIO(text), skipinitialspace=True)
    if not {"file", "time"} <= {*(reader.fieldnames or ())}:
        raise InputError(f"has the columns {', '.join(reader.fieldnames or ())}", file=table, expected=TABLE)
    found: dict[str, dict[str, Any]] = {}
    for row in reader:
        name = row.pop("file")
        if name in found:
            raise InputError(f'"{name}" is there twice', file=table, expected="one row a photograph")
        found[name] = {key: value for key, value in row.items() if value not in (None, "")}
    return found

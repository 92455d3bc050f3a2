# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Which photographs belong together: the exposures of each view."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from ..capture import read_json
from ..errors import InputError
from .raw import RAW_SUFFIXES

CODED_SUFFIXES = (".jpg", ".jpeg", ".png")
SUFFIXES = CODED_SUFFIXES + RAW_SUFFIXES

Views = dict[str, tuple[Path, ...]]
"""Photographs by the name of their view."""


def photographs_in(places: Iterable[Path]) -> list[Path]:
    """Files as given, and of folders the photographs in them by name.

    Raises:
        InputError: a place does not exist or is no photograph; there is none; RAW and JPEG are mixed.
    """
    files: list[Path] = []
    for place in places:
        if place.is_dir():
            files += sorted(f for f in place.iterdir() if f.suffix.lower() in SUFFIXES and f.is_file())
        elif not place.is_file():
            raise InputError("no such file or folder", file=place, expected="photographs")
        elif place.suffix.lower() not in SUFFIXES:
            raise InputError(
                f"unknown image type {place.suffix!r}", file=place, expected="one of " + ", ".join(SUFFIXES)
            )
        else:
            files.append(place)
    if not files:
        raise InputError("there are no photographs", expected="files ending in " + ", ".join(SUFFIXES))
    names = [file.name for file in files]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{twice} is given twice", expected="photographs of different names")
    raw = [file for file in files if file.suffix.lower() in RAW_SUFFIXES]
    if raw and len(raw) < len(files):
        other = next(file for file in files if file not in raw)
        raise InputError(
            f"both RAW ({raw[0].name}) and other files ({other.name})",
            expected="photographs of one kind",
            hint="Name the files instead of their folder, such as card/*.NEF",
        )
    return files


def views_of(files: Sequence[Path], per_view: int = 1, groups: Path | None = None) -> Views:
    """Runs of ``per_view`` photographs in the order given, or what the JSON file ``groups`` says.

    A view is named after its first photograph. The file is {"view name": ["a.jpg", "b.jpg"], ...}.

    Raises:
        InputError: the count does not divide the photographs; the file is damaged, names no such photograph,
            one twice, or leaves one out.
    """
    if groups is not None:
        return _grouped({file.name: file for file in files}, groups)
    if per_view < 1:
        raise InputError(f"--per-view is {per_view}", expected="1 or more")
    if len(files) % per_view:
        raise InputError(
            f"{len(files)} photographs cannot be {per_view} to a view",
            expected=f"a multiple of {per_view}",
            hint="Give --groups FILE where views have different numbers",
        )
    runs = [tuple(files[i : i + per_view]) for i in range(0, len(files), per_view)]
    views = {run[0].stem: run for run in runs}
    if len(views) < len(runs):
        raise InputError("two views would have the same name", expected="photographs of different names")
    return views


def _grouped(by_name: dict[str, Path], groups: Path) -> Views:
    expected = '{"view name": ["a.jpg", "b.jpg"], ...}'
    document = read_json(groups, expected)
    if not isinstance(document, dict) or not document:
        raise InputError("is not an object", file=groups, expected=expected)
    views: Views = {}
    left = dict(by_name)
    for view, names in document.items():
        if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
            raise InputError(f'"{view}" is {names!r}', file=groups, expected="a list of file names")
        if view != Path(view).name or view in ("", ".", ".."):
            raise InputError(f'"{view}" names a view', file=groups, expected="a name fit for a file")
        for name in names:
            if name not in left:
                fault = "is there twice" if name in by_name else "is none of the photographs"
                raise InputError(f'"{name}" {fault}', file=groups, expected="each photograph once")
            del left[name]
        views[view] = tuple(by_name[name] for name in names)
    if left:
        raise InputError(f'"{next(iter(left))}" is in no view', file=groups, expected="each photograph once")
    return views

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What an earlier run wrote in its linearize.json, to do the same again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from ..capture import read_json
from ..errors import InputError

Part = TypeVar("Part")


def from_earlier(file: Path, what: str, expected: str, read: Callable[[dict[str, Any]], Part]) -> Part:
    """What ``read`` takes from linearize.json.

    Raises:
        InputError: the file cannot be read or is no JSON, or ``read`` does not find its part.
    """
    document = read_json(file, expected)
    try:
        return read(document)
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise InputError(f"holds no {what}", file=file, expected=expected) from error

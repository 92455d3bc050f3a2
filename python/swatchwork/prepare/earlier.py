# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What an earlier run wrote in its linearize.json, to do the same again."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from ..errors import InputError

Part = TypeVar("Part")


def from_earlier(file: Path, what: str, expected: str, read: Callable[[dict[str, Any]], Part]) -> Part:
    """What ``read`` takes from linearize.json.

    Raises:
        InputError: the file cannot be read or is no JSON, or ``read`` does not find its part.
    """
    try:
        return read(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=file, expected=expected) from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"holds no {what}", file=file, expected=expected) from error

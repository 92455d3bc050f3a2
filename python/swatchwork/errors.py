# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Errors and warnings, one class per thing a caller may want to catch."""

from __future__ import annotations

import errno
from os import PathLike

OUT_OF_MEMORY_SIGNS = (
    "can't start new thread",
    "cannot allocate memory",
    "failed to map segment",
    "insufficient memory",
    "bad_alloc",
    "unable to allocate memory",
    "not enough memory",
)
"""Of memory that could not be had, as libraries word it."""


class SwatchworkError(Exception):
    """Base of every error the package raises on purpose; the command line exits with code 2."""


class InputError(SwatchworkError):
    """Something given to the package is wrong.

    The message reads ``file: what was found; expected what; what to do next``.

    Args:
        found: what is wrong, with the actual value.
        file: file (and frame) at fault, if any.
        expected: what would have been right.
        hint: what to do next.
    """

    def __init__(
        self,
        found: str,
        *,
        file: str | PathLike[str] | None = None,
        expected: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.found, self.file, self.expected, self.hint = found, file, expected, hint
        message = f"{file}: {found}" if file is not None else found
        if expected:
            message += f"; expected {expected}"
        if hint:
            message += f". {hint}"
        super().__init__(message)


class OutputError(SwatchworkError):
    """A result could not be written (full disk, no permission); what was there before is intact."""


class CaptureWarning(UserWarning):
    """Legal but suspicious input; the report repeats it in words."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an error, or what it came from, is of memory that could not be had.

    Whoever turns any error of a library into an InputError lets these through: the file is not to blame.
    """
    seen: BaseException | None = error
    while seen is not None:
        if isinstance(seen, MemoryError) or (isinstance(seen, OSError) and seen.errno == errno.ENOMEM):
            return True
        if any(sign in str(seen).lower() for sign in OUT_OF_MEMORY_SIGNS):
            return True
        seen = seen.__cause__
    return False

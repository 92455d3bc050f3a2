# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Errors and warnings, one class per thing a caller may want to catch."""

from __future__ import annotations

from os import PathLike


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

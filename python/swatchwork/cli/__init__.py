# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The command line: parse, call, report."""

from .app import app, main

__all__ = ["app", "main"]

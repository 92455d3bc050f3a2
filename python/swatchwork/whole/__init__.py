# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Files and folders that appear whole or not at all, whenever the process ends."""

from .exchange import exchange
from .files import whole_file, whole_text, write_text
from .folders import is_of_writing, set_aside, whole_folder
from .siblings import NO_LOCKS_HERE, held, place_of, reason_of, sibling, sync, warn_of_no_locks

__all__ = [
    "NO_LOCKS_HERE",
    "exchange",
    "held",
    "is_of_writing",
    "place_of",
    "reason_of",
    "set_aside",
    "sibling",
    "sync",
    "warn_of_no_locks",
    "whole_file",
    "whole_folder",
    "whole_text",
    "write_text",
]

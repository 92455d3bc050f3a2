# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Too little memory, by the many names that libraries give it."""

from __future__ import annotations

import errno

OUT_OF_MEMORY = (
    b"error: out of memory; what was there before is intact. Close other programs or raise the limit, and "
    b"the same command goes on; or ask for less, with a lower --resolution, fewer --texels or, above "
    b"what the machine has, a lower --memory\n"
)

SIGNS = (
    "can't start new thread",
    "cannot allocate memory",
    "failed to map segment",
    "insufficient memory",
    "bad_alloc",
    "not enough memory",
)


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an error, or what it came from, is of memory that could not be had."""
    seen: BaseException | None = error
    while seen is not None:
        if isinstance(seen, MemoryError) or (isinstance(seen, OSError) and seen.errno == errno.ENOMEM):
            return True
        if any(sign in str(seen).lower() for sign in SIGNS):
            return True
        seen = seen.__cause__
    return False

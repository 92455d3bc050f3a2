# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Two names exchanged in one step, so that no moment is without either."""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from pathlib import Path

AT_FDCWD = -100
RENAME_EXCHANGE = 2
"""Linux, ``renameat2``."""
RENAME_SWAP = 2
"""macOS, ``renamex_np``."""

UNSUPPORTED = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EPERM}
"""What systems and file systems say that cannot; EPERM is a sandbox's filter of system calls."""


def exchange(a: Path, b: Path) -> bool:
    """Let ``a`` and ``b``, which both exist on one file system, take each other's name at once.

    Returns:
        Whether it was done; not where system or file system cannot.

    Raises:
        OSError: it can, and failed.
    """
    names = os.fsencode(a), os.fsencode(b)
    try:
        library = ctypes.CDLL(None, use_errno=True)
        if sys.platform == "darwin":
            failed = library.renamex_np(names[0], names[1], RENAME_SWAP)
        else:
            failed = library.renameat2(AT_FDCWD, names[0], AT_FDCWD, names[1], RENAME_EXCHANGE)
    except (AttributeError, OSError, TypeError):
        return False
    if not failed:
        return True
    number = ctypes.get_errno()
    if number in UNSUPPORTED:
        return False
    raise OSError(number, os.strerror(number), str(a), None, str(b))

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Scripts imported by name: several folders under scripts/ have a `run` or a `page` of their own."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"


@contextmanager
def scripts_of(folder: str) -> Iterator[None]:
    """Within, the scripts of a folder can be imported, and no other folder's stand in for them."""
    others, path = _loaded(), list(sys.path)
    for name in others:
        del sys.modules[name]
    sys.path[:0] = [str(SCRIPTS / folder), str(SCRIPTS)]
    try:
        yield
    finally:
        sys.path[:] = path
        for name in _loaded():
            del sys.modules[name]
        sys.modules.update(others)


def _loaded() -> dict[str, ModuleType]:
    """Modules that are scripts."""
    return {
        name: module
        for name, module in sys.modules.items()
        if SCRIPTS in Path(getattr(module, "__file__", None) or "/").parents
    }

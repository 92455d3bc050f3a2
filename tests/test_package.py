# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The package's face."""

from __future__ import annotations

import subprocess
import sys

import pytest

import swatchwork


@pytest.mark.parametrize("name", swatchwork.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert callable(getattr(swatchwork, name))


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="no_such_thing"):
        _ = swatchwork.no_such_thing


def test_importing_loads_nothing_heavy() -> None:
    code = "import swatchwork, sys; print(sorted({'numpy', 'cv2', 'trimesh'} & sys.modules.keys()))"
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        == "[]\n"
    )

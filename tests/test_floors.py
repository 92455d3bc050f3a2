# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The two checks of the house rules: that they pass here, and that they fail on a planted violation."""

from __future__ import annotations

import importlib.util
import sys
import types
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]


def _script(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / "ci" / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


floors = _script("check_floors")
stubs = _script("check_stub")


def _package(tmp_path: Path, files: dict[str, str]) -> Path:
    folder = tmp_path / "swatchwork"
    for name, text in {"__init__.py": "", **files}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def test_package_keeps_to_its_floors() -> None:
    assert floors.violations(ROOT / "python" / "swatchwork") == []


def test_architecture_shows_the_same_floors() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    for line in floors.FLOORS.strip().splitlines():
        assert any(set(line.split()) <= set(row.replace(",", " ").split()) for row in text.splitlines()), line


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        ("capture/reader.py", "from swatchwork.surface import Mesh", "capture climbs to surface"),
        ("capture/reader.py", "import swatchwork.surface.mesh", "capture climbs to surface"),
        ("capture/reader.py", "from swatchwork import surface", "capture climbs to surface"),
        ("capture/reader.py", "from ..surface.mesh import Mesh", "capture climbs to surface"),
        ("capture/reader.py", "from .. import surface", "capture climbs to surface"),
        ("capture/__init__.py", "from ..surface import Mesh", "capture climbs to surface"),
        ("capture/deep/x.py", "from ...surface import Mesh", "capture climbs to surface"),
        ("material/io.py", "from swatchwork.surface import Mesh", "material crosses to its sibling surface"),
        ("solve/qp.py", "def f():\n    import swatchwork.cli", "solve climbs to cli"),
        (
            "light/a.py",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..response import R",
            "light climbs to response",
        ),
        ("light/a.py", "import importlib\nimportlib.import_module('swatchwork.cli')", "light climbs to cli"),
        ("cellar/a.py", "x = 1", "cellar has no floor"),
        ("cli/a.py", "from swatchwork.attic import x", "attic has no floor"),
        ("cli/a.py", "from swatchwork import reconstruct_all", "cli imports the package's face"),
    ],
)
def test_planted_import_is_named_with_file_and_line(
    tmp_path: Path, file: str, text: str, complaint: str
) -> None:
    folder = _package(tmp_path, {file: text})
    (line,) = floors.violations(folder)
    number = len(text.splitlines())
    assert line.startswith(f"{folder / file}:{number}: ")
    assert complaint in line


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("cli/a.py", "from swatchwork.workflow import x\nfrom ..errors import y"),
        ("solve/a.py", "from .b import x\nfrom . import c\nfrom swatchwork.solve.d import e"),
        ("solve/a.py", "import numpy\nfrom scipy import surface\nfrom swatchwork_other import cli"),
        ("__init__.py", "from .workflow import run"),
    ],
)
def test_downward_own_and_foreign_imports_are_free(tmp_path: Path, file: str, text: str) -> None:
    assert floors.violations(_package(tmp_path, {file: text})) == []


def test_check_floors_exits_with_1_on_a_violation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = _package(tmp_path, {"errors.py": "import swatchwork.cli"})
    assert floors.main([str(folder)]) == 1
    assert "errors.py:1: errors climbs to cli" in capsys.readouterr().out


def test_stub_agrees_with_the_built_module() -> None:
    assert stubs.main([]) == 0


def _module() -> types.ModuleType:
    module = types.ModuleType("built")

    def solve(a, b=3, *, tight=False):  # type: ignore[no-untyped-def]
        return a, b, tight

    class Pyramid:
        levels = property(lambda self: 3)

        def __new__(cls, base):  # type: ignore[no-untyped-def]
            return object.__new__(cls)

        def lookup(self, level):  # type: ignore[no-untyped-def]
            return level

        @staticmethod
        def empty(size):  # type: ignore[no-untyped-def]
            return size

    module.solve, module.Pyramid = solve, Pyramid  # type: ignore[attr-defined]
    return module


STUB = """
def solve(a: int, b: int = 3, *, tight: bool = False) -> int: ...

class Pyramid:
    def __new__(cls, base: int) -> Pyramid: ...
    @property
    def levels(self) -> int: ...
    def lookup(self, level: int) -> int: ...
    @staticmethod
    def empty(size: int) -> int: ...
"""


def test_equal_stub_and_module_agree() -> None:
    assert stubs.disagreements(_module(), STUB) == []


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("def solve(", "def resolve(", "resolve: in the stub only"),
        ("def solve(", "def resolve(", "solve: in the built module only"),
        ("b: int = 3", "b: int = 4", "solve: the stub says"),
        ("b: int = 3", "c: int = 3", "solve: the stub says"),
        ("b: int = 3", "b: int", "solve: the stub says"),
        ("*, tight", "tight", "solve: the stub says"),
        ("    def lookup(self, level: int) -> int: ...\n", "", "Pyramid.lookup: in the built module only"),
        ("def lookup(self, level: int)", "def lookup(self)", "Pyramid.lookup: the stub says"),
        ("cls, base: int", "cls, base: int, size: int", "Pyramid.__new__: the stub says"),
        ("size: int", "wide: int", "Pyramid.empty: the stub says"),
        ("    @property\n", "", "Pyramid.levels: a function in the stub only"),
        ("class Pyramid:", "class Pyramids:", "Pyramids: in the stub only"),
    ],
)
def test_planted_disagreement_is_named(old: str, new: str, complaint: str) -> None:
    assert old in STUB
    found = stubs.disagreements(_module(), STUB.replace(old, new))
    assert any(line.startswith(complaint) for line in found), found


def test_missing_stub_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert stubs.main(["math", str(tmp_path / "none.pyi")]) == 1
    assert "no stub" in capsys.readouterr().out

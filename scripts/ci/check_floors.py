# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Fail when an import climbs a floor, or crosses to a sibling room of the same floor.

Every import counts: absolute or relative, inside a function, under ``TYPE_CHECKING``, and
``importlib.import_module`` of a literal. Run ``python scripts/ci/check_floors.py [PACKAGE_FOLDER]``.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGE = "swatchwork"

FLOORS = """
    cli
    reproduce
    workflow
    baselines  report  viewer  export  analysis  evaluate
    reconstruct  relight  simulate  prepare
    streaming  interreflection
    solve  observe
    response
    surface  light  reflectance  material
    capture
    octahedral  whole
    arrays  errors  keeping  progress  _native
"""
"""A room may import from the lines below its own, and from nothing else."""

FLOOR_OF = {room: i for i, line in enumerate(FLOORS.strip().splitlines()) for room in line.split()}

FACE = "the package's face"
"""``swatchwork/__init__.py`` stands above every floor: it may import any room, and no room may import it."""


def room_of(parts: tuple[str, ...]) -> str:
    """The room that the dotted module ``parts`` (below the package) belongs to."""
    return parts[0] if parts else FACE


def imported(
    tree: ast.AST, module: tuple[str, ...], is_package: bool
) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Line and dotted path (below the package) of every import of the package's own modules in ``tree``."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _own(node.lineno, alias.name.split("."))
        elif isinstance(node, ast.ImportFrom):
            yield from _imported_from(node, module, is_package)
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            name = ast.unparse(node.func)
            if name.endswith(("import_module", "__import__")) and isinstance(node.args[0].value, str):
                yield from _own(node.lineno, node.args[0].value.split("."))


def _own(line: int, parts: list[str]) -> Iterator[tuple[int, tuple[str, ...]]]:
    if parts[0] == PACKAGE:
        yield line, tuple(parts[1:])


def _imported_from(
    node: ast.ImportFrom, module: tuple[str, ...], is_package: bool
) -> Iterator[tuple[int, tuple[str, ...]]]:
    parts = tuple(node.module.split(".")) if node.module else ()
    if node.level == 0:
        if parts[0] != PACKAGE:
            return
        base = parts[1:]
    else:
        here = module if is_package else module[:-1]
        base = here[: len(here) - (node.level - 1)] + parts
    # `from swatchwork import x`: x is a room where the table has it, else a name of the face.
    for alias in node.names:
        yield node.lineno, base if base else ((alias.name,) if alias.name in FLOOR_OF else ())


def violation(room: str, target: str) -> str | None:
    """Why ``room`` may not import ``target``, or None where it may."""
    if room == target:
        return None
    if target == FACE:
        return f"{room} imports {FACE}; import the room that owns the name"
    if target not in FLOOR_OF:
        return f"{target} has no floor; add it to the table in {Path(__file__).name}"
    if room == FACE or FLOOR_OF[room] < FLOOR_OF[target]:
        return None
    how = "crosses to its sibling" if FLOOR_OF[room] == FLOOR_OF[target] else "climbs to"
    return f"{room} {how} {target}; a room imports only from the floors below its own"


def violations(folder: Path) -> list[str]:
    """``file:line: reason`` for every import of ``folder`` (the package) that breaks the rule."""
    found = []
    for file in sorted(folder.rglob("*.py")) + sorted(folder.rglob("*.pyi")):
        module = file.relative_to(folder).with_suffix("").parts
        is_package = module[-1] == "__init__"
        module = module[:-1] if is_package else module
        room = "cli" if module == ("__main__",) else room_of(module)
        if room != FACE and room not in FLOOR_OF:
            found.append(f"{file}:1: {room} has no floor; add it to the table in {Path(__file__).name}")
            continue
        tree = ast.parse(file.read_text(encoding="utf-8"), filename=str(file))
        for line, parts in imported(tree, module, is_package):
            reason = violation(room, room_of(parts))
            if reason:
                found.append(f"{file}:{line}: {reason}")
    return sorted(set(found))


def main(arguments: list[str]) -> int:
    folder = Path(arguments[0]) if arguments else Path(__file__).resolve().parents[2] / "python" / PACKAGE
    found = violations(folder)
    for line in found:
        print(line)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

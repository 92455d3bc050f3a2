# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Fail when ``_native.pyi`` and the built native module disagree, in either direction.

Compared: names, what each is (function, class, value), methods, properties, parameters with their kinds
and defaults. Run ``python scripts/ci/check_stub.py``; a module and a stub may be given, for the tests.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

MODULE = "swatchwork._native"
STUB = Path(__file__).resolve().parents[2] / "python" / "swatchwork" / "_native.pyi"

Members = dict[str, Any]


def parameters_of_stub(node: ast.FunctionDef, bound: bool) -> list[str]:
    """Each parameter as ``kind name`` or ``kind name=default``, without self or cls when ``bound``."""
    a = node.args
    plain = [("positional", p) for p in a.posonlyargs] + [("plain", p) for p in a.args]
    defaults: list[ast.expr | None] = [None] * (len(plain) - len(a.defaults)) + list(a.defaults)
    out = [_written(kind, p.arg, d) for (kind, p), d in zip(plain, defaults, strict=True)]
    out = out[1:] if bound else out
    out += [f"*{a.vararg.arg}"] if a.vararg else []
    out += [_written("keyword", p.arg, d) for p, d in zip(a.kwonlyargs, a.kw_defaults, strict=True)]
    return out + ([f"**{a.kwarg.arg}"] if a.kwarg else [])


def _written(kind: str, name: str, default: ast.expr | None) -> str:
    return f"{kind} {name}" if default is None else f"{kind} {name}={ast.unparse(default)}"


def parameters_of_object(thing: Callable[..., Any], bound: bool) -> list[str] | None:
    """The same for a built function; None where it states no signature."""
    try:
        parameters = list(inspect.signature(thing).parameters.values())
    except (ValueError, TypeError):
        return None
    kinds = {
        inspect.Parameter.POSITIONAL_ONLY: "positional",
        inspect.Parameter.POSITIONAL_OR_KEYWORD: "plain",
        inspect.Parameter.KEYWORD_ONLY: "keyword",
    }
    out = []
    for p in parameters[1:] if bound else parameters:
        if p.kind in kinds:
            default = "" if p.default is inspect.Parameter.empty else f"={p.default!r}"
            out.append(f"{kinds[p.kind]} {p.name}{default}")
        else:
            out.append(("*" if p.kind is inspect.Parameter.VAR_POSITIONAL else "**") + p.name)
    return out


def same(stub: list[str], built: list[str] | None) -> bool:
    """Whether two parameter lists agree; ``...`` as a default in either stands for any default."""
    if built is None or len(stub) != len(built):
        return False
    return all(
        s == b or (s.split("=")[0] == b.split("=")[0] and "=..." in s + b and "=" in s and "=" in b)
        for s, b in zip(stub, built, strict=True)
    )


def members_of_stub(body: list[ast.stmt]) -> Members:
    """Public names a stub declares; in a class also ``__new__`` (or ``__init__``)."""
    members: Members = {}
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            members["__new__" if node.name == "__init__" else node.name] = node
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            members[node.target.id] = node
    return {name: node for name, node in members.items() if name == "__new__" or not name.startswith("_")}


def members_of_object(thing: Any) -> Members:
    """Public names a built module or class has."""
    return {
        name: value for name, value in vars(thing).items() if name == "__new__" or not name.startswith("_")
    }


def decorators(node: ast.FunctionDef) -> set[str]:
    return {ast.unparse(d) for d in node.decorator_list}


def compare(stub: Members, built: Members, where: str, owner: type | None = None) -> list[str]:
    """Every disagreement below ``where``, in words."""
    found = [f"{where}{name}: in the stub only" for name in sorted(stub.keys() - built.keys())]
    found += [f"{where}{name}: in the built module only" for name in sorted(built.keys() - stub.keys())]
    for name in sorted(stub.keys() & built.keys()):
        node, thing = stub[name], built[name]
        if isinstance(node, ast.ClassDef):
            if not inspect.isclass(thing):
                found.append(f"{where}{name}: a class in the stub only")
                continue
            found += compare(members_of_stub(node.body), members_of_object(thing), f"{where}{name}.", thing)
        elif isinstance(node, ast.AnnAssign) or "property" in decorators(node):
            if inspect.isclass(thing) or inspect.isroutine(thing):
                found.append(f"{where}{name}: a value in the stub only")
        elif not callable(thing) and not isinstance(thing, classmethod | staticmethod):
            found.append(f"{where}{name}: a function in the stub only")
        else:
            found += _compare_function(node, thing, f"{where}{name}", owner)
    return found


def _compare_function(node: ast.FunctionDef, thing: Any, where: str, owner: type | None) -> list[str]:
    static = "staticmethod" in decorators(node)
    stub = parameters_of_stub(node, bound=owner is not None and not static)
    if owner is None or node.name in ("__new__", "__init__"):
        built = parameters_of_object(owner or thing, bound=False)
    else:
        instance = not static and "classmethod" not in decorators(node)
        built = parameters_of_object(getattr(owner, node.name), bound=instance)
    if same(stub, built):
        return []
    written = "no signature" if built is None else f"({', '.join(built)})"
    return [f"{where}: the stub says ({', '.join(stub)}), the built module {written}"]


def disagreements(module: Any, stub: str) -> list[str]:
    """Every disagreement between a built module and the text of its stub."""
    return compare(members_of_stub(ast.parse(stub).body), members_of_object(module), "")


def main(arguments: list[str]) -> int:
    name, path = (arguments[0], Path(arguments[1])) if arguments else (MODULE, STUB)
    if not path.exists():
        print(f"{path}: no stub; every name of {name} needs its signature there")
        return 1
    found = disagreements(importlib.import_module(name), path.read_text(encoding="utf-8"))
    for line in found:
        print(f"{path.name}: {line}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

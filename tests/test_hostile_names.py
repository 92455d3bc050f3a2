# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Names made to do harm where they are shown, in pages and on terminals; and what the code itself forgoes."""

from __future__ import annotations

import ast
import json
import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

import swatchwork
from swatchwork import ReconstructOptions, SolveOptions
from swatchwork.cli import main
from swatchwork.cli.console import ConsoleProgress, plain
from swatchwork.report import render_sheet
from swatchwork.simulate import procedural_environment, simulate_capture
from swatchwork.workflow import analyze_views, check_capture, plan_views, reconstruct_folder
from swatchwork.workflow.register_page import register_sheet

EVIL = "<img src=x onerror=alert(1)>\"'&[red]x"
TINY = ReconstructOptions(resolution=16, basis="paper", texels=40, solve=SolveOptions(n=1, N=1))


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of three 24-pixel photographs; folder, mesh, light and photographs have evil names."""
    folder = tmp_path_factory.mktemp("names") / EVIL
    simulate_capture(folder, rows=8, k=3, test_views=1, size=24, materials=2, blended=1)
    head = json.loads((folder / "transforms.json").read_text())
    for file, to, key, entry in (
        ("mesh.obj", f"{EVIL}.obj", "mesh", head),
        ("env.exr", f"{EVIL}.exr", "file", head["environment"]),
        ("images/0001.exr", f"images/{EVIL}.exr", "file_path", head["frames"][0]),
    ):
        (folder / file).rename(folder / to)
        entry[key] = to
    (folder / "transforms.json").write_text(json.dumps(head))
    return folder


class Page(HTMLParser):
    """Tags and attributes of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))


def assert_harmless(text: str, *, scripts: bool = False) -> None:
    """The name is there, as text only; the page has a policy, and no script that is not its own."""
    assert "<img src=x" not in text
    assert re.search(r"(&lt;|\\u003c)img src=x onerror", text), "the name is not shown at all"
    tags = Page(text).tags
    assert not any(name.startswith("on") for _, attributes in tags for name in attributes)
    (policy,) = [
        a["content"] or ""
        for tag, a in tags
        if tag == "meta" and a.get("http-equiv") == "Content-Security-Policy"
    ]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'" and rules["base-uri"] == "'none'"
    if scripts:
        assert re.fullmatch(r"'sha256-[A-Za-z0-9+/=]+'", rules["script-src"])
    else:
        assert "script-src" not in rules and not any(tag == "script" for tag, _ in tags)


def test_pages_show_names_as_text(capture: Path, tmp_path: Path) -> None:
    check_capture(capture, tmp_path / "check.html")
    assert_harmless((tmp_path / "check.html").read_text(encoding="utf-8"))
    reconstruct_folder(capture, tmp_path / EVIL, TINY)
    assert_harmless((tmp_path / EVIL / "report.html").read_text(encoding="utf-8"))
    assert_harmless((tmp_path / EVIL / "viewer.html").read_text(encoding="utf-8"), scripts=True)
    analyze_views(capture=capture, page=tmp_path / "analyze.html")
    assert_harmless((tmp_path / "analyze.html").read_text(encoding="utf-8"))


def test_the_page_of_a_plan(capture: Path, tmp_path: Path) -> None:
    light = procedural_environment("room", 0, height=16)
    mesh = capture / f"{EVIL}.obj"
    plan_views(tmp_path / EVIL, mesh=mesh, environment=light, views=2, candidates=8, size=64)
    (page,) = (tmp_path / EVIL).glob("*.html")
    assert_harmless(page.read_text(encoding="utf-8"))


def test_the_page_of_a_registration() -> None:
    summary: Any = SimpleNamespace(capture=EVIL, photographs=(), suspicions=(EVIL,))
    assert_harmless(render_sheet(register_sheet(summary, (), {EVIL: EVIL}, {})))


def test_the_terminal_shows_names_as_text(capture: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither escapes nor line ends of a name reach it, nor are brackets taken for colours."""
    assert main(["info", str(capture)]) == 0
    assert "[red]x" in capsys.readouterr().out
    assert main(["info", "no\x1b[2Jsuch\nerror: thing\r\x9b"]) == 2
    said = capsys.readouterr().err
    assert "no\\x1b[2Jsuch\\nerror: thing\\r\\x9b" in said and said.count("\n") == 1
    assert plain("a\u202eb\x7f\ud800") == "a\\u202eb\\x7f\\ud800"
    assert plain("a\nb\tc", lines=True) == "a\nb\\tc"


def test_bars_show_names_as_text() -> None:
    console = Console(force_terminal=True, width=120, record=True)
    progress = ConsoleProgress(console)
    with progress.stage(EVIL, 2) as task:
        task.describe("[bold]\x1b[2J\n" + EVIL)
        bars = progress._bars
        assert bars is not None
        console.print(bars.make_tasks_table(bars.tasks))
    shown = console.export_text()
    assert "[red]x" in shown and "[bold]\\x1b[2J\\n" in shown


PACKAGE = Path(swatchwork.__file__).parent
FORBIDDEN = {"eval", "exec", "pickle", "cPickle", "dill", "marshal", "shelve", "yaml", "joblib"}


@cache
def sources() -> tuple[tuple[Path, ast.AST], ...]:
    files = [file for file in sorted(PACKAGE.rglob("*.py")) if "node_modules" not in file.parts]
    return tuple((file, ast.parse(file.read_text(encoding="utf-8"))) for file in files)


def test_nothing_is_unpickled_or_evaluated() -> None:
    wrong = []
    for file, tree in sources():
        for node in ast.walk(tree):
            where = f"{file.relative_to(PACKAGE)}:{getattr(node, 'lineno', 0)}"
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [a.name.partition(".")[0] for a in node.names] if isinstance(node, ast.Import) else []
                names += [(node.module or "").partition(".")[0]] if isinstance(node, ast.ImportFrom) else []
                wrong += [f"{where}: {name}" for name in names if name in FORBIDDEN]
            if not isinstance(node, ast.Call):
                continue
            called = ast.unparse(node.func)
            keywords = {k.arg: ast.unparse(k.value) for k in node.keywords}
            if called in ("eval", "exec", "compile", "__import__", "os.system", "os.popen"):
                wrong.append(f"{where}: {called}")
            if called == "np.load" and keywords.get("allow_pickle") != "False":
                wrong.append(f"{where}: np.load without allow_pickle=False")
            if keywords.get("shell", "False") != "False":
                wrong.append(f"{where}: a shell")
    assert wrong == []


def test_xml_is_parsed_in_one_place_that_refuses_document_types() -> None:
    """Entities are declared in a document type: without one, nothing expands and nothing is fetched."""
    parsers = [
        str(file.relative_to(PACKAGE))
        for file, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and re.search(
            r"\.(fromstring|XML|iterparse|XMLParser|parseString)$|(ElementTree|Xml|minidom|sax)\.parse$",
            ast.unparse(node.func),
        )
    ]
    assert parsers == ["prepare/importing/metashape.py"]
    text = (PACKAGE / parsers[0]).read_text(encoding="utf-8")
    assert text.index('b"<!DOCTYPE"') < text.index("ElementTree.fromstring")


def test_html_is_made_in_one_room() -> None:
    """Only there is a string taken for markup; all pages come from it, or from the viewer's template."""
    makers = {
        file.relative_to(PACKAGE).parts[0]
        for file, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "Html"
    }
    assert makers == {"report"}

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The command line: help, exit codes, what goes to which stream, and that the README's commands work."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from swatchwork import workflow
from swatchwork.cli import main
from swatchwork.cli.console import SHOW_AFTER_S, ConsoleProgress
from swatchwork.cli.options import parse_rotation
from swatchwork.errors import CaptureWarning, InputError

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = ("reconstruct", "relight", "evaluate", "demo", "info")


@pytest.fixture(autouse=True)
def _wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert re.fullmatch(r"swatchwork \d+\.\d+\.\d+\n", capsys.readouterr().out)


def test_help_names_every_command_and_where_to_begin(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(command in text for command in (*COMMANDS, "swatchwork demo demo", "Exit codes"))


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command_has_examples_that_parse(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main([command, "-h"]) == 0
    text = capsys.readouterr().out
    examples = re.findall(rf"^ *(swatchwork {command}.*)$", text.split("Examples:")[1], re.MULTILINE)
    assert examples
    names = ("reconstruct_folder", "relight_folder", "evaluate_folders", "run_demo", "describe")

    def reached(*_: Any, **__: Any) -> None:
        raise InputError("reached")

    for name in names:
        monkeypatch.setattr(workflow, name, reached)
    for example in examples:
        assert main(shlex.split(example)[1:]) == 2
        assert "reached" in capsys.readouterr().err, example


def test_no_arguments_show_help(capsys: pytest.CaptureFixture[str]) -> None:
    main([])
    captured = capsys.readouterr()
    assert "reconstruct" in captured.out + captured.err


@pytest.mark.parametrize(
    "arguments",
    [
        ["bogus"],
        ["reconstruct"],
        ["reconstruct", "x", "-o", "y", "--basis", "other"],
        ["demo", "x", "--seed", "-1"],
    ],
)
def test_wrong_usage_exits_with_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Error" in captured.err


def test_wrong_input_is_one_line_on_stderr(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["reconstruct", str(tmp_path / "nowhere"), "-o", str(tmp_path / "out"), "--json", "--quiet"]
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("error: ") and captured.err.count("\n") == 1
    assert "nowhere" in captured.err
    assert list(tmp_path.iterdir()) == []


def test_n_above_N_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reconstruct", "x", "-o", "y", "--n", "3", "--N", "2"]) == 2
    assert "--n is 3 and --N is 2" in capsys.readouterr().err


def test_relight_without_cameras_says_what_to_give(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["relight", "material", "-o", "renders"]) == 2
    assert "transforms.json" in capsys.readouterr().err


def test_options_arrive(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, Any] = {}

    def reconstruct_folder(capture: Path, output: Path, options: Any, **rest: Any) -> None:
        seen.update(capture=capture, output=output, options=options, **rest)
        raise InputError("enough")

    monkeypatch.setattr(workflow, "reconstruct_folder", reconstruct_folder)
    line = "reconstruct c -o m --n 2 --N 4 --max-n 3 --max-N 9 --lambda0 1e-4 --lambda1 0 --resolution 64"
    line += " --basis paper --views 6 --search pruned --search-order paper --seed 7 --texels 500"
    assert main(line.split()) == 2
    options, solve = seen["options"], seen["options"].solve
    assert (seen["capture"], seen["output"], seen["views"]) == (Path("c"), Path("m"), 6)
    assert (options.resolution, options.basis, options.texels, options.solve.seed) == (64, "paper", 500, 7)
    assert (solve.n, solve.N, solve.max_n, solve.max_N) == (2, 4, 3, 9)
    assert (solve.lambda0, solve.lambda1) == (1e-4, 0.0)
    assert (solve.search, solve.search_order, solve.seed) == ("pruned", "paper", 7)


def test_defect_shows_its_traceback_and_exits_with_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(workflow, "describe", lambda path: 1 / 0)
    assert main(["info"]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "ZeroDivisionError" in captured.err and "defect" in captured.err


def test_interrupt_exits_with_130(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(path: Path | None) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(workflow, "describe", interrupted)
    assert main(["info", "--json"]) == 130
    captured = capsys.readouterr()
    assert captured.out == "" and "interrupted" in captured.err


def test_warnings_are_shown_and_collected(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def describe(path: Path | None) -> dict[str, Any]:
        warnings.warn("the probe is [dim]", CaptureWarning, stacklevel=2)
        return {"answer": 42}

    monkeypatch.setattr(workflow, "describe", describe)
    assert main(["info", "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {"answer": 42, "warnings": ["the probe is [dim]"]}
    assert captured.err == "warning: the probe is [dim]\n"


def test_info_on_this_installation(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["cores"] >= 1 and found["instruction sets"]


@pytest.mark.parametrize(
    ("text", "expected"), [(None, None), ("z:90", ("z", 90.0)), ("45", ("z", 45.0)), ("X:-1.5", ("x", -1.5))]
)
def test_rotation_is_read(text: str | None, expected: tuple[str, float] | None) -> None:
    assert parse_rotation(text) == expected


@pytest.mark.parametrize("text", ["", "w:90", "z:", "z:nan", "z:inf", "z:1:2", ":90"])
def test_bad_rotation_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="--environment-rotation"):
        parse_rotation(text)


def test_without_a_terminal_each_outermost_stage_is_a_line() -> None:
    stream = io.StringIO()
    progress = ConsoleProgress(Console(file=stream))
    with progress.stage("observe", 2) as task:
        with progress.stage("inner") as inner:
            inner.describe("x")
            inner.advance()
        task.advance(2)
    assert re.fullmatch(r"observe: \d+\.\d s\n", stream.getvalue())


def test_on_a_terminal_short_stages_leave_no_trace_of_a_bar() -> None:
    stream = io.StringIO()
    progress = ConsoleProgress(Console(file=stream, force_terminal=True, width=100))
    with progress.stage("observe", 2) as task:
        task.advance()
    assert SHOW_AFTER_S >= 1
    assert "observe" not in stream.getvalue()


def readme_commands() -> list[str]:
    """Commands of the README's shell blocks, in their order, comments and continuations resolved."""
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [line.split("#")[0].strip() for line in lines if line.split("#")[0].strip()]


def test_readme_commands_run(tmp_path: Path) -> None:
    """All of them, in order, in an empty folder; "my-capture" is the capture that the demo made."""
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    bin_folder = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{bin_folder}{os.pathsep}{os.environ['PATH']}"}
    ran = 0
    for command in readme_commands():
        words = shlex.split(command)
        if words[0] == "make":
            assert set(words[1:]) <= targets, command
            continue
        if words[0] == "git" or words[0] == "cd":
            continue
        assert words[0] in ("swatchwork", ".venv/bin/swatchwork"), command
        if "my-capture" in command and not (tmp_path / "my-capture").exists():
            (tmp_path / "my-capture").symlink_to(tmp_path / "demo" / "capture")
        done = subprocess.run(
            ["swatchwork", *words[1:]],
            cwd=tmp_path,
            env=environment,
            executable=bin_folder / "swatchwork",
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
        ran += 1
    assert ran >= 4
    assert (tmp_path / "demo" / "report.html").stat().st_size > 100_000


def test_readme_python_example_runs(tmp_path: Path) -> None:
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    compile(block, "README.md", "exec")
    # Names it imports exist; the reconstruction itself is the command's, run above.
    for line in block.splitlines():
        if line.startswith(("import ", "from ")):
            exec(line, {})


@pytest.mark.parametrize("document", ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"])
def test_documents_name_files_that_exist(document: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    paths = re.findall(r"`((?:python|crates|scripts|tests|docs)/[\w./-]+)`", text)
    paths += [p for p in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in p]
    assert paths
    assert [p for p in paths if not (ROOT / p).exists()] == []

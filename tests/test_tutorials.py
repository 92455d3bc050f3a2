# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The tutorials: that they can be run, that what they name is there, and that their runner tells failures."""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from scripts_of import scripts_of
from swatchwork.cli import main

ROOT = Path(__file__).resolve().parents[1]
with scripts_of("tutorials"):
    import blocks
    import pictures
    import run

FILES = [run.TUTORIALS / f"{name}.md" for name in run.ORDER]
ALL_PICTURES_BYTES = 1_500_000


def steps(file: Path) -> list[blocks.Block | blocks.Picture]:
    return blocks.steps_of(file, file.read_text(encoding="utf-8"))


def commands(block: blocks.Block) -> list[list[str]]:
    """The words of each line that begins with swatchwork, continuations resolved."""
    lines = block.code.replace("\\\n", " ").splitlines()
    return [shlex.split(line)[1:] for line in lines if line.strip().startswith("swatchwork ")]


def write(file: Path, text: str) -> Path:
    file.write_text(text, encoding="utf-8")
    return file


# ---- The tutorials themselves --------------------------------------------------------------------
def test_every_tutorial_is_run_and_listed() -> None:
    assert sorted(run.TUTORIALS.glob("*.md")) == sorted([*FILES, run.TUTORIALS / "README.md"])
    index = (run.TUTORIALS / "README.md").read_text(encoding="utf-8")
    assert all(f"({file.name})" in index for file in FILES)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_blocks_parse_and_show_what_they_printed(file: Path) -> None:
    found = [step for step in steps(file) if isinstance(step, blocks.Block)]
    assert len(found) >= 4
    for block in found:
        if block.language == "python":
            compile(block.code, f"{file.name}:{block.first_line}", "exec")
        else:
            subprocess.run(["bash", "-n", "-c", block.code], check=True)
        if block.shown is not None:
            lines = file.read_text(encoding="utf-8").split("\n")[slice(*block.shown)]
            assert any(lines), f"{file.name}:{block.first_line} shows nothing: make tutorials"


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_commands_and_options_exist(
    file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    monkeypatch.setenv("NO_COLOR", "1")
    named = [words for step in steps(file) if isinstance(step, blocks.Block) for words in commands(step)]
    assert named
    for words in named:
        command = words[: 2 if words[0] == "prepare" else 1]
        assert main([*command, "--help"]) == 0, words
        help_text = set(re.findall(r"(?<!\S)--?[A-Za-z0-9][\w-]*", capsys.readouterr().out))
        options = {word for word in words if re.match(r"--?[A-Za-z]", word)}
        assert options <= help_text, f"{file.name}: {shlex.join(words)}: no {options - help_text}"


@pytest.mark.parametrize("file", [*FILES, run.TUTORIALS / "README.md"], ids=lambda file: file.stem)
def test_pictures_and_links_are_there(file: Path) -> None:
    named = re.findall(r"\]\(([^)#\s]+)", file.read_text(encoding="utf-8"))
    assert [name for name in named if not (file.parent / name).exists()] == []
    assert any(name.startswith("pictures/") for name in named)


def test_pictures_are_small_and_all_used() -> None:
    there = sorted((run.TUTORIALS / "pictures").iterdir())
    made = {step.file for file in FILES for step in steps(file) if isinstance(step, blocks.Picture)}
    assert {f"pictures/{file.name}" for file in there} == made
    sizes = [file.stat().st_size for file in there]
    assert max(sizes) <= pictures.LARGEST_BYTES and sum(sizes) < ALL_PICTURES_BYTES


def test_the_first_blocks_run(tmp_path: Path) -> None:
    """A whole tutorial takes more than a minute; these make a scan and plan views, in some ten seconds."""
    file = run.TUTORIALS / "reading_the_analysis.md"
    before = file.read_bytes()
    assert run.run_tutorial(file, tmp_path, blocks=2, write=False) == []
    assert file.read_bytes() == before
    assert {"scan.obj", "probe.exr", "plan"} <= {path.name for path in tmp_path.iterdir()}
    assert (tmp_path / "plan" / "plan.html").is_file()


# ---- Their runner --------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "block",
    ["```sh\nfalse\necho on\n```", "```python\nraise SystemExit(3)\n```", "```sh\ntrue\nfalse | cat\n```"],
)
def test_a_failing_block_fails_the_run(
    block: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"# T\n\n```sh\necho fine\n```\n\n```text\nold\n```\n\n{block}\n"
    file = write(tmp_path / "t.md", text)
    assert run.main(["--folder", str(tmp_path / "scratch"), str(file)]) == 1
    assert f"{file}:11: this" in capsys.readouterr().err
    assert file.read_text(encoding="utf-8") == text


def test_a_picture_of_what_is_not_there_fails_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path / "t.md", "<!-- picture: row a.png -->\n![a](pictures/a.png)\n")
    assert run.main(["--folder", str(tmp_path / "scratch"), str(file)]) == 1
    assert f"{file}:1: no picture" in capsys.readouterr().err


def test_output_is_rewritten_and_stays_the_same(tmp_path: Path) -> None:
    text = (
        "```sh\npwd; echo 'done (2.5 s, 31 MB)'\n```\n\n```text\nold\nolder\n```\n\nprose\n\n"
        "```python\nprint('a')\nprint('b')\n```\n\n```text\n```\n\n```sh by-hand\nfalse\n```\n"
    )
    file, scratch = write(tmp_path / "t.md", text), tmp_path / "scratch"
    for _ in range(2):
        assert run.main(["--folder", str(scratch), str(file)]) == 0
        expected = text.replace("old\nolder", ".\ndone (... s, ... MB)").replace(
            "```text\n```", "```text\na\nb\n```"
        )
        assert file.read_text(encoding="utf-8") == expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("```sh\ntrue\n", r"t\.md:1: this block is not closed"),
        ("```bash\ntrue\n```\n", r"t\.md:1: a block of type 'bash'"),
        ("words\n```text\nout\n```\n", r"t\.md:2: a text block shows"),
        ("```sh\ntrue\n```\nwords\n```text\nout\n```\n", r"t\.md:5: a text block shows"),
        ("<!-- picture: row a.png -->\n\n![a](a.png)\n", r"t\.md:1: expected <!-- picture"),
    ],
)
def test_a_tutorial_that_cannot_be_read_is_refused(text: str, said: str) -> None:
    with pytest.raises(blocks.TutorialError, match=said):
        blocks.steps_of(Path("t.md"), text)


def test_a_picture_that_looks_the_same_is_kept(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    picture = rng.integers(40, 200, (240, 200, 3)).astype(np.uint8)
    Pillow.fromarray(picture).save(tmp_path / "a.png")
    file = tmp_path / "pictures" / "a.png"
    assert pictures.make("row a.png", tmp_path, file)
    # One level everywhere: another processor's rounding.
    Pillow.fromarray(picture + 1).save(tmp_path / "a.png")
    assert not pictures.make("row a.png", tmp_path, file)
    # A mark of 12 pixels: something changed.
    picture[100:112, 50:62] = 255
    Pillow.fromarray(picture).save(tmp_path / "a.png")
    assert pictures.make("row a.png", tmp_path, file)


def test_a_page_without_a_browser_is_skipped_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    monkeypatch.setattr(pictures, "BROWSERS", ())
    file = write(tmp_path / "t.md", "<!-- picture: page a.html body -->\n![a](a.png)\n")
    old = tmp_path / "a.png"
    old.write_bytes(b"old")
    assert run.main(["--folder", str(tmp_path / "scratch"), str(file)]) == 0
    assert "a.png: skipped, the old picture stays" in capsys.readouterr().out
    assert old.read_bytes() == b"old"

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What `make faults` keeps and writes."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts_of import scripts_of

ROOT = Path(__file__).resolve().parents[1]
with scripts_of("faults"):
    import page as faults_page
    import shared

    import reliability


def test_each_part_of_the_page_is_its_own(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    reliability.put(page, "faults", "first words")
    reliability.put(page, "hostile", "two")
    reliability.put(page, "faults", "three")
    text = page.read_text()
    assert text.startswith("# Reliability") and "first" not in text
    assert text.index("three") < text.index("<!-- /faults -->") < text.index("<!-- hostile -->\ntwo\n")
    page.write_text("<!-- faults -->")
    with pytest.raises(ValueError, match="without"):
        reliability.put(page, "faults", "four")


def test_what_other_code_found_is_not_used(tmp_path: Path) -> None:
    assert shared.FAULTS.name == shared.code_digest()
    script = tmp_path / "script.py"
    script.write_text("a = 1")
    first = shared.code_digest([script])
    assert shared.code_digest([script]) == first
    script.write_text("a = 2")
    assert shared.code_digest([script]) != first


def test_a_known_limit_is_told_from_what_holds_and_what_fails(tmp_path: Path) -> None:
    rows = [
        shared.Row("a", 1, "good", True),
        shared.Row("b", 1, "bad", False),
        shared.Row("c", 1, "known", False, limit=True),
    ]
    faults_page.write(tmp_path / "page.md", {"memory": shared.rows_of(rows)})
    text = (tmp_path / "page.md").read_text()
    assert (
        "| a | 1 | good | holds |" in text
        and "| b | 1 | bad | **fails** |" in text
        and f"commit {shared.results.COMMIT} (" in text
    )
    assert "| c | 1 | known | known limit |" in text and "forked" in text

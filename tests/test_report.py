# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The report page: self-contained, escaped, whole, and leaving out what it was not given."""

from __future__ import annotations

import base64
import dataclasses
import io
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from swatchwork.errors import OutputError
from swatchwork.report import (
    Comparison,
    Figure,
    Picture,
    Report,
    StageCost,
    Trial,
    blend_colours,
    crop_box,
    display,
    exposure_for,
    heat,
    relative_error,
    render_page,
    shrink,
    write_report,
)
from swatchwork.report.pictures import PALETTE, rgb

VOID = {"img", "meta", "br", "hr"}
NASTY = "<script>alert('&')</script>\"onload=\"x"


class _Page(HTMLParser):
    """Tags balance; everything that could load something is kept."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def _picture(caption: str = "a picture", size: int = 8) -> Picture:
    return Picture(caption, np.full((size, size, 4), 128, dtype=np.uint8))


def _full(text: str = "plain") -> Report:
    compared = Comparison(text, _picture(text), _picture(text), _picture(text), 0.123)
    return Report(
        title=text,
        summary=text,
        hero=(_picture(text),),
        figures=(Figure(text, text, text),),
        warnings=(text,),
        novel=(compared,),
        novel_light=text,
        views=(compared,),
        relit=(_picture(text),),
        spheres=(_picture(text), _picture(text)),
        blend_map=_picture(text),
        maps=(_picture(text),),
        trials=(Trial(1, 1, 0.1), Trial(1, 2, 0.05), Trial(2, 2, 0.04), Trial(2, 3, float("nan"))),
        chosen=(2, 2),
        status=text,
        coverage=_picture(text),
        coverage_note=text,
        inputs=((text, text),),
        settings=((text, text),),
        costs=(StageCost(text, 1.5, 100.0), StageCost(text, 0.0, 100.0)),
        next_steps=((text, text),),
        version=text,
    )


def test_page_is_whole_and_loads_nothing() -> None:
    page = _Page(render_page(_full()))
    assert page.open == []
    for tag, attributes in page.tags:
        assert tag not in ("script", "link", "iframe", "object", "form", "base", "a")
        assert not any(name.startswith("on") for name in attributes)
        assert (attributes.get("src") or "data:").startswith(
            "data:image/png;base64,"
        ) or "src" not in attributes
    text = render_page(_full())
    assert "http:" not in text and "https:" not in text and "url(" not in text and "@import" not in text


def test_page_forbids_everything_but_its_own_pictures_and_style() -> None:
    page = _Page(render_page(_full()))
    (policy,) = [a["content"] for tag, a in page.tags if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    assert policy.startswith("default-src 'none'; img-src data:; style-src 'unsafe-inline'")
    # The policy holds for what follows it, so it comes before the first style.
    tags = [tag for tag, _ in page.tags]
    assert tags.index("meta") < tags.index("style")


def test_every_string_is_escaped() -> None:
    plain, nasty = render_page(_full("plain")), render_page(_full(NASTY))
    assert "<script" not in nasty
    # Whatever the strings hold, the page has the same elements with the same attributes.
    shape = [[(tag, sorted(a)) for tag, a in _Page(text).tags] for text in (plain, nasty)]
    assert shape[0] == shape[1]
    assert NASTY in "".join(_Page(nasty).words)


@pytest.mark.parametrize("field", [f.name for f in dataclasses.fields(Report) if f.name != "title"])
def test_what_is_missing_is_left_out(field: str) -> None:
    bare = Report(title="bare")
    page = _Page(render_page(dataclasses.replace(_full(), **{field: getattr(bare, field)})))
    assert page.open == []
    assert "None" not in "".join(page.words)


def test_bare_page_has_its_title_and_the_citation() -> None:
    page = _Page(render_page(Report(title="bare")))
    assert "bare" in page.words
    assert any("10.1145/2980179.2980247" in words for words in page.words)


def test_search_plot_rings_the_chosen_pair() -> None:
    text = render_page(_full())
    assert text.count('class="ring"') == 1
    assert "n = 1" in text and "n = 2" in text
    assert "nan" not in re.sub(r"base64,[^\"]*", "", text).lower()


def test_pictures_survive_as_png() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 4), dtype=np.uint8)
    text = render_page(Report(title="x", hero=(Picture("p", pixels),)))
    (encoded,) = re.findall(r'src="data:image/png;base64,([^"]+)"', text)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(base64.b64decode(encoded)))), pixels)


def test_write_replaces_whole_and_leaves_no_partial(tmp_path: Path) -> None:
    file = tmp_path / "deep" / "report.html"
    write_report(file, Report(title="one"))
    write_report(file, Report(title="two"))
    assert "two" in file.read_text(encoding="utf-8")
    assert [p.name for p in file.parent.iterdir()] == ["report.html"]


def test_write_into_something_that_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        write_report(tmp_path / "file" / "report.html", Report(title="x"))


def test_display_is_gamma_of_unpremultiplied_radiance() -> None:
    linear = np.full((1, 1, 3), 0.25, dtype=np.float32)
    alpha = np.full((1, 1), 0.5, dtype=np.float32)
    rgba = display(linear, alpha, 1.0)[0, 0]
    # 0.25 / 0.5 = 0.5; 255 * 0.5 ** (1 / 2.2) = 186.08
    assert rgba.tolist() == [186, 186, 186, 128]


def test_exposure_brings_highlights_to_the_key() -> None:
    linear = np.linspace(0, 10, 1000, dtype=np.float32).reshape(10, 100, 1).repeat(3, axis=2)
    factor = exposure_for(linear, np.ones((10, 100)), key=0.9)
    # The 98 % quantile of a ramp to 10 is 9.8.
    assert factor == pytest.approx(0.9 / 9.8, rel=1e-3)
    assert exposure_for(linear * 0, np.ones((10, 100))) == 1.0
    assert exposure_for(linear, np.zeros((10, 100))) == 1.0


def test_relative_error_is_in_units_of_the_reference() -> None:
    reference = np.full((4, 4, 3), 2.0, dtype=np.float32)
    mask = np.ones((4, 4), dtype=bool)
    mask[0] = False
    error = relative_error(reference * 1.1, reference, mask)
    # f32 input, so the tenth is exact to 1e-6 only.
    assert error[mask] == pytest.approx(0.1, abs=1e-6)
    assert (error[~mask] == 0).all()


def test_heat_runs_from_dark_to_light_and_hides_the_outside() -> None:
    values = np.array([[0.0, 0.5, 1.0, 9.0, np.nan]])
    rgba = heat(values, np.array([[True, True, True, False, True]]), 1.0)[0].astype(int)
    assert rgba[0, :3].sum() < rgba[1, :3].sum() < rgba[2, :3].sum()
    assert rgba[:, 3].tolist() == [255, 255, 255, 0, 255]


def test_blend_colours_mix_by_weight() -> None:
    index = np.array([[[0, 1], [1, 1], [0, 0]]], dtype=np.uint32)
    weight = np.array([[[0.5, 0.5], [1.0, 0.0], [0.0, 0.0]]], dtype=np.float32)
    rgba = blend_colours(index, weight, 2)[0].astype(int)
    first, second = np.array(rgb(PALETTE[0])), np.array(rgb(PALETTE[1]))
    # Rounded to 8 bits twice: within 1.
    assert np.abs(rgba[0, :3] - (first + second) / 2).max() <= 1
    assert rgba[1, :3].tolist() == second.tolist()
    assert rgba[:, 3].tolist() == [255, 255, 0]


def test_crop_and_shrink() -> None:
    alpha = np.zeros((100, 200), dtype=np.float32)
    alpha[40:60, 100:130] = 1
    rows, columns = crop_box(alpha)
    assert rows.start < 40 and rows.stop >= 60 and columns.start < 100 and columns.stop >= 130
    assert rows.stop - rows.start == columns.stop - columns.start
    assert crop_box(alpha * 0) == (slice(0, 100), slice(0, 200))
    assert shrink(np.zeros((100, 200, 4), dtype=np.uint8), 50).shape == (25, 50, 4)
    assert shrink(np.zeros((10, 20, 4), dtype=np.uint8), 50).shape == (10, 20, 4)

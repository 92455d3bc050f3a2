# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The report as one self-contained HTML page: no network, no script, nothing outside the file."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files

from .html import Child, Html, el, join
from .model import Comparison, Figure, Picture, Report
from .photographs import photographs_together
from .pictures import PALETTE, data_uri, heat_gradient
from .plots import search_plot

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"

PAPER = (
    "Zhiming Zhou, Guojun Chen, Yue Dong, David Wipf, Yong Yu, John Snyder, Xin Tong. "
    "Sparse-as-Possible SVBRDF Acquisition. ACM Transactions on Graphics 35(6), 2016. "
    "doi:10.1145/2980179.2980247"
)


def render_page(report: Report) -> str:
    """The whole page. Every string of ``report`` is text: it is escaped, never markup."""
    return document(report.title, report.version, _header(report), _sections(report))


def document(title: str, version: str, header: Html, main: Child) -> str:
    """A page that needs no network and runs no script, around a header and sections."""
    head = el(
        "head",
        el("meta", charset="utf-8"),
        el("meta", http_equiv="Content-Security-Policy", content=POLICY),
        el("meta", name="viewport", content="width=device-width, initial-scale=1"),
        el("meta", name="generator", content=f"swatchwork {version}".strip()),
        el("title", title),
        el("style", Html(files(__package__).joinpath("style.css").read_text(encoding="utf-8"))),
    )
    footer = f"Made by Swatchwork {version}".strip() + ". This page needs no network and runs no script."
    body = el("body", header, el("main", main), el("footer", footer))
    return "<!doctype html>\n" + el("html", head, body, lang="en") + "\n"


def _header(r: Report) -> Html:
    swatches = [el("i", style=f"background:{colour}") for colour in PALETTE[: max(4, len(r.spheres))]]
    return el(
        "header",
        el("div", swatches, el("span", "Swatchwork report"), cls="brand"),
        el("h1", r.title),
        el("p", r.summary, cls="lead") if r.summary else None,
        el("div", [figure(p) for p in r.hero], cls="hero") if r.hero else None,
        el("p", el("a", "Turn it and light it yourself", href=r.viewer), cls="lead") if r.viewer else None,
        headline_figures(r.figures),
        _warnings(r),
    )


def headline_figures(figures: Sequence[Figure]) -> Html | None:
    """Numbers in boxes, each with what it is."""
    if not figures:
        return None
    items = [
        el("li", el("b", f.value), f.label, el("span", f.note, cls="note") if f.note else None)
        for f in figures
    ]
    return el("ul", items, cls="figures")


def _warnings(r: Report) -> Html | None:
    if not r.warnings:
        return None
    heading = "Worth a look" if len(r.warnings) > 1 else "Worth a look:"
    return el(
        "div", el("strong", heading), el("ul", [el("li", w) for w in r.warnings]), cls="warnings", role="note"
    )


def _sections(r: Report) -> Html:
    return join(
        _novel(r),
        _views(r),
        _relit(r),
        _together(r),
        _materials(r),
        _blend(r),
        _maps(r),
        _search(r),
        _costs(r),
        _inputs(r),
        _next(r),
        _cite(r),
    )


def section(title: str, intro: str, *content: Html | list[Html] | None) -> Html:
    """A heading, a few words, and what belongs to it."""
    return el("section", el("h2", title), el("p", intro, cls="soft") if intro else None, *content)


def figure(picture: Picture, caption: Html | str | None = None) -> Html:
    """A picture with its caption, inside the page."""
    height, width = picture.pixels.shape[:2]
    image = el(
        "img",
        src=data_uri(picture.pixels),
        alt=picture.caption,
        width=width,
        height=height,
        cls="crisp" if picture.crisp else None,
    )
    return el("figure", image, el("figcaption", picture.caption if caption is None else caption))


def _comparison(c: Comparison) -> Html:
    error = f", NRMS {100 * c.nrms:.1f} %" if c.nrms is not None else ""
    pictures = [figure(p) for p in (c.reference, c.rendered, c.error) if p is not None]
    return el("div", el("p", el("strong", c.name), error), pictures, cls="row")


def _heat_key(r: Report) -> Html:
    bar = el("i", style=f"background:{heat_gradient()}")
    return el(
        "div", "error 0", bar, f"{100 * r.error_scale:.0f} % of the reference's RMS, and above", cls="key"
    )


def _novel(r: Report) -> Html | None:
    if not r.novel:
        return None
    intro = (
        "The recovered material under a light that was not used to recover it, from cameras that were not "
        "used either, beside the reference. This is the test that counts."
    )
    light = f" The light: {r.novel_light}." if r.novel_light else ""
    return section("Under new light", intro + light, [_comparison(c) for c in r.novel], _heat_key(r))


def _views(r: Report) -> Html | None:
    if not r.views:
        return None
    intro = "Each photograph, the material rendered from its camera under its light, and the difference."
    return section("The photographs, explained", intro, [_comparison(c) for c in r.views], _heat_key(r))


def _relit(r: Report) -> Html | None:
    if not r.relit:
        return None
    intro = "The material under lights that have nothing to do with the capture's, each at its own exposure."
    return section("Under other lights", intro, el("div", [figure(p) for p in r.relit], cls="hero"))


def _together(r: Report) -> Html | None:
    if not r.photographs:
        return None
    intro = (
        "Each photograph beside what the others foretell of it, at points that they share: how bright it is "
        "against them, and the misfit that is left after that, from 0 to 1. Gloss and rims are foretold less "
        "well than matte surfaces that many photographs show: only what stands far out is a suspect."
    )
    doubt = f"There are {r.photographs_doubt}." if r.photographs_doubt else None
    rest = [el("p", el("strong", doubt))] if doubt else []
    return section("The photographs against each other", intro, *rest, photographs_together(r.photographs))


def _materials(r: Report) -> Html | None:
    if not r.spheres:
        return None
    count = len(r.spheres)
    intro = (
        f"The object is made of {_number(count)} material{'s' if count > 1 else ''}, shown here on a sphere "
    )
    intro += "under the capture's light. Every point of the surface blends a few of them."
    spheres = []
    for i, picture in enumerate(r.spheres):
        dot = el("i", cls="dot", style=f"background:{PALETTE[i % len(PALETTE)]}")
        spheres.append(figure(picture, join(dot, picture.caption)))
    return section("Its materials", intro, el("div", spheres, cls="spheres"))


def _blend(r: Report) -> Html | None:
    pictures = [figure(p) for p in (r.blend_map, r.coverage, r.trust) if p is not None]
    if not pictures:
        return None
    intro = "The surface laid flat. First, which material is where, in the colours of the dots above"
    intro += "; then, how many photographs saw each point." if r.coverage is not None else "."
    if r.trust is not None:
        intro += " Last, the error to expect of each point in a view that was not photographed: "
        intro += "learnt from points blended anew without one of their photographs."
    if r.blend_map is None:
        intro = "The surface laid flat: how many photographs saw each point."
    return section("Where they are", f"{intro} {r.coverage_note}".strip(), el("div", pictures, cls="split"))


def _maps(r: Report) -> Html | None:
    if not r.maps:
        return None
    intro = "What usual renderers read, fitted to the blended material at each point."
    return section("Its maps", intro, el("div", [figure(p) for p in r.maps], cls="grid"))


def _search(r: Report) -> Html | None:
    if len(r.trials) < 2:
        return None
    kept = f" Kept: n = {r.chosen[0]}, N = {r.chosen[1]} (ringed)." if r.chosen else ""
    intro = (
        "How many materials (N), and how many of them at one point (n), nobody says beforehand: the search "
        "tries more as long as the misfit falls by more than the penalty for the extra material rises."
    )
    status = el("p", r.status, cls="soft") if r.status else None
    return section("How many materials", intro + kept, search_plot(r.trials, r.chosen), status)


def _costs(r: Report) -> Html | None:
    if not r.costs:
        return None
    longest = max(c.seconds for c in r.costs) or 1.0
    rows = [
        el(
            "tr",
            el("th", c.name, scope="row"),
            el("td", el("i", style=f"width:{100 * c.seconds / longest:.1f}%"), cls="bar"),
            el("td", f"{c.seconds:.1f} s", cls="number"),
            el("td", f"{c.peak_mb:.0f} MB", cls="number"),
        )
        for c in r.costs
    ]
    total = sum(c.seconds for c in r.costs)
    intro = f"{total:.1f} s altogether; the last column is the peak memory of the process during the stage."
    return section("What it cost", intro, el("table", rows))


def _inputs(r: Report) -> Html | None:
    tables = []
    for title, pairs in (("Inputs", r.inputs), ("Settings", r.settings)):
        if pairs:
            rows = [el("tr", el("th", name, scope="row"), el("td", value)) for name, value in pairs]
            tables.append(el("div", el("h3", title), el("table", rows)))
    return section("What went in", "", el("div", tables, cls="split")) if tables else None


def _next(r: Report) -> Html | None:
    if not r.next_steps:
        return None
    steps = [join(el("p", what), el("pre", el("code", command))) for what, command in r.next_steps]
    return section("Where to go from here", "", steps)


def _cite(r: Report) -> Html:
    software = f"Swatchwork contributors. Swatchwork {r.version}".strip() + ". Software, MIT license."
    return section("How to cite", "", el("p", "The method: ", PAPER), el("p", "The software: ", software))


def _number(count: int) -> str:
    words = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
    return words[count] if count < len(words) else str(count)

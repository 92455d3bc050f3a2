# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The viewer as one HTML file that asks nothing of any network: data, style and script are inside."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator
from html import escape
from importlib.resources import files
from os import PathLike
from pathlib import Path
from string import Template

from ..errors import InputError
from ..whole import whole_file
from .packing import pack
from .scene import ViewerScene

BUNDLE = "bundle/viewer.js"
BUILD = "scripts/packaging/build_viewer.py"
MARKS = (b'<meta name="generator" content="swatchwork', b'<canvas id="stage"')
"""What every page has among its first `MARK_BYTES`, and no other page of ours."""
MARK_BYTES = 65536
POLICY = (
    "default-src 'none'; script-src '{hash}'; style-src 'unsafe-inline'; img-src data: blob:; "
    "connect-src 'none'; base-uri 'none'; form-action 'none'"
)
"""Nothing is fetched from anywhere, and no script runs but the page's own."""


def bundled_script() -> str:
    """The viewer's script, as esbuild made it from ``web/``.

    Raises:
        InputError: it was not built.
    """
    try:
        script = files(__package__).joinpath(BUNDLE).read_text(encoding="utf-8")
    except OSError:
        raise InputError(
            "the viewer's script was not built",
            file=str(files(__package__).joinpath(BUNDLE)),
            expected="what `make setup` or `pip install .` makes",
            hint=f"In a checkout, run: python {BUILD}",
        ) from None
    # Inside a page, this would end the script's element wherever it stands.
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def render_viewer(viewer: ViewerScene) -> str:
    """The whole page. Every name in ``viewer`` is text: it is escaped, never markup."""
    return "".join(_parts(viewer))


def write_viewer(file: str | PathLike[str], viewer: ViewerScene) -> Path:
    """Write the page to ``file``, whole or not at all.

    Raises:
        InputError: the viewer's script was not built.
        OutputError: the file cannot be written.
    """
    path = Path(file)
    parts = list(_parts(viewer))
    # Names of files may hold what is no Unicode: surrogates, which UTF-8 has no bytes for.
    with whole_file(path) as made, made.open("w", encoding="utf-8", errors="replace") as stream:
        stream.writelines(parts)
    return path


def check_replaceable(file: str | PathLike[str]) -> None:
    """That nothing is lost where a page is written to ``file``: it is new, or a page of ours.

    Raises:
        InputError: there is something else.
    """
    path = Path(file)
    if path.exists() and not is_viewer(path):
        raise InputError(
            "exists, and is not a viewer's page",
            file=path,
            expected="a new file, or a page that swatchwork wrote, to replace",
            hint="Give another --output, or move it away",
        )


def is_viewer(path: Path) -> bool:
    """Whether a file is a viewer's page, by how it begins."""
    try:
        if not path.is_file():
            return False
        with path.open("rb") as stream:
            start = stream.read(MARK_BYTES)
    except OSError:
        return False
    return all(mark in start for mark in MARKS)


def _parts(viewer: ViewerScene) -> Iterator[str]:
    script = bundled_script()
    head, blocks = pack(viewer)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    page = Template(files(__package__).joinpath("page.html").read_text(encoding="utf-8"))
    blank = page.substitute(
        policy=POLICY.format(hash=f"sha256-{digest}"),
        title=escape(viewer.title),
        version=escape(viewer.version),
        style=files(__package__).joinpath("style.css").read_text(encoding="utf-8"),
        # JSON knows < as an escape too, so that no string can end its element.
        head=json.dumps(head, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        blocks="\0blocks\0",
        script="\0script\0",
    )
    before, rest = blank.split("\0blocks\0")
    between, after = rest.split("\0script\0")
    yield before
    for name, text in blocks.text.items():
        yield f'<script type="text/plain" id="block:{name}">{text}</script>\n'
    yield between
    yield script
    yield after

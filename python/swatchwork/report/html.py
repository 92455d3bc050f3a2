# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""HTML built from values: a plain string is text and is escaped; only ``Html`` is markup."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

VOID = frozenset({"img", "meta", "br", "hr", "col", "line", "rect", "circle", "path", "stop"})


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


Child = str | Html | None | Iterable["Child"]


def el(tag: str, *children: Child, **attributes: str | float | None) -> Html:
    """One element. ``cls`` stands for ``class``, an underscore in a name for a hyphen; None is left out."""
    written = "".join(
        f' {"class" if name == "cls" else name.replace("_", "-")}="{escape(_text(value), quote=True)}"'
        for name, value in attributes.items()
        if value is not None
    )
    if tag in VOID:
        return Html(
            f"<{tag}{written}/>" if tag in ("line", "rect", "circle", "path") else f"<{tag}{written}>"
        )
    return Html(f"<{tag}{written}>{join(*children)}</{tag}>")


def join(*children: Child) -> Html:
    """Children one after the other, flattened, plain strings escaped."""
    out = []
    for child in children:
        if child is None:
            continue
        if isinstance(child, Html):
            out.append(str(child))
        elif isinstance(child, str):
            out.append(escape(child, quote=False))
        else:
            out.append(str(join(*child)))
    return Html("".join(out))


def _text(value: str | float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)

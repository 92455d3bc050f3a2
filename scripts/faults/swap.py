# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""kill -9 exactly where a new material takes an older one's place, with and without an exchange of names."""

from __future__ import annotations

import shutil
import signal
from typing import Any

import forking
import shared
from same_bits import contents, differing
from shared import Row

MOMENTS = {
    "kill-before-swap": ("before the names are exchanged", "older"),
    "kill-after-exchange": ("after the names are exchanged", "new"),
    "kill-while-removing": ("while the older folder is removed", "new"),
    "kill-between-renames": ("between two renames, where the file system cannot exchange names", "none"),
    "kill-after-renames": ("after both renames", "new"),
}
"""What OUT is then. Between two renames it is nothing, and the older material whole in a hidden neighbour."""


def measure() -> dict[str, Any]:
    whole = {name: of for name, of in contents(shared.whole()).items() if name != "viewer.html"}
    old = contents(shared.older())
    rows = []
    for fault, (words, expected) in MOMENTS.items():
        output = forking.ready(shared.emptied("swap"))
        code, _ = forking.run(forking.reconstruct(output), fault)
        wrong = [] if code == -signal.SIGKILL else [f"was not killed: {code}"]
        found = contents(output) if output.exists() else {}
        state = "none" if not found else "older" if found == old else "new" if found == whole else "half"
        if state != expected:
            wrong.append(f"OUT is {state}")
        if state == "none":
            wrong += _put_back(output, old)
        code, said = forking.run(forking.reconstruct(output))
        if code or differing(output, whole) or shared.left_beside(output):
            wrong.append(f"the same command then: {code} {said} {shared.left_beside(output)}")
        told = {"none": "set aside whole; the reader says where, the next run puts it back"}.get(state, state)
        says = (
            "; ".join(wrong) or f"OUT is {told}; the same command ends with the new material, nothing beside"
        )
        rows.append(Row(f"kill -9 {words}", 1, says, not wrong))
    return shared.rows_of(rows)


def _put_back(output: Any, old: dict[str, str]) -> list[str]:
    """A reader names the older folder; a run that then fails has put it back."""
    wrong = []
    cameras = str(shared.capture() / "transforms.json")
    arguments = ["relight", str(output), "--cameras", cameras, "-o", str(output.with_name("r"))]
    code, said = forking.run(arguments)
    if code != 2 or ".replaced" not in said:
        wrong.append(f"a reader says {said!r}")
    shutil.rmtree(output.with_name("r"), ignore_errors=True)
    # No such capture: nothing but the older material's return can come of it.
    code, _ = forking.run(["reconstruct", str(output.with_name("none")), "-o", str(output)])
    if code != 2 or contents(output) != old:
        wrong.append("it is not put back")
    return wrong

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A limit on the address space (`ulimit -v`), level by level: a clear error, never a touched OUT.

A process that needs more ends in Python (exit 2, one line), or in the core, which cannot be told from Python
what to do when memory is refused: it says how many bytes were, and aborts (SIGABRT). The row names each.
"""

from __future__ import annotations

import resource
import signal
from pathlib import Path
from typing import Any

import forking
import shared
from same_bits import contents, differing
from shared import Row

EXTRA_MB = (0, 50, 150, 300, 600)
"""Above what the process has when it begins."""


def measure() -> dict[str, Any]:
    whole = {name: of for name, of in contents(shared.whole()).items() if name != "viewer.html"}
    ends: dict[int, tuple[int, str]] = {}
    wrong = []
    for extra in EXTRA_MB:
        output = shared.with_older(shared.emptied("memory"))

        def limited(extra: int = extra) -> None:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            most = pages * resource.getpagesize() + extra * 10**6
            resource.setrlimit(resource.RLIMIT_AS, (most, most))

        code, said = forking.run(forking.reconstruct(output), before=limited)
        ends[extra] = code, said.strip()[-400:]
        left = [name for name in shared.left_beside(output) if name != "out.partial"]
        # An abort is as a kill -9: what is temporary stays until the next run.
        if code == 2:
            bad = forking.one_line(code, said, 2, "out of memory", "--memory", "--resolution")
            wrong += [f"{extra} MB: {w}" for w in (bad, *left) if w]
        elif code == -signal.SIGABRT:
            if "memory allocation of" not in said:
                wrong.append(f"{extra} MB: aborts without a word on memory: {said[-300:]}")
        elif code:
            wrong.append(f"{extra} MB: exit code {code}: {said[-300:]}")
        if contents(output) != (whole if code == 0 else contents(shared.older())):
            wrong.append(f"{extra} MB: OUT is not what it must be")
        if code:
            code, said = forking.run(forking.reconstruct(output))
            if code or differing(output, whole) or shared.left_beside(output):
                wrong.append(f"{extra} MB: the same command without the limit: {code} {said}")
    words = {0: "is enough", 2: "exit 2 and one line", -signal.SIGABRT: "the core aborts (134)"}
    each = ", ".join(f"+{extra} MB {words.get(code, code)}" for extra, (code, _) in ends.items())
    found = "; ".join([each, *wrong[:3]]) + "; OUT untouched, and identical materials without the limit"
    row = Row("`ulimit -v` above what the process begins with", len(EXTRA_MB), found, not wrong)
    return shared.rows_of([row], ends={str(k): v for k, v in ends.items()})

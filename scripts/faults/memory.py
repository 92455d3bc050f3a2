# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A limit on the address space (`ulimit -v`), level by level: a clear error, never a touched OUT.

A process that needs more ends in Python (exit 2, one line), or in compiled code, which has no way to say it:
the core says how many bytes were refused and aborts (SIGABRT), other libraries crash (SIGSEGV). Those levels
have a row of their own, a known limit, with the place in Python's code that `faulthandler` gives.
"""

from __future__ import annotations

import faulthandler
import re
import resource
import signal
from pathlib import Path
from typing import Any

import forking
import shared
from disk import intact
from same_bits import contents, differing
from shared import Row

EXTRA_MB = (0, 20, 50, 100, 150, 200, 300, 600)
"""Above what the process has when it begins."""
NATIVE = (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGBUS)
NAMES = {-signal.SIGABRT: "134", -signal.SIGSEGV: "139", -signal.SIGBUS: "135"}


def measure() -> dict[str, Any]:
    whole = {name: of for name, of in contents(shared.whole()).items() if name != "viewer.html"}
    told, native, wrong, wrong_native = [], [], [], []
    for extra in EXTRA_MB:
        output = shared.with_older(shared.emptied("memory"))
        code, said, place = _limited(output, extra)
        if code in NATIVE:
            native.append(f"+{extra} MB in {place} ({NAMES[code]})")
            # As with a kill -9, what is temporary stays until the next run.
            bad = [w for w in intact(output, f"+{extra} MB", {"out.partial"}) if ".unfinished" not in w]
        elif code == 2:
            told.append(f"+{extra} MB exit 2")
            one = forking.one_line(code, said, 2, "out of memory", "--memory", "--resolution")
            bad = ([f"+{extra} MB: {one}"] if one else []) + intact(output, f"+{extra} MB", {"out.partial"})
        elif code == 0:
            told.append(f"+{extra} MB is enough")
            bad = [f"+{extra} MB: {name} differs" for name in differing(output, whole)]
        else:
            bad = [f"+{extra} MB: exit code {code}: {said[-300:]}"]
        if code:
            code, said = forking.run(forking.reconstruct(output))
            if code or differing(output, whole) or shared.left_beside(output):
                bad.append(f"+{extra} MB: the same command without the limit: {code} {said}")
        (wrong_native if native and native[-1].startswith(f"+{extra} ") else wrong).extend(bad)
    fault = "`ulimit -v` above what the process begins with"
    after = "OUT the older material then; identical materials without the limit"
    found = "; ".join([", ".join(told), *(wrong[:3] or [f"one line that says it, {after}"])])
    rows = [Row(f"{fault}: Python is told", len(told), found, not wrong and bool(told))]
    if native:
        found = "; ".join([", ".join(native), *(wrong_native[:3] or [f"no word of ours, {after}"])])
        rows.append(Row(f"{fault}: compiled code ends it", len(native), found, False, not wrong_native))
    return shared.rows_of(rows)


def _limited(output: Path, extra_mb: int) -> tuple[int, str, str]:
    """Exit code, what was said, and the innermost place of ours where a library ended the process."""
    dump = output.with_name("dump")

    def limited() -> None:
        faulthandler.enable(dump.open("w"))
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + extra_mb * 10**6
        resource.setrlimit(resource.RLIMIT_AS, (most, most))

    code, said = forking.run(forking.reconstruct(output), before=limited)
    text = dump.read_text() if dump.exists() else ""
    dump.unlink(missing_ok=True)
    places = re.findall(r'swatchwork/(\S+)", line \d+ in (\w+)', text)
    return code, said, f"`{places[0][0]}`, {places[0][1]}" if places else "a place that is not known"

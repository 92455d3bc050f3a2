# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A process that runs cases: seeds in on standard input, one JSON a line out on standard output.

Memory is limited, so that a bomb ends this process and not the machine; who started it counts the crash.
"""

from __future__ import annotations

import json
import os
import resource
import sys
from pathlib import Path

MOST_GROWTH_MB = 2048
"""Of resident memory in a case; more is a finding."""
HEADROOM_MB = 6144
"""Of address space beyond what the process has at its start."""


def main(bases: Path, scratch: Path) -> None:
    """Serve until standard input ends."""
    import cv2
    from case import run_case

    cv2.setNumThreads(1)
    out = os.fdopen(os.dup(1), "w")
    # What C libraries print must not be taken for an answer.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    limit = _status_mb("VmSize") + HEADROOM_MB
    resource.setrlimit(resource.RLIMIT_AS, (limit << 20, limit << 20))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for line in sys.stdin:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        before = _status_mb("VmRSS")
        found = run_case(int(line), bases, scratch)
        found["growth_mb"] = growth = max(0, _status_mb("VmHWM") - before)
        if growth > MOST_GROWTH_MB and not found["finding"]:
            found["finding"] = f"{growth} MB more"
        out.write(json.dumps(found) + "\n")
        out.flush()


def _status_mb(key: str) -> int:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1]) >> 10
    raise KeyError(key)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

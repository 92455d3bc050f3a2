# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""How a command ends that is stopped, or has too little memory."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from swatchwork import workflow
from swatchwork.cli import main
from swatchwork.errors import InputError

CHILD = """
import os, signal, sys
from swatchwork.cli import main
def raised(*_):
    {what}
import swatchwork.workflow
swatchwork.workflow.describe = raised
sys.exit(main(["info"]))
"""


def ended(what: str) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-c", CHILD.format(what=what)], capture_output=True, text=True, check=False
    )
    assert done.stdout == ""
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("what", "code", "begins"),
    [
        ("os.kill(os.getpid(), signal.SIGINT)", 130, "interrupted; nothing was half-written, and the same"),
        ("os.kill(os.getpid(), signal.SIGTERM)", 143, "terminated; nothing was half-written, and the same"),
        (
            "\n    try: os.kill(os.getpid(), signal.SIGINT)"
            "\n    finally: os.kill(os.getpid(), signal.SIGINT)",
            130,
            "stopped at once; nothing was half-written, and the same",
        ),
        ("raise MemoryError", 2, "error: out of memory; what was there before is intact."),
    ],
    ids=["ctrl-c", "sigterm", "twice", "memory"],
)
def test_how_a_command_is_stopped(what: str, code: int, begins: str) -> None:
    found, said = ended(what)
    assert found == code, said
    assert said.startswith(begins) and "Traceback" not in said
    assert len(" ".join(said.split()).split("error: ")) <= 2


def test_handlers_are_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    seen: list[Any] = []

    def describe(_: Path | None) -> None:
        seen.extend(signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM))
        raise InputError("enough")

    monkeypatch.setattr(workflow, "describe", describe)
    assert main(["info"]) == 2
    assert len(seen) == 2 and not set(seen) & set(before)
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    # Outside the main thread, where Python sets no handlers, it runs as well.
    codes: list[int] = []
    thread = threading.Thread(target=lambda: codes.append(main(["--version"])))
    thread.start()
    thread.join()
    assert codes == [0]

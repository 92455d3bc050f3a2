# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Feed the package spoilt captures, and note every crash, hang and violation that nobody reports.

    python scripts/fuzz/run.py --count 10000
    python scripts/fuzz/run.py --case 4711

Case i is what seed i gives, whatever ran before. Results are appended to a file named after the package's
and the fuzzer's code, so that a run that was stopped goes on, and changed code begins anew.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
HANG_S = 60.0
BESIDE = 10
"""One case of materials and foreign projects for so many captures."""
ONE_THREAD = dict.fromkeys(("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


class Worker:
    """A process of `worker.py`, started anew when it has died."""

    def __init__(self, bases: Path, scratch: Path) -> None:
        self.bases, self.scratch = bases, scratch
        self.process: subprocess.Popen[str] | None = None

    def run(self, seed: int) -> dict[str, Any]:
        """The case's result; a crash or a hang is one too."""
        if self.process is None:
            self._start()
        assert self.process is not None and self.process.stdin and self.process.stdout
        killed = threading.Event()

        def kill(process: subprocess.Popen[str]) -> None:
            killed.set()
            process.kill()

        guard = threading.Timer(HANG_S, kill, [self.process])
        start = time.perf_counter()
        guard.start()
        try:
            self.process.stdin.write(f"{seed}\n")
            self.process.stdin.flush()
            answer = self.process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        finally:
            guard.cancel()
        if answer:
            found: dict[str, Any] = json.loads(answer)
            return found
        code = self.process.wait()
        self.process = None
        what = (
            f"hangs: killed after {HANG_S:.0f} s" if killed.is_set() else f"the process died with code {code}"
        )
        outcome = "hung" if killed.is_set() else "crashed"
        empty: dict[str, Any] = {
            "base": "",
            "done": [],
            "whole": False,
            "message": "",
            "growth_mb": 0,
            "preparing": 0,
        }
        return empty | {
            "seed": seed,
            "outcome": outcome,
            "finding": what,
            "seconds": time.perf_counter() - start,
        }

    def stop(self) -> None:
        """End the process."""
        if self.process is not None:
            assert self.process.stdin
            self.process.stdin.close()
            self.process.wait()

    def _start(self) -> None:
        self.scratch.mkdir(parents=True, exist_ok=True)
        log = (self.scratch / "stderr").open("w")
        self.process = subprocess.Popen(
            [sys.executable, str(HERE / "worker.py"), str(self.bases), str(self.scratch)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            env={**os.environ, **ONE_THREAD},
        )


def code_digest() -> str:
    """Of the package's and the fuzzer's Python files."""
    digest = hashlib.sha256()
    for folder in (REPOSITORY / "python", HERE):
        for file in sorted(folder.rglob("*.py")):
            if file.name not in ("page.py", "run.py"):
                digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def seeds_of(count: int) -> Iterator[int]:
    """Those of ``count`` captures, and of what is beside them."""
    from others import FIRST

    for i in range(count):
        yield i
        if i % BESIDE == 0:
            yield FIRST + i // BESIDE


def run(count: int, folder: Path, workers: int) -> Path:
    """Run what is missing of ``count`` captures; gives the file of results."""
    from captures import make_bases

    bases = folder / "bases"
    make_bases(bases)
    results = folder / f"results-{code_digest()}.jsonl"
    # A line that was cut off counts for nothing.
    text = results.read_text(encoding="utf-8") if results.is_file() else ""
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        results.write_text(whole, encoding="utf-8")
    have = {json.loads(line)["seed"] for line in whole.splitlines()}
    todo: queue.SimpleQueue[int] = queue.SimpleQueue()
    left = [seed for seed in seeds_of(count) if seed not in have]
    for seed in left:
        todo.put(seed)
    lock, begun = threading.Lock(), time.perf_counter()
    counts = {"done": 0, "findings": 0}

    with results.open("a", encoding="utf-8") as file:

        def serve(number: int) -> None:
            worker = Worker(bases, folder / f"scratch-{number}")
            while True:
                try:
                    seed = todo.get_nowait()
                except queue.Empty:
                    break
                found = worker.run(seed)
                with lock:
                    file.write(json.dumps(found) + "\n")
                    file.flush()
                    counts["done"] += 1
                    counts["findings"] += bool(found["finding"])
                    if found["finding"]:
                        print(f"case {seed} ({found['base']}): {found['finding']}", flush=True)
                    if counts["done"] % 500 == 0:
                        pace = counts["done"] / (time.perf_counter() - begun)
                        print(f"{counts['done']} of {len(left)}, {pace:.1f} a second", flush=True)
            worker.stop()

        threads = [threading.Thread(target=serve, args=[i]) for i in range(workers)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    print(f"{len(left)} cases run, {len(have)} were there; {counts['findings']} new findings; {results}")
    return results


def main() -> int:
    """0 where nothing is found in all that was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000, help="captures")
    parser.add_argument("--folder", type=Path, default=REPOSITORY / "target/fuzz")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--case", type=int, help="run this seed alone, here, and say what was done")
    given = parser.parse_args()
    sys.path.insert(0, str(HERE))
    if given.case is not None:
        from captures import make_bases
        from case import run_case

        make_bases(given.folder / "bases")
        print(
            json.dumps(run_case(given.case, given.folder / "bases", given.folder / "scratch-case"), indent=1)
        )
        return 0
    results = run(given.count, given.folder, given.workers)
    wanted = set(seeds_of(given.count))
    rows = [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]
    return int(any(row["finding"] for row in rows if row["seed"] in wanted))


if __name__ == "__main__":
    sys.exit(main())

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Too little memory is said to be that, and no file is blamed for it."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
import pytest
from PIL import Image as Pillow

from swatchwork.capture import read_image, write_exr
from swatchwork.errors import is_out_of_memory
from swatchwork.prepare.exposure import exposures_of
from swatchwork.surface import read_mesh

REFUSED = cv2.error("(-4:Insufficient memory) Failed to allocate 108000000 bytes")


def test_names_of_too_little_memory() -> None:
    chained = ValueError("no")
    chained.__cause__ = MemoryError()
    assert is_out_of_memory(chained)
    assert is_out_of_memory(OSError(errno.ENOMEM, "Cannot allocate memory"))
    assert is_out_of_memory(RuntimeError("can't start new thread"))
    assert not is_out_of_memory(ValueError("no"))


def no_memory(*_: Any, **__: Any) -> Any:
    raise MemoryError


def files(folder: Path) -> dict[str, Path]:
    """A sound one of each kind."""
    for suffix in (".png", ".jpg"):
        Pillow.new("RGB", (8, 8)).save(folder / f"a{suffix}")
    cv2.imwrite(str(folder / "a.hdr"), np.ones((8, 8, 3), np.float32))
    write_exr(folder / "a.exr", np.ones((8, 8, 3), np.float32))
    import trimesh

    trimesh.creation.box().export(folder / "a.ply")
    return {path.suffix: path for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("suffix", "place", "read"),
    [
        (".jpg", "PIL.Image.open", read_image),
        (".png", "PIL.Image.open", read_image),
        (".png", "cv2.imdecode", read_image),
        (".hdr", "cv2.imdecode", read_image),
        (".exr", "OpenEXR.File", read_image),
        (".ply", "trimesh.load", read_mesh),
        (".jpg", "PIL.Image.open", lambda file: exposures_of([file])),
    ],
)
@pytest.mark.parametrize("error", [MemoryError(), REFUSED], ids=["python", "opencv"])
def test_a_reader_does_not_blame_the_file(
    suffix: str, place: str, read: Any, error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = files(tmp_path)[suffix]

    def refused(*_: Any, **__: Any) -> Any:
        raise error

    monkeypatch.setattr(place, refused)
    with pytest.raises(type(error)) as found:
        read(file)
    assert found.value is error


def test_opencv_says_nothing_of_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It gives None, for a damaged file as well: as much is asked for to tell them apart."""
    file = files(tmp_path)[".hdr"]
    monkeypatch.setattr(cv2, "imdecode", lambda *_: None)
    monkeypatch.setattr(np, "empty", no_memory)
    with pytest.raises(MemoryError):
        read_image(file)


def test_openexr_prints_it_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Halfway:
        """As the library's own, where memory ends with the pixels."""

        def __init__(self, *_: Any, header_only: bool, **__: Any) -> None:
            self.real = real(str(file), separate_channels=True, header_only=True)
            self.parts = self.real.parts if header_only else []
            if not header_only:
                print("Warning: Exception raised reading pixel data for part 0 - MemoryError: Unable to ...")

        def __enter__(self) -> Halfway:
            return self

        def __exit__(self, *_: Any) -> None:
            pass

        def header(self) -> Any:
            raise ValueError("Invalid part index '0': file has 0 parts.")

    file, real = files(tmp_path)[".exr"], OpenEXR.File
    monkeypatch.setattr(OpenEXR, "File", Halfway)
    with pytest.raises(MemoryError):
        read_image(file)


def under_a_limit(action: Callable[[], Any], extra_bytes: int) -> str:
    """What an action raises in a forked process with so much more address space than it has."""
    import resource

    ours, theirs = os.pipe()
    pid = os.fork()
    if pid == 0:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + extra_bytes
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        said = "nothing"
        try:
            action()
        except BaseException as error:
            said = type(error).__name__
        os.write(theirs, said.encode())
        os._exit(0)
    os.close(theirs)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    with os.fdopen(ours) as stream:
        return stream.read() if code == 0 else f"exit code {code}"


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_an_image_larger_than_what_is_left(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", np.ones((3000, 3000, 3), np.float32))
    read_image(files(tmp_path)[".exr"])
    write_exr(tmp_path / "a.exr", np.ones((3000, 3000, 3), np.float32))
    # The pixels alone are 108 MB.
    assert under_a_limit(lambda: read_image(tmp_path / "a.exr"), 30_000_000) == "MemoryError"


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_embree_is_not_asked_without_memory_for_it() -> None:
    """It crashes where its first scene is refused memory: so in a process of its own."""
    code = (
        "from test_out_of_memory import under_a_limit; from swatchwork.simulate import shape\n"
        "from swatchwork.surface.rays import RayScene\n"
        "import embreex.mesh_construction, embreex.rtcore_scene\n"
        "mesh = shape('blob', 8); mesh.bounds\n"
        "print([under_a_limit(lambda: RayScene([mesh]), mb * 2**20) for mb in (10, 40, 100)])\n"
        "RayScene([mesh])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parent,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
    )
    assert done.returncode == 0 and done.stdout.strip() == str(["MemoryError"] * 3), done.stdout + done.stderr

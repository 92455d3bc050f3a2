# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""OBJ and PLY made to do harm, one wrong thing each, and the message."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import numpy as np
import pytest

from swatchwork.errors import CaptureWarning, InputError
from swatchwork.surface import read_mesh

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

MESHES: dict[str, tuple[str, str]] = {
    "index 0 of a texture coordinate": ("f 1/0 2/1 3/1\n", "names vt 0"),
    "an index beyond integers": (f"f 1 2 {10**30}\n", "line 9"),
    "counting back too far": ("f -99 1 2\n", "counts back"),
    "a vertex far away": ("v 1e30 0 0\nf 1 2 5\n", "1e\\+30"),
    "a vertex beyond doubles": ("v 1e400 0 0\nf 1 2 5\n", "infinite"),
}


@pytest.mark.parametrize("case", MESHES)
def test_obj(case: str, tmp_path: Path) -> None:
    line, message = MESHES[case]
    (tmp_path / "mesh.obj").write_text(OBJ + line)
    with pytest.raises(InputError, match=message):
        read_mesh(tmp_path / "mesh.obj")


def test_numbers_of_a_mesh_that_are_none(tmp_path: Path) -> None:
    file = tmp_path / "mesh.obj"
    for tag, what in (("vt", "texture coordinates"), ("vn", "normals")):
        corner = "{0}/1" if tag == "vt" else "{0}//1"
        faces = "".join(
            "f " + " ".join(corner.format(i) for i in f) + "\n" for f in ("132", "124", "143", "234")
        )
        file.write_text(OBJ[: OBJ.index("f")] + f"{tag} nan 0 0\n" + faces)
        with pytest.warns(CaptureWarning, match=f"some {what} are NaN"):
            mesh = read_mesh(file)
        assert mesh.uv is None and np.isfinite(mesh.normals).all()


def test_obj_reads_no_other_file(tmp_path: Path) -> None:
    """Materials and textures are ignored, wherever they point: a pipe would block whoever opened it."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "mesh.obj").write_text("mtllib pipe\nusemtl /dev/zero\n" + OBJ)
    assert len(read_mesh(tmp_path / "mesh.obj").faces) == 4


PLY_HEAD = "ply\nformat {kind} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
PLY_HEAD += "element face {faces}\nproperty list {length} int vertex_indices\nend_header\n"
PLY_ROWS = "0 0 0\n1 0 0\n0 1 0\n"


def ply(rows: str, faces: str = "1", kind: str = "ascii", length: str = "uchar") -> bytes:
    return (PLY_HEAD.format(kind=kind, faces=faces, length=length) + PLY_ROWS + rows).encode()


PLYS: dict[str, tuple[bytes, str]] = {
    "more faces than rows": (ply("3 0 1 2\n", "2"), "declares 2 of the element 'face'"),
    "billions of faces": (ply("3 0 1 2\n", str(10**9)), "1000000000"),
    "more faces than integers": (ply("3 0 1 2\n", str(10**30)), "header has the line"),
    "minus one face": (ply("3 0 1 2\n", "-1"), "header has the line"),
    "a list of no length": (ply("0\n"), "of length"),
    "a list of negative length": (ply("-3 0 1 2\n", length="char"), "of length"),
    "a list longer than its row": (ply("9 0 1 2\n"), "a row of the element"),
    "a list of fractional length": (ply("3 0 1 2\n", length="float"), "header has the line"),
    "no end of the header": (ply("").partition(b"end_header")[0], "no end"),
    "an unknown format": (ply("3 0 1 2\n", kind="binary_middle_endian"), "format"),
    "a vertex that is not there": (ply("3 0 1 7\n"), "vertex"),
}


@pytest.mark.parametrize("case", PLYS)
def test_ply(case: str, tmp_path: Path) -> None:
    content, message = PLYS[case]
    (tmp_path / "mesh.ply").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_mesh(tmp_path / "mesh.ply")


def test_binary_ply(tmp_path: Path) -> None:
    head = PLY_HEAD.format(kind="binary_little_endian", faces="2", length="char").encode()
    vertices = np.eye(3, dtype="<f4").tobytes()
    whole = struct.pack("<biii", 3, 0, 1, 2) + struct.pack("<biii", 3, 2, 1, 0)
    (tmp_path / "mesh.ply").write_bytes(head + vertices + whole)
    assert len(read_mesh(tmp_path / "mesh.ply").faces) == 2
    for lengths, message in (
        ((3, 0), "3 and 0.*truncated"),
        ((-1, 3), "of length -1"),
        ((127, 3), "of length 127"),
        ((4, 3), "room for 1"),
    ):
        rows = b"".join(struct.pack("<biii", length, 0, 1, 2) for length in lengths)
        (tmp_path / "mesh.ply").write_bytes(head + vertices + rows)
        with pytest.raises(InputError, match=message):
            read_mesh(tmp_path / "mesh.ply")


def test_binary_ply_of_triangles_and_quads(tmp_path: Path) -> None:
    """Nothing is wrong with the file, which is not truncated: it must be triangulated."""
    head = PLY_HEAD.format(kind="binary_little_endian", faces="2", length="uchar").encode()
    three, four = struct.pack("<Biii", 3, 0, 1, 2), struct.pack("<Biiii", 4, 0, 1, 2, 0)
    for rows in (three + four, four + three, three * 8 + four):
        count = 9 if len(rows) > 40 else 2
        text = head.replace(b"face 2", b"face %d" % count)
        (tmp_path / "mesh.ply").write_bytes(text + np.eye(3, dtype="<f4").tobytes() + rows)
        with pytest.raises(InputError, match="Triangulate the mesh") as caught:
            read_mesh(tmp_path / "mesh.ply")
        assert "truncated" not in str(caught.value)


def test_ply_reads_no_texture(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    content = ply("3 0 1 2\n").replace(b"element vertex", b"comment TextureFile pipe\nelement vertex")
    (tmp_path / "mesh.ply").write_bytes(content)
    assert len(read_mesh(tmp_path / "mesh.ply").faces) == 1

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The file of 2D-3D pairs: written and read again, and every damage told."""

import json

import numpy as np
import pytest

from swatchwork.errors import InputError, OutputError
from swatchwork.prepare.registering import Pairs, read_pairs, write_pairs

PAIR = {"uv_px": [812.5, 403.0], "x_in_mesh": [0.1, -0.2, 0.3]}


def write(folder, document):
    file = folder / "pairs.json"
    file.write_text(document if isinstance(document, str) else json.dumps(document), encoding="utf-8")
    return file


def test_written_pairs_are_read_again(tmp_path):
    rng = np.random.default_rng(0)
    pairs = {
        name: Pairs(f"{name}.exr", rng.normal(size=(count, 2)), rng.normal(size=(count, 3)))
        for name, count in (("IMG_0001", 7), ("IMG_0002", 0))
    }
    file = tmp_path / "pairs.json"
    for _ in range(2):
        write_pairs(file, pairs, "bunny.obj")
    found = read_pairs(file)
    assert list(found) == ["IMG_0001", "IMG_0002"]
    for name, of in found.items():
        assert of.photograph == pairs[name].photograph and len(of) == len(pairs[name])
        # JSON keeps doubles to the last digit.
        np.testing.assert_array_equal(of.uv_px, pairs[name].uv_px)
        np.testing.assert_array_equal(of.x_in_world, pairs[name].x_in_world)
    assert json.loads(file.read_text())["mesh"] == "bunny.obj"
    assert [path.name for path in tmp_path.iterdir()] == ["pairs.json"]


def test_a_folder_that_cannot_be_is_told(tmp_path):
    (tmp_path / "none").write_text("a file")
    with pytest.raises(OutputError, match="cannot be written"):
        write_pairs(tmp_path / "none" / "pairs.json", {}, "bunny.obj")


def one(**changed):
    return {"mesh": "m.obj", "photographs": {"a.exr": [PAIR, PAIR | changed]}}


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ("{", "is not JSON"),
        ("[]", 'no object "photographs"'),
        ({"mesh": "m.obj"}, 'no object "photographs"'),
        ({"photographs": [PAIR]}, 'no object "photographs"'),
        ({"photographs": {"a.exr": PAIR}}, r'"a.exr" is \{'),
        ({"photographs": {"a.exr": [[1, 2, 3, 4, 5]]}}, r'"a.exr", pair 1 is \[1, 2, 3, 4, 5\]'),
        ({"photographs": {"a.exr": [{"uv_px": [1, 2]}]}}, 'pair 1 has no "x_in_mesh"'),
        (one(uv_px=[1, 2, 3]), r'pair 2 has "uv_px" \[1, 2, 3\]; expected "uv_px" with 2'),
        (one(x_in_mesh=[1, 2]), r'pair 2 has "x_in_mesh" \[1, 2\]'),
        (one(x_in_mesh=[1, "2", 3]), '"x_in_mesh"'),
        (one(uv_px=[True, 2]), r'"uv_px" \[true, 2\]'),
        (one(uv_px=None), 'no "uv_px"'),
        (one(uv_px=[float("nan"), 2]), r'"uv_px" \[NaN, 2\]; expected "uv_px" with 2 finite numbers'),
        (one(x_in_mesh=[1, 2, float("inf")]), "Infinity"),
        (one(uv_px=[10**400, 2]), "finite"),
        ({"photographs": {"a.exr": [], "a.jpg": []}}, '"a.exr" and "a.jpg" are the same photograph'),
        ('{"photographs": {"a.exr": [], "a.exr": []}}', '"a.exr" is there twice'),
    ],
)
def test_damage_is_told(tmp_path, document, said):
    file = write(tmp_path, document)
    with pytest.raises(InputError, match=said) as error:
        read_pairs(file)
    assert str(error.value).startswith(f"{file}: ")


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_pairs(tmp_path / "pairs.json")

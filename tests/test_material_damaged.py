# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Material folders that are not what was written: one wrong thing each, and the message."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.errors import InputError
from swatchwork.material import Material, read_material, write_material
from test_material import example

SOLVER: dict[str, Any] = {
    "n": 2,
    "N": 5,
    "status": "converged",
    "weighting": "projected",
    "data": 0.1,
    "objective": 0.2,
    "lambda0": 1e-4,
    "lambda1": 1e-5,
    "noise": None,
    "outliers": {"scale": 0.1, "left_out": 0.0, "undecided": 0.0},
    "left_out_by_frame": [0.0, 0.1],
    "history": [{"n": 1, "N": 1, "alternations": 2, "move": "start", "data": 0.1, "objective": None}],
    "photographs": {
        "frames": [{"name": "a.exr", "kind": "", "channels": [1.0], "points": 3, "misfit": 0.1}],
        "options": {"scale": "suspects", "keep_suspects": False},
    },
    "interreflections": {"rounds": 2, "indirect": {}},
}


def written(folder: Path) -> Path:
    material = example()
    values = {name: getattr(material, name) for name in material.__dataclass_fields__}
    values |= {"solver": SOLVER, "spread": np.linspace(0, 1, 5)}
    write_material(folder, Material(**values))
    return folder


WRONG: list[tuple[str, Any, str]] = [
    ("spread/0", True, "spread.0 is True"),
    ("spread", [], "spread has shape"),
    ("spread", False, "spread is False"),
    ("trust", 0, "trust is 0"),
    ("solver/N", True, "solver.N is True"),
    ("solver/N", 4, "solver.N is 4, and N is 5"),
    ("solver/n", 1, "solver.n is 1, and n is 2"),
    ("solver/objective", "aaaa", "solver.objective is 'aaaa'"),
    ("solver/data", -1, "solver.data is -1"),
    ("solver/noise", float("nan"), "solver.noise is nan"),
    ("solver/lambda0", float("nan"), "solver.lambda0 is nan"),
    ("solver/status", 5, "solver.status is 5"),
    ("solver/history", {}, "solver.history is {}"),
    ("solver/history/0", 0, "solver.history.0 is 0"),
    ("solver/history/0/N", 1.5, "solver.history.0.N is 1.5"),
    ("solver/outliers/scale", "1", "solver.outliers.scale is '1'"),
    ("solver/photographs", 5, "solver.photographs is 5"),
    ("solver/photographs/frames/0/name", None, "photographs.frames.0.name is None"),
    ("solver/photographs/options/keep_suspects", 1, "keep_suspects is 1"),
    ("solver/interreflections", [], r"interreflections is \[\]"),
    ("penalties", {}, "penalties is empty"),
    ("penalties/lambda_1", -1, "penalties.lambda_1 is -1"),
    ("penalties/lambda_1", float("nan"), "penalties.lambda_1 is nan"),
    ("representatives/0/0/0", 1e300, r"the weight 1e\+300; expected 0 to 1e\+20"),
    ("representatives/0/0/0", "1", "representatives.0.0.0 is '1'"),
    ("basis/sigmas/0", True, "basis.sigmas.0 is True"),
    ("basis/maskings", "vgroove", "basis.maskings is 'vgroove'"),
    ("basis/fresnel/0", 1.5, "basis.fresnel.0 is 1.5"),
    ("inputs/mesh", 5, "inputs.mesh is 5"),
    ("resolution/0", 8.0, "resolution.0 is 8.0"),
    ("mesh/faces", 3, "'faces': 3"),
    ("mesh", [], r"mesh is \[\]"),
    ("schema_version", True, "schema version True"),
]


@pytest.mark.parametrize(("path", "value", "message"), WRONG)
def test_values(path: str, value: Any, message: str, tmp_path: Path) -> None:
    file = written(tmp_path / "out") / "svbrdf.json"
    head = json.loads(file.read_text())
    at: Any = head
    *above, last = (int(key) if key.isdigit() else key for key in path.split("/"))
    for key in above:
        at = at[key]
    at[last] = value
    file.write_text(json.dumps(head))
    with pytest.raises(InputError, match=message):
        read_material(tmp_path / "out")


def test_what_is_written_is_read(tmp_path: Path) -> None:
    assert read_material(written(tmp_path / "out")).solver == SOLVER


def test_older_folders_say_nothing_of_their_mesh(tmp_path: Path) -> None:
    file = written(tmp_path / "out") / "svbrdf.json"
    head = json.loads(file.read_text())
    for key in ("mesh", "trust", "spread"):
        del head[key]
    file.write_text(json.dumps(head))
    assert read_material(tmp_path / "out").spread is None


@pytest.mark.parametrize("kept", [1, 2])
def test_a_mesh_cut_at_the_end_of_a_line(kept: int, tmp_path: Path) -> None:
    """With a face fewer; without its last faces it is no mesh."""
    file = written(tmp_path / "out") / "mesh.obj"
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:-kept]))
    with pytest.raises(InputError, match=r"'faces': 2|no faces"):
        read_material(tmp_path / "out")


@pytest.mark.parametrize("name", ["svbrdf.json", "blend.exr", "mesh.obj"])
def test_links_stay_in_the_folder(name: str, tmp_path: Path) -> None:
    folder = written(tmp_path / "out")
    (folder / name).rename(tmp_path / name)
    (folder / name).symlink_to(f"../{name}")
    with pytest.raises(InputError, match=f"{name}: is a link that leads outside"):
        read_material(folder)
    (tmp_path / name).rename(folder / f"kept-{name}")
    (folder / name).unlink()
    (folder / name).symlink_to(f"kept-{name}")
    read_material(folder)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The material folder: exact round trip, whole or not at all, clear errors; and its maps."""

from __future__ import annotations

import errno
import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from swatchwork.capture import read_exr_channels, write_exr_channels
from swatchwork.errors import InputError, OutputError
from swatchwork.material import (
    SCHEMA_VERSION,
    BasisRecord,
    Material,
    is_material_folder,
    material_maps,
    read_material,
    write_material,
)
from swatchwork.material import folder as folder_module
from swatchwork.material.maps import normal_albedo
from swatchwork.reflectance import DIFFUSE_KERNELS, GenericBasis, extended, paper
from swatchwork.whole import folders


def record(basis: GenericBasis) -> BasisRecord:
    return BasisRecord(
        basis.name,
        tuple(basis.sigmas.tolist()),
        basis.maskings,
        basis.diffuse,
        basis.fresnel,
    )


def example(n: int = 2, seed: int = 0) -> Material:
    rng = np.random.default_rng(seed)
    basis = record(paper())
    height, width, count = 8, 9, 5
    weight = rng.dirichlet(np.ones(n), (height, width)).astype(np.float32)
    coverage = rng.integers(-1, 4, (height, width)).astype(np.int32)
    normals = rng.normal(size=(6, 3))
    return Material(
        basis=basis,
        representatives=rng.gamma(0.3, 0.1, (count, basis.kernels, 3)),
        index=rng.integers(0, count, (height, width, n)).astype(np.uint32),
        weight=weight,
        coverage=coverage,
        residual=rng.uniform(0, 0.3, (height, width)).astype(np.float32),
        vertices=rng.normal(size=(6, 3)) * 10.0 ** rng.integers(-300, 300, (6, 3)),
        faces=np.array([[0, 1, 2], [3, 4, 5]], np.int32),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        uv=rng.uniform(size=(6, 2)),
        penalties={"lambda_0": 1e-4 / 3, "lambda_1": 4e-6},
        solver={"status": "converged", "history": [{"n": 1, "N": 1, "objective": 0.1}]},
        inputs={"mesh": "sha256:00"},
    )


def same(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    return a == b


@pytest.mark.parametrize("n", [1, 2, 5])
def test_round_trip_keeps_every_bit(tmp_path: Path, n: int) -> None:
    material = example(n)
    write_material(tmp_path / "out", material)
    found = read_material(tmp_path / "out")
    for field in fields(Material):
        assert same(getattr(material, field.name), getattr(found, field.name)), field.name
    assert found.n == n
    assert found.N == 5


def test_bands_of_any_height_write_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    material = example(2)
    write_material(tmp_path / "whole", material)
    monkeypatch.setattr("swatchwork.material.folder.ROWS", 3)
    monkeypatch.setattr("swatchwork.material.maps.CHUNK", 1)
    write_material(tmp_path / "bands", material)
    files = sorted(path.relative_to(tmp_path / "whole") for path in (tmp_path / "whole").rglob("*.exr"))
    assert len(files) == 9
    for file in files:
        whole, bands = (read_exr_channels(tmp_path / name / file) for name in ("whole", "bands"))
        assert whole.keys() == bands.keys()
        for channel, values in whole.items():
            assert same(values, bands[channel]), (file, channel)


def test_same_material_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_material(tmp_path / name, example())
    files = sorted(p.relative_to(tmp_path / "one") for p in (tmp_path / "one").rglob("*") if p.is_file())
    assert {str(p) for p in files} == {
        "blend.exr",
        "mesh.obj",
        "svbrdf.json",
        *(
            f"maps/{name}.exr"
            for name in (
                "diffuse",
                "specular",
                "roughness",
                "tau",
                "residual",
                "coverage",
                "expected_error",
                "confidence",
            )
        ),
    }
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes(), file


def test_index_channels_are_unsigned_integers(tmp_path: Path) -> None:
    write_material(tmp_path / "out", example())
    channels = read_exr_channels(tmp_path / "out/blend.exr")
    assert channels["index.0"].dtype == np.uint32
    assert channels["weight.1"].dtype == np.float32


def test_history_without_a_number_becomes_null(tmp_path: Path) -> None:
    material = replace(example(), solver={"objective": np.float64("inf"), "x": np.arange(2)})
    write_material(tmp_path / "out", material)
    assert read_material(tmp_path / "out").solver == {"objective": None, "x": [0, 1]}


def test_an_older_material_is_replaced_and_leaves_nothing_behind(tmp_path: Path) -> None:
    write_material(tmp_path / "out", example(1), lambda fresh: (fresh / "old.txt").touch())
    write_material(tmp_path / "out", example(2))
    assert read_material(tmp_path / "out").n == 2
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert not (tmp_path / "out/old.txt").exists()


def test_a_folder_of_something_else_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write_material(tmp_path / "out", example())  # an empty folder is fine
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos/1.jpg").write_text("dear")
    (tmp_path / "file").write_text("dear")
    for name in ("photos", "file"):
        with pytest.raises(InputError, match=f"{name}: exists and is not a material folder"):
            write_material(tmp_path / name, example())
    assert (tmp_path / "photos/1.jpg").read_text() == "dear"
    assert (tmp_path / "file").read_text() == "dear"


def test_a_full_disk_leaves_the_old_material_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_material(tmp_path / "out", example(1))

    def full(*args: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    for module, step in ((folder_module, "write_obj"), (folders, "sync"), (folders, "_swap")):
        with monkeypatch.context() as patch:
            patch.setattr(module, step, full)
            with pytest.raises(OutputError, match="No space left on device"):
                write_material(tmp_path / "out", example(2))
        assert read_material(tmp_path / "out").n == 1
        assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_only_errors_of_writing_are_said_to_be_such(tmp_path: Path) -> None:
    def read_elsewhere(fresh: Path) -> None:
        (tmp_path / "no-such-input").read_bytes()

    def write_inside(fresh: Path) -> None:
        (fresh / "no-such-folder" / "file").write_bytes(b"")

    with pytest.raises(FileNotFoundError, match="no-such-input"):
        write_material(tmp_path / "out", example(), read_elsewhere)
    with pytest.raises(OutputError, match="out: cannot be written"):
        write_material(tmp_path / "out", example(), write_inside)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_leaves_the_old_material(tmp_path: Path) -> None:
    write_material(tmp_path / "out", example(1))

    def stop(fresh: Path) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_material(tmp_path / "out", example(2), stop)
    assert read_material(tmp_path / "out").n == 1
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_failing_swap_puts_the_old_material_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_material(tmp_path / "out", example(1))
    rename = Path.rename

    def second_fails(self: Path, target: Path) -> Path:
        if self.name.endswith(".unfinished"):
            raise OSError(errno.EIO if not target.exists() else errno.ENOTEMPTY, "I/O error")
        return rename(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(folders, "exchange", lambda *_: False)
        patch.setattr(Path, "rename", second_fails)
        with pytest.raises(OutputError, match="I/O error"):
            write_material(tmp_path / "out", example(2))
    assert read_material(tmp_path / "out").n == 1
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("name", ["svbrdf.json", "blend.exr", "mesh.obj"])
def test_missing_and_truncated_files(tmp_path: Path, name: str) -> None:
    write_material(tmp_path / "out", example())
    path = tmp_path / "out" / name
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=name):
        read_material(tmp_path / "out")
    path.unlink()
    with pytest.raises(InputError, match=f"{name}: no such file"):
        read_material(tmp_path / "out")


def test_no_folder_and_no_material(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        read_material(tmp_path / "out")
    (tmp_path / "svbrdf.json").write_text('{"format": "other"}')
    assert not is_material_folder(tmp_path)
    with pytest.raises(InputError, match="is not the head of a material folder"):
        read_material(tmp_path)


def test_another_schema_version(tmp_path: Path) -> None:
    write_material(tmp_path / "out", example())
    change_head(tmp_path / "out", schema_version=99)
    assert is_material_folder(tmp_path / "out")
    with pytest.raises(InputError, match=f"has schema version 99; expected {SCHEMA_VERSION}"):
        read_material(tmp_path / "out")


def test_parts_that_disagree(tmp_path: Path) -> None:
    material = example()
    write_material(tmp_path / "out", material)
    change_head(tmp_path / "out", representatives=material.representatives[:, :-1].tolist())
    with pytest.raises(InputError, match="representatives has shape"):
        read_material(tmp_path / "out")
    change_head(tmp_path / "out", representatives=material.representatives[:2].tolist())
    with pytest.raises(InputError, match="blend index 4; expected 0 to 1, there are N=2"):
        read_material(tmp_path / "out")
    change_head(tmp_path / "out", n=3)
    with pytest.raises(InputError, match=r"has no channel 'index\.2'"):
        read_material(tmp_path / "out")
    change_head(tmp_path / "out", penalties=None)
    with pytest.raises(InputError, match="missing or malformed"):
        read_material(tmp_path / "out")


def test_weights_that_do_not_sum_to_one(tmp_path: Path) -> None:
    write_material(tmp_path / "out", example())
    channels = read_exr_channels(tmp_path / "out/blend.exr")
    channels["weight.0"] = channels["weight.0"] + np.float32(0.01)
    write_exr_channels(tmp_path / "out/blend.exr", channels)
    with pytest.raises(
        InputError, match=r"the blend weights at row \d+, column \d+ sum to 1\.01; expected 1"
    ):
        read_material(tmp_path / "out")
    with pytest.raises(InputError, match="a representative has the weight -"):
        write_material(tmp_path / "new", replace(example(), representatives=-example().representatives))
    assert not (tmp_path / "new").exists()


def change_head(folder: Path, **values: object) -> None:
    head = json.loads((folder / "svbrdf.json").read_text())
    (folder / "svbrdf.json").write_text(json.dumps(head | values))


@pytest.mark.parametrize(
    "basis", [paper(), extended(), GenericBasis("all", diffuse=tuple(DIFFUSE_KERNELS))], ids=lambda b: b.name
)
def test_normal_albedo_is_the_integral_of_the_basis(basis: GenericBasis) -> None:
    """The twin integrates the basis's own BRDF values over half-vectors for a viewer at the normal."""
    edges = np.concatenate([[0], np.geomspace(1e-5, 1, 4001)])  # tangents; beyond 45 degrees nothing is lit
    alpha = np.arctan((edges[1:] + edges[:-1]) / 2)
    i = np.stack([np.sin(2 * alpha), 0 * alpha, np.cos(2 * alpha)], axis=-1)
    d_omega = 2 * np.pi * -np.diff(np.cos(2 * np.arctan(edges)))
    twin = (basis.evaluate(i, np.array([0.0, 0.0, 1.0])) * (i[:, 2] * d_omega)[:, None]).sum(axis=0)
    # 4000 log-spaced midpoints resolve a lobe of any sigma to 1e-5; kernels of tau = 0 and small sigma
    # are about 1e-30 and compared absolutely.
    assert np.allclose(normal_albedo(record(basis)), twin, rtol=3e-3, atol=1e-6)


def single(basis: BasisRecord, weights: dict[int, tuple[float, float, float]]) -> Material:
    m = example(1)
    representatives = np.zeros((1, basis.kernels, 3))
    for j, colour in weights.items():
        representatives[0, j] = colour
    return replace(
        m,
        basis=basis,
        representatives=representatives,
        index=np.zeros((8, 9, 1), np.uint32),
        weight=np.ones((8, 9, 1), np.float32),
        coverage=np.full((8, 9), 3, np.int32),
    )


def test_maps_of_one_lobe_are_its_parameters() -> None:
    basis = record(paper())
    tau = 0.3
    maps = material_maps(single(basis, {20: (0.7,) * 3, 55: (0.3,) * 3, 70: (0.1, 0.2, 0.3)}))
    assert maps.tau[0, 0] == pytest.approx(tau, rel=1e-6)
    assert maps.diffuse[0, 0] == pytest.approx([0.1, 0.2, 0.3], rel=1e-6)
    # The parabola between grid points of 5 % leaves about 1e-4 of its step.
    assert maps.roughness[0, 0] == pytest.approx(basis.sigmas[20], rel=1e-3)
    # sigma 0.04: the lobe loses nothing at normal incidence.
    assert maps.specular[0, 0] == pytest.approx([tau] * 3, rel=1e-3)


def test_a_faint_spike_does_not_decide_the_roughness() -> None:
    basis = record(paper())
    maps = material_maps(single(basis, {35 + 0: (0.01,) * 3, 35 + 28: (0.5,) * 3}))
    assert maps.roughness[0, 0] == pytest.approx(basis.sigmas[28], rel=0.02)


def test_fitted_roughness_is_the_least_squares_fit() -> None:
    """The twin fits amplitude and sigma to sampled energies a log angle by brute force."""
    basis = record(paper())
    weights = {35 + 12: 0.2, 35 + 20: 0.3, 35 + 26: 0.15}
    maps = material_maps(single(basis, {j: (w,) * 3 for j, w in weights.items()}))
    log_t = np.linspace(np.log(1e-5), np.log(20), 4000)

    def lobe(sigma: float) -> np.ndarray:
        x = np.exp(2 * log_t) / sigma**2
        return 2 * x * np.exp(-x)

    target = sum(w * lobe(basis.sigmas[j - 35]) for j, w in weights.items())
    sigmas = np.geomspace(0.001, 0.5, 2000)
    left = []
    for sigma in sigmas:
        q = lobe(sigma)
        left.append(((target - (target @ q) / (q @ q) * q) ** 2).sum())
    # The brute force's grid is 0.3 % apart.
    assert maps.roughness[0, 0] == pytest.approx(sigmas[int(np.argmin(left))], rel=5e-3)


def test_maps_off_the_atlas_and_of_unseen_texels() -> None:
    m = single(record(paper()), {70: (0.5,) * 3})
    coverage = np.full((8, 9), -1, np.int32)
    coverage[0], coverage[1], coverage[2] = 0, 2, 50
    residual = np.where(coverage > 0, 0, np.nan).astype(np.float32)
    maps = material_maps(replace(m, coverage=coverage, residual=residual))
    assert all(np.isfinite(image).all() for image in vars(maps).values())
    assert maps.diffuse[3:].max() == 0
    assert maps.confidence[0].max() == maps.confidence[3:].max() == 0
    # Without an error model nothing is known of the error.
    assert maps.confidence.max() == 0
    assert maps.expected_error[:3].min() == 1 and maps.expected_error[3:].max() == 0
    assert maps.roughness.max() == maps.tau.max() == 0

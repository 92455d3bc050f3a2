# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The experiments: their truth, their errors on purpose, and the run that keeps what it has finished."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from swatchwork.cli import main
from swatchwork.errors import InputError
from swatchwork.light import Environment
from swatchwork.reflectance import paper
from swatchwork.reproduce import EXPERIMENTS, experiments_of, reproduce
from swatchwork.reproduce.data import Data, KernelBrdf
from swatchwork.reproduce.fig7 import lit_by_directions
from swatchwork.reproduce.sensitivity import with_wrong_cameras, with_wrong_normals
from swatchwork.reproduce.spheres import views_of
from swatchwork.reproduce.targets import copper, halves, homogeneous, triangle
from swatchwork.response import generic_responses
from swatchwork.simulate import measured_responses, procedural_environment


def some_pairs(count: int, lowest: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    n, o = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.normal(size=(2, count, 3)))
    o = np.where((n * o).sum(axis=1, keepdims=True) < 0, -o, o)
    kept = (n * o).sum(axis=1) > lowest
    return n[kept], o[kept]


def test_quadrature_of_a_grey_reflectance_in_a_furnace() -> None:
    light = Environment(np.ones((32, 64, 3), np.float32), "blender")
    grey = np.zeros((paper().kernels, 3))
    grey[-1] = [0.2, 0.5, 0.8]
    n, o = some_pairs(40, 0.03)
    found = measured_responses([KernelBrdf("grey", paper(), grey)], light, n, o)
    # What 4900 half-vectors leave of the horizon's cosine.
    np.testing.assert_allclose(found[:, 0], np.broadcast_to(grey[-1], (len(n), 3)), rtol=0.01)


def test_quadrature_agrees_with_the_ring_operator() -> None:
    """Two ways to the same integral: NRMS over random pairs under windows, lamps and a sun."""
    kernels = (20, 30, 34, 50, 70)
    weights = np.zeros((len(kernels), paper().kernels, 3))
    for row, j in zip(weights, kernels, strict=True):
        row[j] = 1
    n, o = some_pairs(150)
    for kind in ("room", "sky"):
        light = procedural_environment(kind, 0)
        brdfs = [KernelBrdf(str(j), paper(), w) for j, w in zip(kernels, weights, strict=True)]
        found = measured_responses(brdfs, light, n, o)
        rings = generic_responses(paper(), light.pyramid(), n, o)[:, list(kernels)]
        nrms = np.sqrt(((found - rings) ** 2).sum(axis=(0, 2)) / (rings.astype(float) ** 2).sum(axis=(0, 2)))
        # The operator itself is bounded at 1.5 %; so few pairs are dominated by one or two.
        assert (nrms < 0.025).all(), nrms


def test_truths_are_what_they_claim() -> None:
    for sphere, n, N in (
        (triangle(paper(), 200), 3, 3),
        (copper(Data(), 200), 3, 5),
        (halves(0.165, (0.15, 0.85), 200), 1, 2),
    ):
        np.testing.assert_allclose(sphere.weights.sum(axis=1), 1, atol=1e-12)
        assert (sphere.weights >= 0).all() and sphere.weights.shape[1] == N
        assert (np.count_nonzero(sphere.weights, axis=1) <= n).all()
    assert (triangle(paper(), 200).weights.max(axis=0) > 0.6).all(), "towards a corner one material prevails"
    assert np.mean((triangle(paper(), 200).weights > 0.05).all(axis=1)) > 0.7, "all three at most points"
    # Both halves reflect alike along the normal: tau times the specular colour.
    left, right = halves(0.165, (0.15, 0.85), 20).materials.representatives[:, 1, 0]  # type: ignore[attr-defined]
    assert left == pytest.approx(right)


def test_errors_of_zero_size_change_nothing() -> None:
    sphere = homogeneous(0.1, 120)
    light, views = procedural_environment("room", 0), views_of(0)[:3]
    capture = sphere.captured(light, views, paper())
    for spoil in (with_wrong_normals, with_wrong_cameras):
        same = spoil(sphere, capture, views, 0.0)
        np.testing.assert_array_equal(same.pairs.texel, capture.pairs.texel)
        # To f32 of directions.
        np.testing.assert_allclose(same.pairs.normal, capture.pairs.normal, atol=1e-6)
        np.testing.assert_allclose(same.pairs.to_viewer, capture.pairs.to_viewer, atol=1e-6)
        np.testing.assert_allclose(same.radiance, capture.radiance, rtol=1e-3)
    angle = np.arccos(
        np.clip(
            (with_wrong_normals(sphere, capture, views, 3.0).pairs.normal * capture.pairs.normal).sum(axis=1),
            -1,
            1,
        )
    )
    assert np.rad2deg(angle.mean()) == pytest.approx(3.0, rel=0.1)


def test_directional_light_is_a_function_of_the_reflectance_alone() -> None:
    sphere = triangle(paper(), 60)
    views = views_of(1)[:2]
    m, seen = lit_by_directions(sphere, views, views, paper())
    # Light from the camera (but for its finite distance): brightest where the surface faces it.
    assert len(m.offsets) == len(seen) + 1 and (m.radiance >= 0).all()
    made = np.einsum(
        "pjc,pjc->pc",
        m.responses,
        np.einsum("mn,njc->mjc", sphere.weights[seen], sphere.materials.representatives)[m.texel],
    )  # type: ignore[attr-defined]
    np.testing.assert_allclose(made, m.radiance, rtol=1e-4, atol=1e-7)


def test_a_run_is_kept_and_gone_on_from(tmp_path: Path) -> None:
    found = reproduce(["fig9"], tmp_path, quick=True)
    page = (tmp_path / "reproduction.md").read_text(encoding="utf-8")
    assert "Fresnel" in page and "stand in" in page and "Quick sizes" in page
    assert [name for name, _ in found.claims] == ["fig9"] and found.claims[0][1].holds
    # What is there is not measured again.
    file = tmp_path / "fig9.json"
    kept = json.loads(file.read_text(encoding="utf-8"))
    kept["figures"]["tau"][0][1] = 0.5
    file.write_text(json.dumps(kept), encoding="utf-8")
    again = reproduce(["fig9"], tmp_path, quick=True)
    assert not again.claims[0][1].holds
    assert "**does not hold**" in (tmp_path / "reproduction.md").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="another setting"):
        reproduce(["fig9"], tmp_path)


def test_experiments_by_name() -> None:
    assert [e.name for e in experiments_of(["fig3", "fig5"])] == ["fig4", "fig5"]
    assert experiments_of(["all"]) == list(EXPERIMENTS) == experiments_of([])
    with pytest.raises(InputError, match="no experiment 'fig99'"):
        experiments_of(["fig99"])


def test_the_command_line_names_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "fig99", "-o", str(tmp_path / "out")]) == 2
    assert "fig99" in capsys.readouterr().err and not (tmp_path / "out").exists()
    assert main(["reproduce", "fig9", "--data", str(tmp_path / "none"), "-o", str(tmp_path / "out")]) == 2
    assert "data folder" in capsys.readouterr().err and not (tmp_path / "out").exists()

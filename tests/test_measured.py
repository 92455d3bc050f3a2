# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Readers of measured reflectance against what is known about the files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from swatchwork.arrays import F64, unit
from swatchwork.errors import InputError
from swatchwork.simulate.measured import (
    MERL_DIMENSIONS,
    MERL_SCALE,
    MeasuredBrdf,
    half_difference,
    material_names,
    read_merl_binary,
    read_neural_brdf,
    read_npf,
)


def upper_directions(count: int, seed: int) -> F64:
    d = unit(np.random.default_rng(seed).normal(size=(count, 3)))
    d[:, 2] = np.abs(d[:, 2])
    return d


@pytest.fixture(params=["neural", "npf"])
def gold(request: pytest.FixtureRequest, shared: Path) -> MeasuredBrdf:
    folder = shared / "data" / "merl"
    if request.param == "neural":
        return read_neural_brdf(folder / "merl_nbrdf.npz", "gold-metallic-paint")
    return read_npf(folder / "merl_npf.npz", "gold-metallic-paint")


def test_half_difference_turns_i_into_the_frame_of_h() -> None:
    i, o = upper_directions(200, 1), upper_directions(200, 2)
    angles = half_difference(i, o)
    h = unit(i + o)
    phi = np.arctan2(h[:, 1], h[:, 0])
    theta = np.arccos(h[:, 2])
    for k in range(200):  # the twin: rotate by -phi about z, then by -theta about y
        cp, sp, ct, st = np.cos(phi[k]), np.sin(phi[k]), np.cos(theta[k]), np.sin(theta[k])
        about_z = np.array([[cp, sp, 0], [-sp, cp, 0], [0, 0, 1]])
        about_y = np.array([[ct, 0, -st], [0, 1, 0], [st, 0, ct]])
        np.testing.assert_allclose(angles.d[k], about_y @ about_z @ i[k], atol=1e-12)  # rounding
    np.testing.assert_allclose(half_difference(o, i).d, angles.d * [-1, -1, 1], atol=1e-12)  # rounding


def test_spectralon_reflects_almost_everything(shared: Path) -> None:
    """The published network gives 0.32 = 1.005 / pi (data README); its frame and unit are then right."""
    spectralon = read_neural_brdf(shared / "data/merl/rgl_isotropic_nbrdf.npz", "spectralon_rgb")
    i = unit(upper_directions(500, 3) * [0.2, 0.2, 1.0])
    o = unit(upper_directions(500, 4) * [0.2, 0.2, 1.0])
    # 4 %: near the normal; elsewhere real spectralon departs from Lambert's law by more.
    assert np.median(np.pi * spectralon.evaluate(i, o)) == pytest.approx(1.005, rel=0.04)


def test_two_independent_fits_agree_on_the_scale(shared: Path) -> None:
    folder = shared / "data" / "merl"
    i, o = upper_directions(4000, 5), upper_directions(4000, 6)
    high = (i[:, 2] > 0.2) & (o[:, 2] > 0.2)
    for name in ("teflon", "pink-plastic", "gold-metallic-paint"):
        a = read_neural_brdf(folder / "merl_nbrdf.npz", name).evaluate(i, o)[high]
        b = read_npf(folder / "merl_npf.npz", name).evaluate(i, o)[high]
        # 15 %: single materials of these fits differ by that much; a wrong unit shows as a factor of pi.
        assert np.median(b / a) == pytest.approx(1.0, abs=0.15)


def test_reciprocal_non_negative_and_dark_below_the_horizon(gold: MeasuredBrdf) -> None:
    i, o = upper_directions(2000, 7), upper_directions(2000, 8)
    value = gold.evaluate(i, o)
    assert value.shape == (2000, 3)
    assert np.all(value >= 0)
    assert np.all(np.isfinite(value))
    # 1e-4 relative: the networks are evaluated in float32, on inputs whose signs differ.
    np.testing.assert_allclose(gold.evaluate(o, i), value, rtol=1e-4, atol=1e-6)
    assert np.all(gold.evaluate(i * [1, 1, -1], o) == 0)
    assert np.all(gold.evaluate(i, o * [1, 1, -1]) == 0)


def test_isotropic(gold: MeasuredBrdf) -> None:
    i, o = upper_directions(500, 9), upper_directions(500, 10)
    c, s = np.cos(1.1), np.sin(1.1)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    # As above: float32 networks.
    np.testing.assert_allclose(
        gold.evaluate(i @ turn.T, o @ turn.T), gold.evaluate(i, o), rtol=1e-4, atol=1e-6
    )


def test_broadcasts_a_single_viewer(gold: MeasuredBrdf) -> None:
    i, o = upper_directions(6, 11).reshape(2, 3, 3), np.array([0.6, 0.0, 0.8])
    assert gold.evaluate(i, o).shape == (2, 3, 3)


def test_all_materials_are_listed_and_an_unknown_one_is_named(shared: Path) -> None:
    file = shared / "data/merl/merl_nbrdf.npz"
    assert len(material_names(file)) == 100
    with pytest.raises(InputError, match=r"no material 'unobtainium'; expected one of 100 names"):
        read_neural_brdf(file, "unobtainium")


def test_merl_binary_looks_up_the_cell_and_scales_it(tmp_path: Path) -> None:
    cells = np.arange(np.prod(MERL_DIMENSIONS), dtype=np.float64).reshape(MERL_DIMENSIONS)
    raw = np.array(MERL_DIMENSIONS, "<i4").tobytes() + np.stack([cells, -cells - 1, cells]).tobytes()
    file = tmp_path / "made-up.binary"
    file.write_bytes(raw)
    table = read_merl_binary(file)
    assert table.name == "made-up"
    # h = z, so theta_h is in cell 0; theta_d = 30.5 degrees is in cell 30; i along x: phi_d in cell 0.
    theta = np.deg2rad(30.5)
    i = np.array([np.sin(theta), 1e-9, np.cos(theta)])
    value = table.evaluate(i, i * [-1, -1, 1])
    # 1e-6: the table is kept in float32.
    assert value[0] == pytest.approx(cells[0, 30, 0] * MERL_SCALE[0], rel=1e-6)
    assert value[1] == 0  # invalid cells are negative
    assert value[2] == pytest.approx(cells[0, 30, 0] * MERL_SCALE[2], rel=1e-6)


def test_merl_binary_of_another_size_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "cut.binary"
    file.write_bytes(np.array(MERL_DIMENSIONS, "<i4").tobytes() + b"\0" * 64)
    with pytest.raises(InputError, match=r"cut.binary: a table of dimensions \(90, 90, 180\) in 76 bytes"):
        read_merl_binary(file)

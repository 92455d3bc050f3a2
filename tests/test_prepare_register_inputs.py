# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""What `prepare register` refuses before it places anything, and where it takes the object to be."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from swatchwork.capture import Camera, EnvironmentSource, write_exr
from swatchwork.errors import InputError
from swatchwork.simulate import shape
from swatchwork.surface import write_mesh_obj
from swatchwork.workflow import register_photographs
from swatchwork.workflow.register_inputs import LEAST_PX, photographs_to_register, read_views
from test_prepare_register_board import write_lens

SIZE = 160
LENS = Camera(SIZE, SIZE, 200.0, 200.0, SIZE / 2, SIZE / 2, np.eye(4))
GRAY = np.full((SIZE, SIZE, 3), 0.5, np.float32)


def square(side: int, low: int = 20) -> np.ndarray:
    region = np.zeros((SIZE, SIZE), bool)
    region[low : low + side, low : low + side] = True
    return region


def exr(folder: Path, alpha: np.ndarray | None = None, radiance: np.ndarray = GRAY) -> Path:
    file = folder / "a.exr"
    write_exr(file, radiance if alpha is None else np.dstack([radiance, alpha.astype(np.float32)]))
    return file


def masked(folder: Path, region: np.ndarray) -> Path:
    (folder / "masks").mkdir()
    cv2.imwrite(str(folder / "masks" / "a.png"), region.astype(np.uint8) * 255)
    return folder / "masks"


def region_of(file: Path, masks: Path | None = None) -> np.ndarray | None:
    return read_views([file], LENS, masks)[0]["a"].region


def test_of_linearized_photographs_the_contact_sheet_is_left_out(tmp_path: Path) -> None:
    file, sheet = exr(tmp_path), tmp_path / "contact-sheet.png"
    cv2.imwrite(str(sheet), np.zeros((8, 8, 3), np.uint8))
    assert photographs_to_register([tmp_path]) == [file, sheet]
    (tmp_path / "linearize.json").write_text("{}")
    assert photographs_to_register([tmp_path]) == [file]


def test_the_object_is_where_both_mask_and_alpha_have_it(tmp_path: Path) -> None:
    alpha, mask = square(60), square(60, 30)
    file = exr(tmp_path, np.where(alpha, 0.9, 0.4))
    np.testing.assert_array_equal(region_of(file), alpha)
    np.testing.assert_array_equal(region_of(file, masked(tmp_path, mask)), alpha & mask)


def test_alpha_that_leaves_nothing_out_says_nothing(tmp_path: Path) -> None:
    assert region_of(exr(tmp_path, np.where(square(60), 0.9, 1.0))) is None


def test_alpha_that_leaves_all_out_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.exr: alpha is nowhere above 0\.5, at most 0\.5"):
        region_of(exr(tmp_path, np.full((SIZE, SIZE), 0.5)))


def test_mask_and_alpha_of_two_objects_are_refused(tmp_path: Path) -> None:
    masks = masked(tmp_path, square(60, 90))
    with pytest.raises(InputError, match=r"a\.exr: alpha has the object nowhere where the mask .*a\.png"):
        region_of(exr(tmp_path, square(60)), masks)


def test_an_object_must_be_large_enough(tmp_path: Path) -> None:
    masks = masked(tmp_path, square(LEAST_PX))
    assert region_of(exr(tmp_path), masks) is not None
    cv2.imwrite(str(masks / "a.png"), square(LEAST_PX - 1).astype(np.uint8) * 255)
    with pytest.raises(InputError, match=r"a\.png: the object is only 39 px large; expected 40 px or more"):
        region_of(exr(tmp_path), masks)
    with pytest.raises(InputError, match=r"a\.exr: the object is only 20 px large"):
        region_of(exr(tmp_path, square(20)))


@pytest.mark.parametrize("share", [0.01, 0.2, 0.5])
def test_speckles_are_no_object(tmp_path: Path, share: float) -> None:
    noise = np.random.default_rng(3).random((SIZE, SIZE)) < share
    masks = masked(tmp_path, noise)
    with pytest.raises(InputError, match=r"a\.png: it is speckles"):
        region_of(exr(tmp_path), masks)
    # Some beside the object are the silhouette's to judge.
    cv2.imwrite(str(masks / "a.png"), (noise & square(20, 0) | square(60, 40)).astype(np.uint8) * 255)
    assert region_of(exr(tmp_path), masks) is not None


@pytest.mark.parametrize(("value", "words"), [(np.nan, "NaN or infinite"), (-0.5, "negative, down to -0.5")])
def test_pixels_that_are_no_light_are_named_when_read(tmp_path: Path, value: float, words: str) -> None:
    bad = GRAY.copy()
    bad[30, 40] = value
    file = exr(tmp_path, radiance=bad)
    with pytest.raises(InputError, match=rf"a\.exr: 1 pixels are {words}, the first at row 30, column 40"):
        region_of(file)
    # As in the capture: what the mask leaves out may be anything.
    assert region_of(file, masked(tmp_path, square(60, 80))) is not None


@pytest.mark.parametrize("wrong", ["light", "no light", "inf", "nan", "-1"])
def test_light_and_scan_error_are_checked_first(
    tmp_path: Path, wrong: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def early(*_: object, **__: object) -> None:
        raise AssertionError("the poses were looked for")

    monkeypatch.setattr("swatchwork.workflow.preparing_register.register", early)
    write_lens(tmp_path / "lens.json", LENS)
    write_mesh_obj(tmp_path / "mesh.obj", shape("sphere", 6))
    light, error, words = None, 0.0, f"--scan-error is {wrong}; expected a finite length"
    if "light" in wrong:
        light, words = EnvironmentSource(tmp_path / "light.exr", "blender"), "light.exr"
        if wrong == "light":
            write_exr(tmp_path / "light.exr", np.full((8, 16, 3), np.nan, np.float32))
    else:
        error = float(wrong)
    with pytest.raises(InputError, match=words):
        register_photographs(
            [exr(tmp_path)],
            tmp_path / "capture",
            intrinsics=tmp_path / "lens.json",
            mesh=tmp_path / "mesh.obj",
            environment=light,
            scan_error=error,
        )
    assert not (tmp_path / "capture").exists()

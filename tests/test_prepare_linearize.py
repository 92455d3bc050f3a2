# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Radiance from RAW files and brackets of known light, and wrong input told."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image as Pillow

from swatchwork.capture import read_exr_channels, read_image
from swatchwork.cli import main
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.prepare import (
    REFERENCE,
    Exposure,
    LinearizeOptions,
    exposures_of,
    given_response,
    linearize,
    recover_response,
    views_of,
)
from swatchwork.prepare.brackets import Shot, merge
from swatchwork.prepare.raw import FOOTPRINT_PX, develop
from synthetic_dng import BLACK, CAM_FROM_XYZ, RGGB, WHITE, X_TRANS, mosaic_of, patches, write_dng

SRGB_FROM_XYZ = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
TIMES = (1 / 800, 1 / 200, 1 / 50, 1 / 12)


def camera_matrix() -> tuple[np.ndarray, np.ndarray]:
    """Daylight multipliers and linear sRGB from balanced camera colours, by the DNG specification's route."""
    cam_from_srgb = CAM_FROM_XYZ @ np.linalg.inv(SRGB_FROM_XYZ)
    white = cam_from_srgb @ np.ones(3)
    return white[1] / white, np.linalg.inv(np.diag(1 / white) @ cam_from_srgb)


def test_raw_levels_are_those_of_the_mosaic(tmp_path: Path) -> None:
    colours = [(0.1, 0.2, 0.05), (0.6, 0.3, 0.4), (0.0, 0.0, 0.0)]
    file = tmp_path / "a.dng"
    for black in (0, 512, 1024):
        write_dng(file, mosaic_of(patches(*colours), black), black=black)
        found = develop(file, (1.0, 1.0, 1.0), "camera")
        assert found.matrix is None and found.black == (black,) * 4 and found.white == WHITE
        for i, colour in enumerate(colours):
            # A step of the mosaic is 7e-5 of full scale; LibRaw's 16 bits add less.
            inner = found.linear[12:36, 48 * i + 12 : 48 * i + 36]
            np.testing.assert_allclose(inner, np.broadcast_to(colour, inner.shape), atol=1e-4)
        assert not found.clipped.any()


def test_raw_colours_are_linear_srgb(tmp_path: Path) -> None:
    multipliers, matrix = camera_matrix()
    srgb = np.array([(0.3, 0.3, 0.3), (0.5, 0.2, 0.1), (0.1, 0.3, 0.4)])
    camera = srgb @ np.linalg.inv(matrix).T / multipliers
    file = tmp_path / "a.dng"
    write_dng(file, mosaic_of(patches(*map(tuple, camera))))
    found = develop(file)
    # The two roundings of the sRGB primaries differ in the fourth digit.
    np.testing.assert_allclose(found.white_balance, multipliers, rtol=2e-3)
    for i, colour in enumerate(srgb):
        np.testing.assert_allclose(found.linear[24, 48 * i + 24], colour, atol=1.5e-3)
    as_shot = develop(file, "camera", "camera")
    np.testing.assert_allclose(as_shot.white_balance, (2.0, 1.0, 1.6), rtol=1e-3)
    np.testing.assert_allclose(as_shot.linear[24, 24], camera[0] * (2.0, 1.0, 1.6), atol=2e-4)


def test_raw_is_not_brightened_and_saturation_is_kept_by_channel(tmp_path: Path) -> None:
    colour = patches((0.02, 0.03, 0.02), (0.5, 1.2, 0.3), (0.02, 0.03, 0.02))
    file = tmp_path / "a.dng"
    write_dng(file, mosaic_of(colour))
    found = develop(file, (2.0, 1.0, 1.5), "camera")
    # A dark picture stays dark; red, whose multiplier is the largest, is not cut at full scale.
    np.testing.assert_allclose(found.linear[24, 24], (0.04, 0.03, 0.03), atol=2e-4)
    np.testing.assert_allclose(found.linear[24, 72], (1.0, 1.0, 0.45), atol=2e-4)
    green = np.zeros(colour.shape[:2], dtype=bool)
    green[:, 48:96] = True
    assert found.clipped[..., 1][green].all()
    # Demosaicing carries saturated photosites five pixels beyond.
    assert found.clipped[:, 43:101, 1].all()
    assert not found.clipped[:, :43].any() and not found.clipped[:, 101:].any()
    assert not found.clipped[..., [0, 2]].any()


@pytest.mark.parametrize(
    ("pattern", "texture", "reach"),
    [(RGGB, "flat", 1), (RGGB, "noise", 5), (RGGB, "waves", 4), (X_TRANS, "noise", 2)],
)
def test_what_a_saturated_photosite_changes_is_marked(
    pattern: tuple[str, ...], texture: str, reach: int, tmp_path: Path
) -> None:
    """One photosite at full scale or not, at each of six by six places."""
    side, rng = 48, np.random.default_rng(0)
    y, x = np.mgrid[:side, :side]
    share = {
        "flat": np.full((side, side, 3), 0.2),
        "noise": 0.2 * np.exp(0.2 * rng.normal(size=(side, side, 3))),
        "waves": (0.2 + 0.1 * np.sin(x / 3 + y / 5))[..., None] * [1, 0.8, 0.6],
    }[texture]
    mosaic = mosaic_of(share, pattern=pattern)
    file = tmp_path / "a.dng"
    write_dng(file, mosaic, pattern=pattern)
    before = develop(file, (2.0, 1.0, 1.5), "camera").linear
    np.testing.assert_array_equal(before, develop(file, (2.0, 1.0, 1.5), "camera").linear)
    farthest = 0
    for row, column in [(r, c) for r in range(20, 26) for c in range(20, 26)]:
        lit = mosaic.copy()
        lit[row, column] = WHITE
        write_dng(file, lit, pattern=pattern)
        found = develop(file, (2.0, 1.0, 1.5), "camera")
        # 0.1 % of what is there: below a sensor's noise. LibRaw's 16 bits are a tenth of that.
        changed = (np.abs(found.linear - before) > 1e-3 * before + 1e-4).any(axis=-1)
        assert changed.any() and not (changed & ~found.clipped.any(axis=-1)).any()
        away = np.abs(np.argwhere(changed) - [row, column]).max()
        farthest = max(farthest, int(away))
    assert farthest == reach <= FOOTPRINT_PX // 2


def test_raw_to_radiance_with_missing_pixels(tmp_path: Path) -> None:
    file = tmp_path / "shot.dng"
    write_dng(file, mosaic_of(patches((0.2, 0.4, 0.2), (0.5, 1.2, 0.3))), Exposure(1 / 50, 200, 4))
    out = tmp_path / "out"
    assert main(["prepare", "linearize", str(file), "-o", str(out), "--white-balance", "1,1,1", "-q"]) == 0
    image = read_image(out / "shot.exr")
    assert image.alpha is None and {f.name for f in out.iterdir()} == {
        "shot.exr",
        "linearize.json",
        "contact-sheet.png",
    }
    assert not image.clipped[:, :43].any() and image.clipped[:, 43:].all()
    # What the sensor read there, for the probe: brighter than what it could tell.
    assert image.linear[24, 72, 1] > image.linear[24, 20, 1]
    found = json.loads((out / "linearize.json").read_text(encoding="utf-8"))
    # 16 times the reference's light: twice the time, twice the speed, half the aperture number.
    _, matrix = camera_matrix()
    expected = np.array([0.2, 0.4, 0.2]) @ matrix.T / 16
    np.testing.assert_allclose(image.linear[24, 20], np.maximum(expected, 0), atol=2e-4)
    assert found["raw"]["white_balance"] == [1, 1, 1] and found["response"] is None
    view = found["views"][0]
    assert view["photographs"][0]["iso"] == 200 and view["photographs"][0]["time"] == pytest.approx(0.02)
    # Half of it, and five pixels more.
    assert view["missing"] == pytest.approx((48 + 5) / 96)
    channels = read_exr_channels(out / "shot.exr")
    assert (channels["clipped.G"][:, 48:] == 1).all() and (channels["clipped.R"] == 0).all()


@pytest.mark.parametrize("colour", ["srgb", "camera"])
def test_what_is_said_of_saturated_raw_is_true(colour: str, tmp_path: Path) -> None:
    """Of the camera's own channels a reading is at most the light; the matrix takes that away."""
    light, file = np.array([0.5, 1.2, 0.3]), tmp_path / "a.dng"
    write_dng(file, mosaic_of(patches(tuple(light))))
    words = [str(file), "-o", str(tmp_path / "out"), "--white-balance", "1,1,1", "--colour", colour, "-q"]
    assert main(["prepare", "linearize", *words]) == 0
    if colour == "srgb":
        light = light @ camera_matrix()[1].T
    excess = read_image(tmp_path / "out/a.exr").linear[24, 24] - np.maximum(light, 0)
    said = json.loads((tmp_path / "out/linearize.json").read_text(encoding="utf-8"))["clipped"]
    assert said.startswith("of the camera's own red, green and blue")
    # Half floats have a step of 0.05 %.
    if colour == "srgb":
        assert excess.max() > 0.05 and "can read more light than there was" in said
    else:
        assert excess.max() < 1e-3 and excess.min() < -0.1 and "no more light than there was" in said


def test_raw_brackets_merge_to_what_was_there(tmp_path: Path) -> None:
    """Radiances over 2000:1, which no exposure holds; each patch to 0.2 %, or two steps of its mosaic."""
    radiance = [(r, 0.8 * r, 0.6 * r) for r in (0.004, 0.05, 0.4, 3.0, 8.0)]
    files = []
    for i, time in enumerate(TIMES):
        exposure = Exposure(time, 100, 8)
        files.append(tmp_path / f"{i}.dng")
        write_dng(files[-1], mosaic_of(patches(*radiance) * exposure.light / REFERENCE.light), exposure)
    options = LinearizeOptions(per_view=4, white_balance=(1, 1, 1), colour="camera")
    # The brightest is saturated in all but the first: nothing to compare it with.
    view = linearize(files, tmp_path, options).views[0]
    image = read_image(tmp_path / "0.exr")
    for i, expected in enumerate(radiance):
        got = image.linear[24, 48 * i + 24]
        if i == 4:
            assert image.clipped[24, 48 * i + 24]
        else:
            np.testing.assert_allclose(got, expected, rtol=2e-3, atol=2 / (WHITE - BLACK) / 16)
    assert view.residual is not None and view.residual < 0.02
    assert [round(s, 2) for s in view.steps] == [1, 1, 1]
    assert list(view.saturated) == sorted(view.saturated)


def test_a_white_balance_serves_the_probe_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The camera stores another white balance with the ball; the same light must read the same."""
    mosaic = mosaic_of(patches((0.2, 0.4, 0.2), (0.3, 0.1, 0.05)))
    for name, neutral in (("view", (0.5, 1.0, 0.625)), ("ball", (0.8, 1.0, 0.4))):
        write_dng(tmp_path / f"{name}.dng", mosaic, neutral=neutral)

    def linearized(name: str, white_balance: str) -> tuple[np.ndarray, dict]:
        words = [str(tmp_path / f"{name}.dng"), "-o", str(tmp_path / name), "--white-balance", white_balance]
        assert main(["prepare", "linearize", *words, "--json"]) == 0
        return read_image(tmp_path / name / f"{name}.exr").linear, json.loads(capsys.readouterr().out)

    view, said = linearized("view", "camera")
    np.testing.assert_allclose(said["white_balance"], (2, 1, 1.6), rtol=1e-3)
    (warning,) = said["warnings"]
    file = tmp_path / "view/linearize.json"
    assert "stored in view.dng" in warning and f"--white-balance {file} to that for the light" in warning
    other, _ = linearized("ball", "camera")
    assert np.abs(other - view).max() > 0.2
    ball, said = linearized("ball", str(file))
    assert said["warnings"] == []
    # The same multipliers to the last digit: LibRaw's arithmetic is then the same.
    np.testing.assert_array_equal(ball, view)


def scene(seed: int = 0) -> np.ndarray:
    """Smooth radiance [96, 128, 3] over a range of 300."""
    rng = np.random.default_rng(seed)
    noise = cv2.resize(rng.normal(size=(6, 8, 3)), (128, 96), interpolation=cv2.INTER_CUBIC)
    return np.exp(1.1 * noise) * np.linspace(0.03, 2, 128)[None, :, None]


def coded(light: np.ndarray, gamma: float) -> np.ndarray:
    return (np.clip(light, 0, 1) ** (1 / gamma) * 255 + 0.5).astype(np.uint8)


def write_bracket(
    folder: Path, radiance: np.ndarray, gamma: float, suffix: str = "png", name: str = "a"
) -> list[Path]:
    """Photographs with EXIF (JPEG) at 4 exposures, and exposures.csv for all of the folder."""
    folder.mkdir(exist_ok=True)
    files = []
    rows = ["file,time,iso,aperture"]
    for i, time in enumerate(TIMES):
        files.append(folder / f"{name}{i}.{suffix}")
        picture = Pillow.fromarray(coded(radiance * time * 100, gamma))
        exif = Pillow.Exif()
        exif[271] = "Swatchwork"
        exif.get_ifd(0x8769).update({33434: time, 33437: 8.0, 34855: 100})
        picture.save(files[-1], quality=98, subsampling=0, exif=exif)
        rows.append(f"{files[-1].name},1/{round(1 / time)},100,8")
    (folder / f"{name}.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return files


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_brackets_of_a_known_gamma_merge_to_what_was_there(suffix: str, tmp_path: Path) -> None:
    radiance = scene()
    files = write_bracket(tmp_path / "in", radiance, 2.2, suffix)
    view = linearize(files, tmp_path, LinearizeOptions(per_view=4, response="gamma:2.2")).views[0]
    image = read_image(tmp_path / "a0.exr")
    good = ~image.clipped
    error = np.log(image.linear[good] / radiance[good])
    # 8 bits: half a code is 2.7 % of the light at code 40, a percent at most; JPEG as much again.
    limit = 0.01 if suffix == "png" else 0.02
    assert np.sqrt((error**2).mean()) < limit and abs(np.median(error)) < 0.002
    assert view.residual is not None and view.residual < 3 * limit
    np.testing.assert_allclose(view.steps, 1, atol=0.01)
    assert view.missing == pytest.approx((radiance * TIMES[0] * 100 >= 1).any(axis=-1).mean(), abs=0.02)


def test_the_response_is_recovered() -> None:
    brackets = []
    for seed in (0, 1):
        radiance = scene(seed)
        brackets.append(([coded(radiance * t * 100, 1.8) for t in TIMES], list(TIMES)))
    found = recover_response(brackets)
    codes = np.arange(20, 236)
    truth = (codes / 255) ** 1.8
    ratio = np.log(found.table[codes] / truth[:, None])
    ratio -= np.median(ratio)
    # Half a code is half a percent of the light at middle codes; smoothness averages it over its neighbours.
    assert np.abs(ratio[30:-30]).max() < 0.01 and np.sqrt((ratio**2).mean()) < 0.01
    assert found.spread is not None and found.spread < 0.02
    # Its scale is sRGB's at half of full scale.
    assert found.table[127:129].mean(axis=0) == pytest.approx([0.214] * 3, abs=2e-3)


def test_photographs_and_probe_come_out_on_one_scale(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same light as a bracket, and at another aperture through the first one's response."""
    radiance = scene()
    files = write_bracket(tmp_path / "in", radiance, 1.9)
    out, ball = tmp_path / "out", tmp_path / "ball"
    table = ["--exposures", str(tmp_path / "in/a.csv")]
    named = [str(file) for file in files]
    assert main(["prepare", "linearize", *named, *table, "-o", str(out), "--per-view", "4", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["response"] == "recovered" and said["residual"] < 0.03 and said["views"] == 1
    assert {f.name for f in out.iterdir()} == {
        "a0.exr",
        "linearize.json",
        "contact-sheet.png",
        "response.svg",
    }
    assert (out / "response.svg").read_text(encoding="utf-8").startswith("<svg")
    probe = tmp_path / "ball.png"
    # ISO 400 at f/16 and 1/100 s take in as much as the reference.
    Pillow.fromarray(coded(radiance, 1.9)).save(probe)
    (tmp_path / "ball.json").write_text(
        json.dumps({"ball.png": {"time": "1/100", "iso": 400, "aperture": "f/16"}}), encoding="utf-8"
    )
    same = ["--response", str(out / "linearize.json"), "--exposures", str(tmp_path / "ball.json")]
    assert main(["prepare", "linearize", str(probe), *same, "-o", str(ball), "-q"]) == 0
    a, b = read_image(out / "a0.exr"), read_image(ball / "ball.exr")
    both = ~a.clipped & ~b.clipped & (radiance > 0.1).all(axis=-1)
    # The response's own error of some percent, and 8 bits.
    ratio = b.linear[both] / a.linear[both]
    assert np.median(ratio) == pytest.approx(1, abs=0.01) and np.abs(np.log(ratio)).mean() < 0.03


def test_a_rerun_leaves_no_views_of_the_run_before(tmp_path: Path) -> None:
    files = write_bracket(tmp_path / "in", scene(), 2.2, "jpg")
    out = tmp_path / "out"
    outside = tmp_path / "outside.exr"
    run = ["prepare", "linearize", "-o", str(out), "-q"]
    assert main([*run, *map(str, files), "--response", "srgb"]) == 0
    listed = out / "linearize.json"
    before = json.loads(listed.read_text(encoding="utf-8"))
    assert {view["file"] for view in before["views"]} == {f"a{i}.exr" for i in range(4)}
    # Not ours: a file that no list names, and what a doctored list would have us remove.
    for other in (out / "mine.exr", outside, out / "notes.txt"):
        other.write_text("mine", encoding="utf-8")
    before["views"] += [
        {"file": name} for name in ("../outside.exr", str(outside), "notes.txt", "..", ".exr")
    ]
    listed.write_text(json.dumps(before), encoding="utf-8")
    # A run that fails changes nothing.
    assert main([*run, str(files[1]), "--response", "none.json"]) == 2
    assert (out / "a0.exr").is_file() and listed.is_file()
    assert main([*run, *map(str, files[1:3]), "--response", "srgb"]) == 0
    kept = {"a1.exr", "a2.exr", "linearize.json", "contact-sheet.png", "response.svg"}
    assert {f.name for f in out.iterdir()} == kept | {"mine.exr", "notes.txt"} and outside.is_file()
    # From JPEG to RAW there is no response any more; a damaged list removes nothing.
    raw = tmp_path / "r.dng"
    write_dng(raw, mosaic_of(patches((0.2, 0.2, 0.2))))
    assert main([*run, str(raw)]) == 0
    kept = {"r.exr", "linearize.json", "contact-sheet.png", "mine.exr", "notes.txt"}
    assert {f.name for f in out.iterdir()} == kept
    listed.write_text("{", encoding="utf-8")
    assert main([*run, str(files[0]), "--response", "srgb"]) == 0
    assert (out / "r.exr").is_file() and (out / "a0.exr").is_file()


def test_merge_is_the_sum_of_signals_over_the_sum_of_exposures() -> None:
    """Against a plain loop, with saturated, dark and hopeless pixels."""
    rng = np.random.default_rng(2)
    exposures = (0.25, 1.0, 4.0)
    shots = [
        Shot(
            rng.random((5, 6, 3), dtype=np.float32),
            rng.random((5, 6, 3)) < 0.25,
            rng.random((5, 6, 3)) < 0.3,
            e,
        )
        for e in exposures
    ]
    found = merge(shots)
    for y, x in np.ndindex(5, 6):
        whole = [s for s in shots if not s.clipped[y, x].any()]
        assert found.missing[y, x] == (not whole)
        for c in range(3):
            if not whole:
                assert found.radiance[y, x, c] == 0
                assert found.least[y, x, c] == pytest.approx(shots[0].linear[y, x, c] / 0.25)
                continue
            good = [s for s in whole if not s.dark[y, x, c]] or whole[-1:]
            expected = sum(s.linear[y, x, c] for s in good) / sum(s.exposure for s in good)
            assert found.radiance[y, x, c] == pytest.approx(expected, rel=1e-5)


def test_a_wrong_exposure_is_warned_of(tmp_path: Path) -> None:
    files = write_bracket(tmp_path / "in", scene(), 2.2)
    table = tmp_path / "in/a.csv"
    table.write_text(table.read_text(encoding="utf-8").replace("1/50", "1/100"), encoding="utf-8")
    options = LinearizeOptions(per_view=4, response="gamma:2.2", exposures=table)
    with pytest.warns(CaptureWarning) as seen:
        linearize(files, tmp_path, options)
    said = [str(warning.message) for warning in seen]
    assert len(said) == 2 and "a2.png is 2.0" in said[0] and "that of a1.png" in said[0]
    assert "a3.png is 0.5" in said[1]


def test_exposures_come_from_exif_unless_a_table_says_otherwise(tmp_path: Path) -> None:
    files = write_bracket(tmp_path / "in", scene(), 2.2, "jpg")
    found = exposures_of(files)
    assert [found[f].time_s for f in files] == pytest.approx(TIMES) and found[files[0]].aperture == 8
    table = tmp_path / "t.csv"
    table.write_text("file,time\n" + "".join(f"{f.name},0.5\n" for f in files), encoding="utf-8")
    found = exposures_of(files, table)
    assert {e.time_s for e in found.values()} == {0.5} and {e.iso for e in found.values()} == {100}


def test_groups_name_views(tmp_path: Path) -> None:
    files = [tmp_path / f"{i}.png" for i in range(3)]
    groups = tmp_path / "g.json"
    groups.write_text('{"front": ["2.png", "0.png"], "back": ["1.png"]}', encoding="utf-8")
    assert views_of(files, groups=groups) == {"front": (files[2], files[0]), "back": (files[1],)}
    assert views_of(files, 3) == {"0": tuple(files)}


def test_real_brackets_agree_and_tell_wrong_exif(shared: Path, tmp_path: Path) -> None:
    files = sorted((shared / "data/captures/mirror_ball").glob("Angel1*.jpg"))
    with pytest.raises(InputError, match="all 8 photographs have the same exposure"):
        linearize(files, tmp_path, LinearizeOptions(per_view=8))
    table = tmp_path / "t.csv"
    times = ("1/80", "1/40", "1/20", "1/10", "1/5", "1/2", "0.77", "1.6")
    rows = [f"{file.name},{time}" for file, time in zip(files, times, strict=True)]
    table.write_text("\n".join(["file,time", *rows]), encoding="utf-8")
    # The sixth photograph is as bright as 0.4 s, not as the 1/2 s that its source says.
    with pytest.warns(CaptureWarning, match="is one of them wrong"):
        view = linearize(files, tmp_path, LinearizeOptions(per_view=8, exposures=table)).views[0]
    # 8-bit JPEG at 493 px, and the sixth exposure 20 % off: 14 % measured.
    assert view.residual is not None and view.residual < 0.16
    assert np.median(view.steps) == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "no such file or folder"),
        (["EMPTY"], "there are no photographs"),
        (["IN"], "the response cannot be recovered from single photographs"),
        (["IN", "--per-view", "3"], "4 photographs cannot be 3 to a view"),
        (["IN", "--per-view", "0"], "--per-view is 0"),
        (["IN", "--response", "gamma:x"], "the response is 'gamma:x'"),
        (["IN", "--response", "none.json"], "none.json: no such file"),
        (["IN", "--response", "BAD"], "holds no response"),
        (["IN", "--exposures", "BAD"], 'bad.json: "a0.jpg" is not in it'),
        (["IN", "--exposures", "NEGATIVE"], "time of \"a0.jpg\" is '-1'"),
        (["IN", "--exposures", "HEADLESS"], "has the columns a, b"),
        (["IN", "--groups", "BAD"], "is not an object"),
        (["IN", "--groups", "TWICE"], '"a0.jpg" is there twice'),
        (["IN", "--groups", "FEW"], "is in no view"),
        (["IN", "--groups", "STRANGE"], '"z.jpg" is none of the photographs'),
        (["IN", "--groups", "CLIMBS"], "names a view"),
        (["IN", "--white-balance", "1,2"], "--white-balance is '1,2'"),
        (["IN", "--white-balance", "auto"], "R,G,B such as 2.1,1,1.4, or a linearize.json"),
        (["IN", "--white-balance", "none.json"], "none.json: no such file"),
        (["IN", "--white-balance", "BAD"], "holds no white balance"),
        (["IN", "--white-balance", "GREENLESS"], "the white balance is (1.0, 0.0, 2.0)"),
        (["IN", "--reference", "1/0,100,8"], "--reference is '1/0,100,8'"),
        (["PLAIN", "--response", "srgb"], "its EXIF does not say time or iso or aperture"),
        (["IN", "RAW"], "both RAW"),
        (["TRUNCATED"], "cannot be read as RAW"),
        (["TEXT"], "unknown image type '.txt'"),
        (
            ["IN", "ODD", "--response", "srgb", "--groups", "PAIR"],
            "64 x 48 pixels; expected 128 x 96 as a0.jpg",
        ),
        (["CUT", "--response", "srgb"], "cannot be read as an image"),
        (["SAME", "--per-view", "2"], "all 2 photographs have the same exposure (0.005 s, ISO 100, f/8)"),
    ],
)
def test_what_is_wrong_is_said(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = _bad_inputs(tmp_path)
    out = tmp_path / "made" / "out"
    given = [str(names.get(a, a)) for a in arguments]
    assert main(["prepare", "linearize", *given, "-o", str(out)]) == 2
    message = capsys.readouterr().err
    assert said in message, message
    assert not out.exists() and not list(tmp_path.glob("made/.*"))


def _bad_inputs(at: Path) -> dict[str, Path]:
    """One of each thing that can be wrong, by name."""
    folder = at / "in"
    files = write_bracket(folder, scene(), 2.2, "jpg")
    (folder / "a.csv").unlink()
    raw = at / "r.dng"
    write_dng(raw, mosaic_of(patches((0.2, 0.2, 0.2))))
    (at / "cut.dng").write_bytes(raw.read_bytes()[:300])
    (at / "cut").mkdir()
    # The first photograph of two is whole: nothing of it may be left.
    (at / "cut/a.jpg").write_bytes(files[0].read_bytes())
    (at / "cut/b.jpg").write_bytes(files[1].read_bytes()[:3000])
    (at / "empty").mkdir()
    (at / "same").mkdir()
    for name in ("a.jpg", "b.jpg"):
        (at / "same" / name).write_bytes(files[1].read_bytes())
    Pillow.new("RGB", (64, 48)).save(at / "plain.png")
    exif = Pillow.Exif()
    exif.get_ifd(0x8769).update({33434: 0.3, 33437: 8.0, 34855: 100})
    Pillow.new("RGB", (64, 48)).save(at / "odd.jpg", exif=exif)
    texts = {
        "bad.json": "{}",
        "negative.json": json.dumps({f.name: {"time": "-1"} for f in files}),
        "headless.csv": "a,b\n1,2\n",
        "twice.json": '{"v": ["a0.jpg", "a0.jpg"]}',
        "few.json": '{"v": ["a0.jpg"]}',
        "strange.json": '{"v": ["z.jpg"]}',
        "greenless.json": '{"raw": {"white_balance": [1, 0, 2]}}',
        "climbs.json": '{"../v": ["a0.jpg"]}',
        "pair.json": '{"v": ["a0.jpg", "a1.jpg", "a2.jpg", "a3.jpg", "odd.jpg"]}',
        "notes.txt": "none",
    }
    for name, text in texts.items():
        (at / name).write_text(text, encoding="utf-8")
    named = {"EMPTY": "empty", "IN": "in", "PLAIN": "plain.png", "RAW": "r.dng", "TRUNCATED": "cut.dng"}
    named |= {"TEXT": "notes.txt", "ODD": "odd.jpg", "CUT": "cut", "SAME": "same", "HEADLESS": "headless.csv"}
    named |= {
        key.upper(): f"{key}.json"
        for key in ("bad", "negative", "twice", "few", "strange", "climbs", "pair", "greenless")
    }
    return {key: at / name for key, name in named.items()}


def test_without_rawpy_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "a.dng"
    write_dng(file, mosaic_of(patches((0.2, 0.2, 0.2))))
    monkeypatch.setitem(sys.modules, "rawpy", None)
    assert main(["prepare", "linearize", str(file), "-o", str(tmp_path / "out")]) == 2
    assert "pip install swatchwork[raw]" in capsys.readouterr().err


def test_a_camera_without_a_matrix_keeps_its_own_primaries(tmp_path: Path) -> None:
    file = tmp_path / "a.dng"
    write_dng(file, mosaic_of(patches((0.2, 0.3, 0.4))), matrix=np.zeros((3, 3)))
    with pytest.raises(InputError, match="no colour matrix"):
        develop(file, (1, 1, 1))
    np.testing.assert_allclose(develop(file, (1, 1, 1), "camera").linear[24, 24], (0.2, 0.3, 0.4), atol=1e-4)


def test_given_responses() -> None:
    assert given_response("srgb").lookup(255)[128, 0] == pytest.approx(0.2158, abs=1e-3)
    assert given_response("gamma:2").lookup(65535)[32768, 1] == pytest.approx(0.25, abs=1e-4)


def test_a_response_that_falls_is_refused() -> None:
    radiance = scene()
    pictures = [coded(radiance * t * 100, 2.2) for t in TIMES]
    with pytest.raises(InputError, match="falls by"):
        recover_response([(pictures, [1.0, 0.1, 2.0, 0.05])])

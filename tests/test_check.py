# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Checking a capture: nothing is wrong with a clean one; then it is spoilt in one way at a time."""

from __future__ import annotations

import json
import shutil
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swatchwork.capture import (
    Camera,
    EnvironmentSource,
    read_capture,
    read_exr_channels,
    read_image,
    write_exr,
)
from swatchwork.cli import main
from swatchwork.errors import CaptureWarning, InputError, OutputError
from swatchwork.light import Environment
from swatchwork.simulate import look_at, procedural_environment, shape, simulate_capture
from swatchwork.surface import Mesh, RayScene, sky_of_points, surface_points, write_mesh_obj
from swatchwork.workflow import CheckSummary, check_capture
from swatchwork.workflow.check_light import balls, exposures, irradiance
from swatchwork.workflow.check_shapes import axis_moves

K = 8


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A knot: its mirror image and its other views have other silhouettes."""
    folder = tmp_path_factory.mktemp("check") / "clean"
    simulate_capture(folder, object_shape="knot", rows=24, k=K, test_views=1, size=72)
    return folder


@pytest.fixture
def spoilt(clean: Path, tmp_path: Path) -> Path:
    shutil.copytree(clean, tmp_path / "capture")
    return tmp_path / "capture"


def changed(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    file = folder / "transforms.json"
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))


def found(folder: Path) -> CheckSummary:
    with warnings.catch_warnings():
        # A mirrored mesh is turned over by the reader, which says so.
        warnings.simplefilter("ignore", CaptureWarning)
        return check_capture(folder, folder.parent / "check.html")


def remeshed(folder: Path, change: Callable[[Mesh], Mesh]) -> None:
    write_mesh_obj(folder / "mesh.obj", change(shape("knot", 24)))


def test_nothing_is_wrong_with_a_clean_capture(clean: Path, tmp_path: Path) -> None:
    summary = check_capture(clean, tmp_path / "check.html")
    assert summary.findings == ()
    assert summary.in_words().startswith("Nothing looks wrong with ")
    # Silhouettes of 72 px images agree to a quarter of a pixel along the border.
    assert all(f.iou is not None and f.iou > 0.97 for f in summary.frames)
    # Gloss moves a frame's median by several per cent; a wrong exposure is a matter of 25.
    assert all(f.exposure is not None and abs(np.log(f.exposure)) < np.log(1.15) for f in summary.frames)
    assert summary.albedo is not None and 0.1 < summary.albedo < 0.8
    assert sum(summary.coverage) == pytest.approx(1)
    page = (tmp_path / "check.html").read_text()
    assert "Nothing looks wrong" in page and page.count("data:image/png") == K + 3 + 2
    assert "http" not in page.split("</style>")[1]


def test_swapped_photographs_are_named(spoilt: Path) -> None:
    one, other = spoilt / "images/0002.exr", spoilt / "images/0005.exr"
    one.rename(spoilt / "x.exr")
    other.rename(one)
    (spoilt / "x.exr").rename(other)
    findings = found(spoilt).findings
    assert [(f.kind, f.frames) for f in findings] == [
        ("swapped photographs", ("images/0002.exr", "images/0005.exr"))
    ]
    assert findings[0].title == "images/0002.exr and images/0005.exr are swapped"


@pytest.mark.parametrize(("factor", "words"), [(1000.0, "times 0.001"), (0.001, "times 1000")])
def test_units_are_told(factor: float, words: str, spoilt: Path) -> None:
    remeshed(spoilt, lambda mesh: replace(mesh, vertices=mesh.vertices * factor))
    findings = found(spoilt).findings
    assert [f.kind for f in findings] == ["units"]
    assert words in findings[0].text and ("too large" if factor > 1 else "too small") in findings[0].text


def test_a_mirrored_mesh_is_told(spoilt: Path) -> None:
    def mirrored(mesh: Mesh) -> Mesh:
        flip = np.array([-1.0, 1, 1])
        return replace(
            mesh, vertices=mesh.vertices * flip, normals=mesh.normals * flip, faces=mesh.faces[:, ::-1]
        )

    remeshed(spoilt, mirrored)
    findings = found(spoilt).findings
    assert [f.kind for f in findings] == ["mirrored mesh"]
    assert "with (x, y, z) -> (" in findings[0].text


def test_a_mesh_with_y_up_is_told(spoilt: Path) -> None:
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    remeshed(
        spoilt, lambda mesh: replace(mesh, vertices=mesh.vertices @ turn.T, normals=mesh.normals @ turn.T)
    )
    findings = found(spoilt).findings
    assert [f.kind for f in findings] == ["turned mesh"]
    # Half a turn about x takes the knot to itself.
    assert any(f"(x, y, z) -> {found}" in findings[0].text for found in ("(x, -z, y)", "(x, z, -y)"))


def test_a_frame_of_double_exposure_is_named(spoilt: Path) -> None:
    changed(spoilt, lambda d: d["frames"][3].update(exposure=0.5))
    findings = found(spoilt).findings
    assert [(f.kind, f.frames) for f in findings] == [("exposure of a frame", ("images/0004.exr",))]
    factor = float(findings[0].title.split(" is ")[1].split()[0])
    # Gloss again.
    assert factor == pytest.approx(2, rel=0.15)


def test_two_photographs_that_differ_are_both_named(spoilt: Path) -> None:
    changed(spoilt, lambda d: d.update(frames=[d["frames"][0], d["frames"][0] | {"exposure": 0.5}]))
    shutil.copyfile(spoilt / "images/0001.exr", spoilt / "images/copy.exr")
    changed(spoilt, lambda d: d["frames"][1].update(file_path="images/copy.exr"))
    findings = [f for f in found(spoilt).findings if f.level != "note"]
    assert [f.title for f in findings] == [
        "images/0001.exr and images/copy.exr differ in exposure by a factor of 2.00"
    ]


def test_a_shifted_pose_is_named_with_where_the_object_is(spoilt: Path) -> None:
    def shift(document: dict[str, Any]) -> None:
        pose = np.array(document["frames"][6]["transform_matrix"])
        pose[:3, 3] += 0.25 * pose[:3, 0]
        document["frames"][6]["transform_matrix"] = pose.tolist()

    changed(spoilt, shift)
    findings = found(spoilt).findings
    assert [(f.kind, f.frames) for f in findings] == [("pose", ("images/0007.exr",))]
    # The camera went right by 0.25 at a distance of 4 radii: the photograph's object is right of the mesh.
    camera = read_capture(spoilt).frames[6].camera
    expected = 0.25 * camera.fx / np.linalg.norm(camera.position)
    assert f"lies {expected:.0f} px right" in findings[0].text


@pytest.mark.parametrize(("factor", "word"), [(100.0, "too bright"), (0.01, "too dark")])
def test_a_probe_of_another_exposure_is_told(factor: float, word: str, spoilt: Path) -> None:
    channels = read_exr_channels(spoilt / "env.exr")
    rgb = np.stack([channels[c] for c in "RGB"], axis=-1)
    write_exr(spoilt / "env.exr", (rgb / factor).astype(np.float32))
    findings = found(spoilt).findings
    assert [f.kind for f in findings] == ["exposure of the probe"]
    assert f"The photographs are {word} for the probe" in findings[0].text


def test_a_camera_that_looks_away_is_named(spoilt: Path) -> None:
    def turn(document: dict[str, Any]) -> None:
        pose = np.array(document["frames"][1]["transform_matrix"])
        pose[:3, 0] *= -1
        pose[:3, 2] *= -1
        document["frames"][1]["transform_matrix"] = pose.tolist()

    changed(spoilt, turn)
    findings = found(spoilt).findings
    assert len(findings) == 1 and findings[0].frames == ("images/0002.exr",)


def test_without_alpha_or_masks_silhouettes_are_not_judged(spoilt: Path) -> None:
    for file in sorted((spoilt / "images").glob("*.exr")):
        image = read_image(file)
        write_exr(file, image.linear + 0.05)
    summary = found(spoilt)
    assert [(f.kind, f.level) for f in summary.findings] == [("silhouettes", "note")]
    assert all(f.iou is None for f in summary.frames)


def test_little_coverage_is_noted(spoilt: Path) -> None:
    changed(spoilt, lambda d: d.update(frames=d["frames"][:1]))
    summary = found(spoilt)
    assert [(f.kind, f.level) for f in summary.findings] == [("coverage", "note")]
    assert summary.coverage[2] == 0


# --- The parts ---------------------------------------------------------------------------------------------


def test_exposures_of_a_matte_object_are_exact() -> None:
    rng = np.random.default_rng(1)
    white = rng.uniform(0.5, 2, (6, 200))
    factor = np.array([1.0, 1.0, 2.0, 1.0, 0.5, 1.0])
    radiance = factor[:, None] * white * rng.uniform(0.1, 0.9, 200)
    radiance[rng.random(radiance.shape) < 0.4] = np.nan
    np.testing.assert_allclose(exposures(radiance, white).factor, factor, rtol=1e-6)
    alone = exposures(radiance[:1], white[:1])
    assert np.isnan(alone.factor).all() and alone.albedo is not None
    empty = exposures(np.full((2, 50), np.nan), white[:2, :50])
    assert empty.albedo is None and np.isnan(empty.factor).all()


def test_gloss_is_no_exposure() -> None:
    rng = np.random.default_rng(2)
    white, mirrored = rng.uniform(0.5, 2, (6, 300)), rng.uniform(0, 1, (6, 300))
    # One frame sees the lamps in the object.
    mirrored[2] += 5
    radiance = rng.uniform(0.1, 0.9, 300) * (white + 0.3 * mirrored)
    assert exposures(radiance, white).factor[2] > 1.5
    np.testing.assert_allclose(exposures(radiance, white, [mirrored]).factor, 1, rtol=1e-6)
    radiance[4] *= 2
    both = exposures(radiance, white, [mirrored])
    np.testing.assert_allclose(both.factor, [1, 1, 1, 1, 2, 1], rtol=1e-6)
    assert both.sure.tolist() == [False] * 4 + [True, False]


def test_irradiance_in_constant_light_is_pi_times_the_open_sky() -> None:
    mesh = shape("sphere", 24)
    scene, points = RayScene([mesh]), surface_points(mesh, 200)
    light = Environment(np.ones((8, 16, 3), np.float32), "mitsuba")
    # A convex object sees its whole horizon; cells that the horizon cuts leave about 1 %.
    np.testing.assert_allclose(irradiance(light, points, sky_of_points(scene, points)), np.pi, rtol=0.02)


def test_the_mirror_ball_shows_what_it_reflects(tmp_path: Path) -> None:
    light = procedural_environment("room", 0, height=32)
    pose = look_at([0.0, -4.0, 0.0])
    camera = Camera(8, 8, 8.0, 8.0, 4.0, 4.0, pose)
    mirror, grey, alpha = balls(light, camera, 65)
    # Its middle reflects what is behind the camera; halfway to the rim (sine 1 / sqrt 2), what is beside it.
    np.testing.assert_allclose(mirror[32, 32], light.lookup(np.array([0.0, -1, 0])), rtol=1e-5)
    right = 32 + round(32.5 * np.sqrt(0.5))
    x = (right + 0.5) / 32.5 - 1
    expected = light.lookup(np.array([2 * x * np.sqrt(1 - x * x), -(1 - 2 * x * x), 0.0]))
    np.testing.assert_allclose(mirror[32, right], expected, rtol=1e-4)
    assert alpha[0, 0] == 0 and alpha[32, 32] == 1 and (grey[32, 32] > 0).all()
    even = Environment(np.ones((8, 16, 3), np.float32), "mitsuba")
    # Half of the light, to what cells of 13 degrees make of a cosine.
    np.testing.assert_allclose(balls(even, camera, 65)[1][32, 10:55], 0.5, rtol=0.02)


def test_axis_moves_are_all_turns_and_mirrors_but_none() -> None:
    moves = axis_moves(np.zeros(3))
    assert len(moves) == 2 * 47 and sum(m.mirrors for m in moves) == 2 * 24
    assert all(np.allclose(m.linear @ m.linear.T, np.eye(3)) for m in moves)


# --- The command -------------------------------------------------------------------------------------------


def test_command_line(clean: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page/check.html"
    assert main(["check", str(clean), "-o", str(page), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["findings"] == [] and len(summary["frames"]) == K and page.is_file()


def test_findings_are_no_failure(spoilt: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changed(spoilt, lambda d: d["frames"][3].update(exposure=0.5))
    assert main(["check", str(spoilt), "-o", str(tmp_path / "check.html")]) == 0
    said = capsys.readouterr().out
    # Beside the usual ones, the frame and another at one exposure.
    assert (tmp_path / "check.html").read_text().count("data:image/png") == K + 3 + 2 + 2
    assert said.startswith("1. images/0004.exr is ") and "What to do: " in said


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: (f / "mesh.obj").unlink(), "mesh.obj"),
        (lambda f: (f / "images/0003.exr").write_bytes(b"short"), "0003.exr"),
        (lambda f: (f / "transforms.json").write_text("{"), "is not JSON"),
        (lambda f: (f / "env.exr").write_bytes(b""), "env.exr"),
    ],
)
def test_unreadable_captures_exit_with_2_and_leave_no_page(
    spoil: Callable[[Path], object], message: str, spoilt: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil(spoilt)
    page = spoilt.parent / "check.html"
    assert main(["check", str(spoilt), "-o", str(page)]) == 2
    assert message in capsys.readouterr().err
    assert not page.exists()


def test_a_page_that_cannot_be_written_is_told(clean: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        check_capture(clean, tmp_path / "file/check.html")


def test_a_capture_without_light_is_refused(spoilt: Path) -> None:
    changed(spoilt, lambda d: d.pop("environment"))
    with pytest.raises(InputError, match='"environment"'):
        check_capture(spoilt, spoilt.parent / "check.html")


def test_each_frame_may_have_a_light_of_its_own(spoilt: Path) -> None:
    source = read_capture(spoilt).environment
    assert isinstance(source, EnvironmentSource)
    changed(spoilt, lambda d: [f.update(environment=d["environment"]) for f in d["frames"]])
    assert found(spoilt).findings == ()

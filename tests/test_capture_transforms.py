# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Reading and writing captures: one valid capture, then one wrong thing at a time."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from swatchwork.capture import read_capture, read_photograph, write_capture, write_exr
from swatchwork.errors import InputError, OutputError

Change = Callable[[dict[str, Any]], Any]
POSE = [[1.0, 0, 0, 0], [0, 0, -1.0, -3], [0, 1.0, 0, 0.5], [0, 0, 0, 1.0]]
TURN = [[0.0, 0, 1, 0], [0, 1.0, 0, 0], [-1.0, 0, 0, 0], [0, 0, 0, 1.0]]


def document() -> dict[str, Any]:
    return {
        "mesh": "mesh.obj",
        "environment": {"file": "env.exr", "convention": "blender", "transform_matrix": TURN},
        "occluders": ["table.ply"],
        "fl_x": 20.0,
        "fl_y": 21.0,
        "cx": 4.5,
        "cy": 3.0,
        "w": 8,
        "h": 6,
        "k1": -0.1,
        "frames": [
            {
                "file_path": "images/0.exr",
                "transform_matrix": POSE,
                "mask_path": "images/m.png",
                "exposure": 2.0,
            },
            {
                "file_path": "images/1.exr",
                "transform_matrix": POSE,
                "fl_x": 30.0,
                "environment": {"file": "env.exr", "convention": "mitsuba"},
            },
        ],
    }


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    root = tmp_path / "capture"
    (root / "images").mkdir(parents=True)
    (root / "mesh.obj").write_text("v 0 0 0\n")
    (root / "table.ply").write_text("ply\n")
    write_exr(root / "env.exr", np.ones((4, 8, 3)))
    for name in "01":
        write_exr(root / f"images/{name}.exr", np.full((6, 8, 4), 0.5))
    mask = np.zeros((6, 8), np.uint8)
    mask[2:4, 2:4] = 255
    cv2.imwrite(str(root / "images/m.png"), mask)
    (root / "transforms.json").write_text(json.dumps(document()))
    return root


def changed(root: Path, change: Change) -> None:
    contents = document()
    change(contents)
    (root / "transforms.json").write_text(json.dumps(contents))


def test_reads_everything(folder: Path) -> None:
    for given in (folder, folder / "transforms.json", str(folder)):
        capture = read_capture(given)
        assert capture.root == folder and capture.file == folder / "transforms.json"
    assert capture.mesh_path == folder / "mesh.obj" and capture.occluder_paths == (folder / "table.ply",)
    assert capture.environment is not None and capture.environment.convention == "blender"
    np.testing.assert_array_equal(capture.environment.world_from_environment, np.array(TURN)[:3, :3])
    first, second = capture.frames
    assert (first.name, first.exposure, first.mask_path) == ("images/0.exr", 2.0, folder / "images/m.png")
    assert first.environment is capture.environment
    assert second.environment is not None and second.environment.convention == "mitsuba"
    assert (first.camera.fx, second.camera.fx, second.camera.fy) == (20, 30, 21)
    assert (second.camera.k1, second.camera.cx, second.camera.width) == (-0.1, 4.5, 8)
    np.testing.assert_array_equal(first.camera.position, [0, -3, 0.5])
    assert (second.exposure, second.mask_path) == (1.0, None)


def test_photographs_are_divided_by_exposure_and_masked(folder: Path) -> None:
    capture = read_capture(folder)
    photograph = read_photograph(capture.frames[0])
    np.testing.assert_array_equal(photograph.radiance, np.full((6, 8, 3), 0.25))
    np.testing.assert_array_equal(photograph.alpha, np.full((6, 8), 0.5))
    assert photograph.valid.sum() == 4 and photograph.valid[2:4, 2:4].all()
    assert read_photograph(capture.frames[1]).valid.all()


def test_clipped_pixels_of_a_png_are_missing(folder: Path) -> None:
    coded = np.full((6, 8, 3), 128, np.uint8)
    coded[1, 2, 0] = 255
    cv2.imwrite(str(folder / "images/0.png"), coded)
    changed(folder, lambda t: t["frames"][0].update(file_path="images/0.png", mask_path=None))
    photograph = read_photograph(read_capture(folder).frames[0])
    assert np.argwhere(~photograph.valid).tolist() == [[1, 2]]
    assert (photograph.alpha == 1).all()


def test_nerf_blender_layout(folder: Path) -> None:
    cv2.imwrite(str(folder / "images/r_0.png"), np.full((6, 8, 4), 100, np.uint8))

    def blender(t: dict[str, Any]) -> None:
        for key in ("fl_x", "fl_y", "cx", "cy", "w", "h", "k1"):
            del t[key]
        t["camera_angle_x"] = 0.8
        t["frames"] = [{"file_path": "./images/r_0", "rotation": 0.01, "transform_matrix": POSE}]

    changed(folder, blender)
    frame = read_capture(folder).frames[0]
    assert (frame.name, frame.image_path) == ("./images/r_0", folder / "images/r_0.png")
    assert (frame.camera.width, frame.camera.height, frame.camera.cx, frame.camera.cy) == (8, 6, 4, 3)
    assert frame.camera.fx == frame.camera.fy == pytest.approx(4 / math.tan(0.4))
    write_capture(read_capture(folder), folder)
    assert read_capture(folder).frames[0].name == "./images/r_0"


def test_cameras_alone_need_no_other_file(tmp_path: Path) -> None:
    contents = {
        key: value for key, value in document().items() if key not in ("mesh", "environment", "occluders")
    }
    (tmp_path / "transforms.json").write_text(json.dumps(contents))
    capture = read_capture(tmp_path, require_images=False)
    assert (capture.mesh_path, capture.environment, capture.occluder_paths) == (None, None, ())
    assert len(capture.frames) == 2 and capture.frames[0].environment is None


def test_a_test_set_may_share_the_mesh_one_folder_up(folder: Path) -> None:
    (folder / "test").mkdir()
    write_exr(folder / "test/0.exr", np.zeros((6, 8, 3)))

    def shared(t: dict[str, Any]) -> None:
        t.update(mesh="../mesh.obj", occluders=["../table.ply"])
        t["environment"]["file"] = "../env.exr"
        t["frames"] = [{"file_path": "0.exr", "transform_matrix": POSE}]

    contents = document()
    shared(contents)
    (folder / "test/transforms.json").write_text(json.dumps(contents))
    capture = read_capture(folder / "test")
    assert capture.mesh_path is not None and capture.mesh_path.samefile(folder / "mesh.obj")


def test_writing_and_reading_give_the_same_capture(folder: Path) -> None:
    before = read_capture(folder)
    (folder / "transforms.json").unlink()
    assert write_capture(before, folder) == folder / "transforms.json"
    after = read_capture(folder)
    assert (before.mesh_path, before.occluder_paths) == (after.mesh_path, after.occluder_paths)
    assert len(before.frames) == len(after.frames)
    for a, b in zip(before.frames, after.frames, strict=True):
        assert (a.name, a.image_path, a.mask_path, a.exposure) == (
            b.name,
            b.image_path,
            b.mask_path,
            b.exposure,
        )
        for name in ("width", "height", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"):
            assert getattr(a.camera, name) == getattr(b.camera, name)
        np.testing.assert_array_equal(a.camera.world_from_camera, b.camera.world_from_camera)
        assert a.environment is not None and b.environment is not None
        assert (a.environment.file, a.environment.convention) == (
            b.environment.file,
            b.environment.convention,
        )
        np.testing.assert_array_equal(
            a.environment.world_from_environment, b.environment.world_from_environment
        )
    assert [path.name for path in folder.glob("*.partial")] == []


def test_writing_refuses_files_elsewhere(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"outside the capture folder; .* Copy the file"):
        write_capture(read_capture(folder), tmp_path / "other" / "deep")
    assert not (tmp_path / "other").exists()


def test_a_failed_write_leaves_nothing_behind(folder: Path) -> None:
    capture = read_capture(folder)
    (folder / "transforms.json").unlink()
    (folder / "transforms.json").mkdir()
    with pytest.raises(OutputError, match="cannot be written"):
        write_capture(capture, folder)
    assert list(folder.glob("*.partial")) == []


def test_first_frames(folder: Path) -> None:
    capture = read_capture(folder)
    assert [frame.name for frame in capture.first(1).frames] == ["images/0.exr"]
    for k in (0, -1, 3):
        with pytest.raises(InputError, match=rf"transforms\.json: {k} frames asked for; expected 1 to the 2"):
            capture.first(k)


def with_frame(**values: Any) -> Change:
    return lambda t: t["frames"][0].update(values)


def without(key: str) -> Change:
    return lambda t: t.pop(key)


def with_environment(**values: Any) -> Change:
    return lambda t: t["environment"].update(values)


def pose_with(row: int, column: int, value: Any) -> Change:
    def change(t: dict[str, Any]) -> None:
        matrix = [list(r) for r in POSE]
        matrix[row][column] = value
        t["frames"][0]["transform_matrix"] = matrix

    return change


FRAME = "transforms.json (frame 0, images/0.exr)"
BAD = {
    "no mesh": (without("mesh"), 'transforms.json: key "mesh" is missing'),
    "no frames key": (without("frames"), 'key "frames" is missing'),
    "k = 0": (lambda t: t.update(frames=[]), '"frames" is empty; expected at least one frame'),
    "frames of wrong type": (lambda t: t.update(frames={"0": 1}), "\"frames\" is {'0': 1}; expected a list"),
    "frame of wrong type": (lambda t: t.update(frames=[7]), "(frame 0): found 7; expected a JSON object"),
    "another version": (lambda t: t.update(format_version=2), '"format_version" is 2; expected 1'),
    "same image twice": (
        lambda t: t.update(frames=t["frames"][:1] * 2),
        "(frame 1): \"file_path\" 'images/0.exr' occurs",
    ),
    "no image path": (lambda t: t["frames"][0].pop("file_path"), '(frame 0): key "file_path" is missing'),
    "image path of wrong type": (with_frame(file_path=3), '"file_path" is 3; expected a string'),
    "no such image": (with_frame(file_path="images/9.exr"), "there is no "),
    "no such image, without suffix": (with_frame(file_path="images/9"), "images/9.png; expected an image"),
    "no such mask": (with_frame(mask_path="m.png"), FRAME + ": \"mask_path\" is 'm.png', and there is no"),
    "no such mesh": (lambda t: t.update(mesh="a.obj"), "\"mesh\" is 'a.obj', and there is no"),
    "no such occluder": (
        lambda t: t.update(occluders=["a.ply"]),
        "\"occluders\" is 'a.ply', and there is no",
    ),
    "occluders of wrong type": (lambda t: t.update(occluders=[1]), "expected a list of mesh files"),
    "no such environment": (
        with_environment(file="a.exr"),
        "(environment): \"file\" is 'a.exr', and there is no",
    ),
    "no environment": (without("environment"), FRAME + ': key "environment" is missing'),
    "unknown convention": (
        with_environment(convention="maya"),
        "\"convention\" is 'maya'; expected one of blender, mitsuba, debevec-angular",
    ),
    "no convention": (
        lambda t: t["environment"].pop("convention"),
        'key "convention" is missing; expected one of',
    ),
    "environment of wrong type": (
        lambda t: t.update(environment="env.exr"),
        "(environment): found 'env.exr'",
    ),
    "environment scaled": (
        with_environment(transform_matrix=(np.eye(4) * 2).tolist()),
        '(environment): "transform_',
    ),
    "no pose": (
        lambda t: t["frames"][0].pop("transform_matrix"),
        FRAME + ': key "transform_matrix" is missing',
    ),
    "pose of words": (with_frame(transform_matrix="none"), "expected 4 rows of 4 numbers"),
    "ragged pose": (with_frame(transform_matrix=[[1, 0], [1]]), "expected 4 rows of 4 numbers"),
    "scaled pose": (
        with_frame(transform_matrix=(np.array(POSE) * [[2], [2], [2], [1]]).tolist()),
        FRAME + ': "tran',
    ),
    "mirrored pose": (
        with_frame(transform_matrix=(np.array(POSE) * [-1, 1, 1, 1]).tolist()),
        '"transform_matrix" is mirrored (determinant -1); expected a rotation (determinant +1). Camera axes',
    ),
    "NaN in pose": (pose_with(0, 3, math.nan), '"transform_matrix" contains nan; expected finite numbers'),
    "infinite pose": (pose_with(1, 1, math.inf), '"transform_matrix" contains inf'),
    "projective pose": (pose_with(3, 2, 1.0), "last row [0.0, 0.0, 1.0, 1.0]; expected [0, 0, 0, 1]"),
    "zero focal length": (with_frame(fl_x=0), FRAME + ': "fl_x" is 0; expected a positive number'),
    "negative focal length": (with_frame(fl_y=-20.0), '"fl_y" is -20.0; expected a positive number'),
    "NaN focal length": (with_frame(fl_x=math.nan), '"fl_x" is nan; expected a positive number'),
    "focal length of words": (with_frame(fl_x="long"), "\"fl_x\" is 'long'; expected a positive number"),
    "boolean focal length": (with_frame(fl_x=True), '"fl_x" is True; expected a positive number'),
    "no focal length": (
        without("fl_x"),
        'keys "fl_x" and "camera_angle_x" are missing; expected one of the two',
    ),
    "angle too wide": (with_frame(camera_angle_x=3.2), '"camera_angle_x" is 3.2; expected radians below pi'),
    "number beyond all bounds": (with_frame(cx=10**400), "expected a finite number"),
    "zero exposure": (with_frame(exposure=0), FRAME + ': "exposure" is 0; expected a positive number'),
    "negative exposure": (with_frame(exposure=-1), '"exposure" is -1; expected a positive number'),
    "fraction of a pixel": (with_frame(w=8.5), '"w" is 8.5; expected a whole number of pixels'),
    "size disagrees": (
        with_frame(w=9),
        "images/0.exr (frame images/0.exr): the image is 8 x 6; expected 9 x 6, the w",
    ),
    "fisheye": (
        with_frame(camera_model="OPENCV_FISHEYE"),
        "\"camera_model\" is 'OPENCV_FISHEYE'; expected one of PIN",
    ),
    "fisheye flag": (with_frame(is_fisheye=True), '"is_fisheye" is true; expected one of PINHOLE'),
    "higher distortion": (with_frame(k3=0.1), '"k3" is 0.1; expected 0: the lens model has k1, k2, p1, p2'),
    "absolute image": (
        with_frame(file_path="/etc/passwd"),
        "\"file_path\" is '/etc/passwd', outside the capture folder",
    ),
    "image above": (
        with_frame(file_path="../0.exr"),
        "\"file_path\" is '../0.exr', outside the capture folder",
    ),
    "image above, hidden": (
        with_frame(file_path="images/../../0.exr"),
        "outside the capture folder; expected a relative",
    ),
    "image above, backslashes": (with_frame(file_path="..\\0.exr"), "outside the capture folder"),
    "mask above": (
        with_frame(mask_path="../m.png"),
        "\"mask_path\" is '../m.png', outside the capture folder",
    ),
    "absolute mesh": (
        lambda t: t.update(mesh="/mesh.obj"),
        "\"mesh\" is '/mesh.obj', outside the capture folder",
    ),
    "mesh two above": (lambda t: t.update(mesh="../../mesh.obj"), "inside "),
    "absolute occluder": (
        lambda t: t.update(occluders=["/t.ply"]),
        "\"occluders\" is '/t.ply', outside the capture",
    ),
    "environment two above": (
        with_environment(file="../../env.exr"),
        "\"file\" is '../../env.exr', outside the capture",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_refuses(folder: Path, case: str) -> None:
    change, message = BAD[case]
    changed(folder, change)
    with pytest.raises(InputError) as caught:
        read_capture(folder)
    assert message in str(caught.value)
    assert str(folder) in str(caught.value), "the file is named"
    assert caught.value.expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not JSON"),
        ('{"frames": [', "is not JSON"),
        ("[1, 2]", "found [1, 2]; expected a JSON object"),
    ],
)
def test_refuses_what_is_no_json_object(folder: Path, text: str, message: str) -> None:
    (folder / "transforms.json").write_text(text)
    with pytest.raises(InputError) as caught:
        read_capture(folder)
    assert message in str(caught.value) and "transforms.json" in str(caught.value)


def test_refuses_bytes_and_deep_nesting(folder: Path) -> None:
    for contents in (b"\xff\xfe\x00", b"[" * 200_000):
        (folder / "transforms.json").write_bytes(contents)
        with pytest.raises(InputError, match=r"transforms\.json: is not JSON"):
            read_capture(folder)


def test_refuses_a_folder_without_capture(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"transforms\.json: no such file; expected a capture folder"):
        read_capture(tmp_path)
    with pytest.raises(InputError, match="nowhere: no such file"):
        read_capture(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (
            np.nan,
            "1 pixels are NaN or infinite, the first at row 2, column 3 (0.5, nan, 0.5); expected finite",
        ),
        (np.inf, "(0.5, inf, 0.5)"),
        (
            -0.25,
            "1 pixels are negative, down to -0.25, the first at row 2, column 3; expected radiance of 0",
        ),
    ],
)
def test_refuses_pixels_that_are_no_radiance(folder: Path, value: float, message: str) -> None:
    pixels = np.full((6, 8, 3), 0.5, np.float32)
    pixels[2, 3, 1] = value
    pixels[0, 0, 0] = value  # outside the mask: of no concern
    write_exr(folder / "images/0.exr", pixels)
    with pytest.raises(InputError) as caught:
        read_photograph(read_capture(folder).frames[0])
    assert message in str(caught.value) and "0.exr (frame images/0.exr)" in str(caught.value)


def test_pixels_outside_the_mask_may_be_anything(folder: Path) -> None:
    pixels = np.full((6, 8, 3), np.nan, np.float32)
    pixels[2:4, 2:4] = 0.5
    write_exr(folder / "images/0.exr", pixels)
    photograph = read_photograph(read_capture(folder).frames[0])
    assert np.isfinite(photograph.radiance).all() and photograph.valid.sum() == 4


def test_refuses_a_mask_of_another_size(folder: Path) -> None:
    cv2.imwrite(str(folder / "images/m.png"), np.zeros((3, 4), np.uint8))
    with pytest.raises(
        InputError, match=r"m\.png \(mask of frame images/0\.exr\): the image is 4 x 3; expected 8 x 6"
    ):
        read_photograph(read_capture(folder).frames[0])


def test_refuses_a_truncated_photograph(folder: Path) -> None:
    path = folder / "images/0.exr"
    capture = read_capture(folder)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(InputError, match=r"0\.exr: cannot be read"):
        read_photograph(capture.frames[0])


@pytest.mark.parametrize("name", ["sphere-merl", "igea-merl", "spot-merl-interreflect"])
def test_real_captures(shared: Path, name: str) -> None:
    for folder in (shared / "captures" / name, shared / "captures" / name / "test"):
        capture = read_capture(folder)
        photograph = read_photograph(capture.frames[-1])
        covered = photograph.alpha > 0
        assert 0.1 < covered.mean() < 0.9
        assert photograph.radiance[covered].mean() > 0.01 and not photograph.radiance[~covered].any()
        # The object is at the origin, in the middle of the image.
        uv_px, depth = capture.frames[-1].camera.project(np.zeros((1, 3)))
        assert depth[0] > 0
        assert np.abs(uv_px[0] / photograph.alpha.shape[1] - 0.5).max() < 0.05

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The server behind the page of ``prepare pairs``: who may ask, what it answers, what it writes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from http.client import HTTPConnection
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pairs_scene import Scene, make_scene, serving
from swatchwork.capture import linear_from_srgb, write_exr
from swatchwork.cli import main
from swatchwork.errors import CaptureWarning, InputError
from swatchwork.prepare.registering import apart, read_pairs
from swatchwork.surface import write_mesh_obj
from swatchwork.workflow.pairs_outline import edges
from swatchwork.workflow.pairs_server import PairsServer
from swatchwork.workflow.preparing_pairs import open_desk

UV = np.array(
    [[90.0, 120.5], [150.25, 100.0], [205.0, 118.0], [128.0, 140.0], [185.0, 138.0], [110.0, 105.0]]
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return make_scene(tmp_path_factory.mktemp("pairs"))


@pytest.fixture
def server(scene: Scene) -> Iterator[PairsServer]:
    scene.output.unlink(missing_ok=True)
    with serving(scene) as server:
        yield server


def ask(server: PairsServer, name: str, body: Any = None, *, raw: bytes | None = None) -> Any:
    data = raw if raw is not None else None if body is None else json.dumps(body).encode()
    with urllib.request.urlopen(server.url + name, data=data, timeout=10) as answer:
        content = answer.read()
        return json.loads(content) if answer.headers["Content-Type"] == "application/json" else content


def refused(server: PairsServer, name: str, body: Any = None, *, raw: bytes | None = None) -> tuple[int, str]:
    with pytest.raises(urllib.error.HTTPError) as caught:
        ask(server, name, body, raw=raw)
    with caught.value as error:
        return error.code, json.loads(error.read())["error"]


def status(server: PairsServer, path: str, host: str, method: str = "GET") -> int:
    connection = HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    connection.request(method, path, headers={"Host": host})
    code = connection.getresponse().status
    connection.close()
    return code


def clicked(scene: Scene, uv: np.ndarray = UV) -> dict[str, Any]:
    return {"uv_px": uv.tolist(), "x_in_mesh": scene.seen(uv).tolist()}


def test_only_this_machine_with_the_token_and_the_right_host_may_ask(server: PairsServer) -> None:
    here = f"127.0.0.1:{server.server_port}"
    path = f"/{server.token}/state"
    assert server.server_address[0] == "127.0.0.1"
    assert status(server, path, here) == 200
    assert status(server, path, f"localhost:{server.server_port}") == 200
    for wrong in ("/state", "/", "//state", f"/{server.token[:-1]}/state", f"/{server.token}x/state"):
        assert status(server, wrong, here) == 403, wrong
    for host in ("evil.example", f"evil.example:{server.server_port}", "127.0.0.1", ""):
        assert status(server, path, host) == 403, host
        assert status(server, f"/{server.token}/save", host, "POST") == 403, host


def test_no_other_files_are_served(server: PairsServer) -> None:
    assert b"<title>Pairs" in ask(server, "")
    assert b"PhotoPane" in ask(server, "photo.js")
    for name in (
        "index.html/../../pairs_desk.py",
        "../pairs_desk.py",
        "%2e%2e/pairs_desk.py",
        "pairs.json",
        "etc",
    ):
        assert refused(server, name)[0] == 404, name
    assert refused(server, "nothing", {})[0] == 404


def test_the_page_holds_no_address_outside(server: PairsServer) -> None:
    for name, (_, content) in server.page.items():
        assert b"http" not in content.replace(b"http-equiv", b""), name


def test_state_and_mesh_agree(server: PairsServer, scene: Scene) -> None:
    state, mesh = ask(server, "state"), scene.rays.meshes[0]
    buffer = ask(server, "mesh")
    vertices, faces = state["mesh"]["vertices"], state["mesh"]["faces"]
    assert len(buffer) == 24 * vertices + 12 * faces
    position = np.frombuffer(buffer, "<f4", 3 * vertices).reshape(-1, 3)
    # An ulp of the unit ball: what is left of single precision when the mesh is centred first.
    back = state["mesh"]["centre"] + state["mesh"]["radius"] * position.astype(np.float64)
    np.testing.assert_allclose(back, mesh.vertices, atol=1.2e-7 * state["mesh"]["radius"])
    index = np.frombuffer(buffer, "<u4", 3 * faces, 24 * vertices).reshape(-1, 3)
    np.testing.assert_array_equal(index, mesh.faces)


def test_photograph_is_as_bright_as_asked_for(server: PairsServer) -> None:
    def decoded(stops: float) -> np.ndarray:
        content = ask(server, f"photograph?number=0&stops={stops}")
        return np.asarray(Image.open(BytesIO(content)), dtype=np.float64)

    plain, darker = decoded(0), decoded(-1)
    assert plain.shape == (240, 300, 3)
    # 2 % of the pixels of a picture that is a hundredth as bright as white are brought to 0.9, sRGB 243.
    assert 235 < np.quantile(plain, 0.98) < 250
    lit = (plain > 60) & (plain < 240)
    # Codes are rounded, and JPEG leaves a few of them on edges: the typical pixel is what counts.
    assert np.median(
        linear_from_srgb(darker[lit] / 255) / linear_from_srgb(plain[lit] / 255)
    ) == pytest.approx(0.5, abs=0.01)
    for wrong in ("number=1", "number=-1", "number=x", "number=0&stops=nan", "number=0&stops=99", ""):
        assert refused(server, f"photograph?{wrong}")[0] == 400, wrong


def test_pick_is_the_ray_scenes(server: PairsServer, scene: Scene) -> None:
    state = ask(server, "state")["mesh"]
    origin = (scene.camera.position - state["centre"]) / state["radius"]
    for d, expected in zip(scene.camera.rays(UV), scene.seen(UV), strict=True):
        found = ask(server, "pick", {"origin": origin.tolist(), "direction": (7 * d).tolist()})
        # The ray passes through JSON and into the ball and back: rounding of doubles, then Embree's singles.
        np.testing.assert_allclose(found["x_in_mesh"], expected, atol=1e-6 * state["radius"])
    away = {"origin": origin.tolist(), "direction": (-d).tolist()}
    assert ask(server, "pick", away) == {"x_in_mesh": None}


def test_hidden_points_are_told(server: PairsServer, scene: Scene) -> None:
    state = ask(server, "state")["mesh"]
    eye = (scene.camera.position - state["centre"]) / state["radius"]
    front = scene.seen(UV)
    behind = front - 1.5 * state["radius"] * scene.camera.rays(UV) * [-1, -1, -1]
    asked = {"eye": eye.tolist(), "x_in_mesh": [*front.tolist(), *behind.tolist()]}
    assert ask(server, "hidden", asked)["hidden"] == [False] * 6 + [True] * 6
    assert ask(server, "hidden", {"eye": eye.tolist(), "x_in_mesh": []}) == {"hidden": []}


def test_pose_of_exact_pairs_is_the_cameras(server: PairsServer, scene: Scene) -> None:
    posed = ask(server, "pose", clicked(scene))
    found = scene.camera.__class__(
        **{**scene.camera.__dict__, "world_from_camera": np.array(posed["world_from_camera"])}
    )
    angle, away = apart(scene.camera, found, scene.rays.centre)
    # Points are right to Embree's single precision, 1e-7 of the radius: a ten thousandth of a pixel here.
    assert angle < 0.01 and away < 1e-4 and posed["rms_px"] < 1e-3
    assert posed["inliers"] == [True] * 6
    np.testing.assert_allclose(posed["projected_px"], UV, atol=5e-3)


def test_a_wrong_pair_is_an_outlier(server: PairsServer, scene: Scene) -> None:
    asked = clicked(scene)
    asked["uv_px"][2][0] += 25
    posed = ask(server, "pose", asked)
    assert posed["inliers"] == [True, True, False, True, True, True]
    assert posed["residual_px"][2] == pytest.approx(25, abs=0.1)


def test_too_few_or_useless_pairs_give_a_reason(server: PairsServer, scene: Scene) -> None:
    assert "3 pairs" in ask(server, "pose", clicked(scene, UV[:3]))["reason"]
    same = {"uv_px": [[1, 2]] * 5, "x_in_mesh": [[1, 2, 3]] * 5}
    assert ask(server, "pose", same)["reason"]


def test_outline_surrounds_the_object(server: PairsServer, scene: Scene) -> None:
    pose = scene.camera.world_from_camera.tolist()
    asked = {"world_from_camera": pose, "window": [0, 0, 300, 240], "size": [300, 240]}
    drawn = np.asarray(Image.open(BytesIO(ask(server, "outline", asked))))
    d = scene.camera.rays(scene.camera.pixel_centres())
    inside = scene.rays.first_hit(np.broadcast_to(scene.camera.position, d.shape), d).face >= 0
    inside = inside.reshape(240, 300)
    rim = inside & ~(
        np.roll(inside, 1, 0) & np.roll(inside, -1, 0) & np.roll(inside, 1, 1) & np.roll(inside, -1, 1)
    )
    # A thin line is blurred a little, so that it does not show stairs.
    assert (drawn[rim][:, 3] > 150).all()
    # The line and its halo are 7 pixels wide; the rest of the picture is free of it.
    assert (drawn[..., 3] > 0).sum() < 12 * rim.sum()


def test_a_slanted_plane_has_no_edges_and_a_step_one() -> None:
    v, u = np.mgrid[0:20, 0:30]
    plane = 1 / (0.2 + 0.01 * u + 0.004 * v)
    assert not edges(plane, 0.01).any()
    stepped = np.where(u < 15, plane, plane + 0.5)
    assert edges(stepped, 0.1)[1:-1].any(axis=1).all()
    # The line is on the nearer side.
    assert not edges(stepped, 0.1)[:, 16:].any()


def test_save_writes_what_read_pairs_reads_and_a_new_page_goes_on(server: PairsServer, scene: Scene) -> None:
    asked = clicked(scene)
    listed = [{"uv_px": u, "x_in_mesh": x} for u, x in zip(asked["uv_px"], asked["x_in_mesh"], strict=True)]
    assert ask(server, "save", {"photographs": {"IMG_1.exr": listed}}) == {"saved": "pairs.json", "pairs": 6}
    document = json.loads(scene.output.read_text())
    assert document["mesh"] == "blob.obj"
    assert document["photographs"] == {"IMG_1.exr": listed}
    read = read_pairs(scene.output)["IMG_1"]
    np.testing.assert_array_equal(read.uv_px, UV)
    assert ask(server, "state")["pairs"] == {"IMG_1.exr": listed}
    with serving(scene) as again:
        assert ask(again, "state")["pairs"] == {"IMG_1.exr": listed}
    assert [f.name for f in scene.folder.iterdir() if "partial" in f.name] == []


def test_clicks_may_lie_outside_the_photograph(server: PairsServer) -> None:
    listed = [{**GOOD, "uv_px": uv} for uv in ([-299.0, 2.0], [9.0, 479.0])]
    assert ask(server, "save", {"photographs": {"IMG_1.exr": listed}})["pairs"] == 2


def test_pairs_of_photographs_that_are_not_shown_stay(scene: Scene) -> None:
    other = {"IMG_2.exr": [{"uv_px": [1.0, 2.0], "x_in_mesh": [3.0, 4.0, 5.0]}]}
    scene.output.write_text(json.dumps({"mesh": "blob.obj", "photographs": other}))
    with serving(scene) as server:
        assert ask(server, "state")["pairs"] == {}
        ask(server, "save", {"photographs": {"IMG_1.exr": [{"uv_px": [9, 8], "x_in_mesh": [7, 6, 5]}]}})
        # What the summary counts is what the file has.
        assert {p.photograph: len(p) for p in server.desk.saved.values()} == {"IMG_1.exr": 1, "IMG_2.exr": 1}
        assert set(ask(server, "state")["pairs"]) == {"IMG_1.exr"}
    assert set(json.loads(scene.output.read_text())["photographs"]) == {"IMG_1.exr", "IMG_2.exr"}


GOOD = {"uv_px": [1.0, 2.0], "x_in_mesh": [3.0, 4.0, 5.0]}
DAMAGED = {
    "no photographs": {},
    "a list": {"photographs": [GOOD]},
    "another photograph": {"photographs": {"other.exr": [GOOD]}},
    "no list": {"photographs": {"IMG_1.exr": GOOD}},
    "a missing side": {"photographs": {"IMG_1.exr": [GOOD, {"uv_px": [1, 2]}]}},
    "too short": {"photographs": {"IMG_1.exr": [{**GOOD, "x_in_mesh": [1, 2]}]}},
    "text": {"photographs": {"IMG_1.exr": [{**GOOD, "uv_px": ["1", 2]}]}},
    "true": {"photographs": {"IMG_1.exr": [{**GOOD, "uv_px": [True, 2]}]}},
    "NaN": {"photographs": {"IMG_1.exr": [{**GOOD, "uv_px": [float("nan"), 2]}]}},
    "far left of the photograph": {"photographs": {"IMG_1.exr": [GOOD, {**GOOD, "uv_px": [-301, 2]}]}},
    "far below the photograph": {"photographs": {"IMG_1.exr": [{**GOOD, "uv_px": [9, 481]}]}},
    "an integer without end": {"photographs": {"IMG_1.exr": [{**GOOD, "uv_px": [10**400, 2]}]}},
}


@pytest.mark.parametrize("wrong", DAMAGED)
def test_damaged_saves_are_refused_and_nothing_is_written(
    server: PairsServer, scene: Scene, wrong: str
) -> None:
    code, message = refused(server, "save", DAMAGED[wrong])
    assert code == 400 and message
    assert not scene.output.exists()


@pytest.mark.parametrize("raw", [b"", b"{", b"[]", b"\xff", b"null", b"[" * 100_000], ids=repr)
def test_what_is_no_json_object_is_refused(server: PairsServer, raw: bytes) -> None:
    for name in ("pick", "hidden", "pose", "outline", "save"):
        assert refused(server, name, raw=raw)[0] == 400, name


@pytest.mark.parametrize(
    ("name", "body"),
    [
        ("pick", {"origin": [0, 0, 4], "direction": [0, 0, 0]}),
        ("pick", {"origin": [0, 0], "direction": [0, 0, 1]}),
        ("hidden", {"eye": [0, 0, 4], "x_in_mesh": [[1, 2]]}),
        ("pose", {"uv_px": [[1, 2]], "x_in_mesh": []}),
        ("outline", {}),
        ("outline", {"world_from_camera": np.eye(4).tolist(), "window": [0, 0, 0, 9], "size": [9, 9]}),
        ("outline", {"world_from_camera": np.eye(4).tolist(), "window": [0, 0, 9, 9], "size": [9, 1e9]}),
        ("outline", {"world_from_camera": np.ones((4, 4)).tolist(), "window": [0, 0, 9, 9], "size": [9, 9]}),
    ],
)
def test_damaged_questions_are_refused(server: PairsServer, name: str, body: dict[str, Any]) -> None:
    code, message = refused(server, name, body)
    assert code == 400 and message


def test_a_disk_that_cannot_be_written_is_told_and_the_old_file_stays(
    server: PairsServer, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask(server, "save", {"photographs": {"IMG_1.exr": [GOOD]}})
    before = scene.output.read_bytes()

    def full(source: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    code, message = refused(server, "save", {"photographs": {"IMG_1.exr": [GOOD, GOOD]}})
    assert code == 507 and "No space left" in message
    assert scene.output.read_bytes() == before


def wrong_input(scene: Scene, folder: Path, **changed: Any) -> InputError:
    files = {
        "photographs": [scene.photograph],
        "output": folder / "pairs.json",
        "mesh": scene.folder / "blob.obj",
        "intrinsics": scene.folder / "lens.json",
    }
    with pytest.raises(InputError) as caught:
        open_desk(**{**files, **changed})
    return caught.value


def test_wrong_files_are_refused_before_anything_is_served(scene: Scene, tmp_path: Path) -> None:
    write_exr(tmp_path / "small.exr", np.zeros((10, 20, 3), dtype=np.float32))
    assert "20 x 10" in str(wrong_input(scene, tmp_path, photographs=[tmp_path / "small.exr"]))
    assert "names that differ" in str(
        wrong_input(scene, tmp_path, photographs=[scene.photograph, tmp_path / "IMG_1.png"])
    )
    assert "ending in .json" in str(wrong_input(scene, tmp_path, output=tmp_path / "pairs.txt"))
    assert "does not exist" in str(wrong_input(scene, tmp_path, output=tmp_path / "no" / "pairs.json"))
    assert "does not exist" in str(wrong_input(scene, tmp_path, mesh=tmp_path / "no.obj"))
    assert "intrinsics" in str(wrong_input(scene, tmp_path, intrinsics=tmp_path / "no.json"))
    (tmp_path / "pairs.json").write_text('{"photographs": {"IMG_1.exr": [{"uv_px": [1]}]}}')
    assert "uv_px" in str(wrong_input(scene, tmp_path))


def test_pairs_of_another_mesh_are_told(scene: Scene, tmp_path: Path) -> None:
    write_mesh_obj(tmp_path / "other.obj", scene.rays.meshes[0])
    (tmp_path / "pairs.json").write_text(json.dumps({"mesh": "blob.obj", "photographs": {}}))
    with pytest.warns(CaptureWarning, match=r"points are of blob\.obj, and the mesh is other\.obj"):
        open_desk(
            [scene.photograph], tmp_path / "pairs.json", tmp_path / "other.obj", scene.folder / "lens.json"
        )


def test_a_taken_port_is_said_in_one_line(
    server: PairsServer, scene: Scene, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = ["prepare", "pairs", *scene.arguments(), "--no-open", "--port", str(server.server_port)]
    assert main(taken) == 2
    assert f"port {server.server_port} cannot be used" in capsys.readouterr().err


def test_command_prints_the_address_and_ends_by_ctrl_c_without_writing(scene: Scene) -> None:
    scene.output.unlink(missing_ok=True)
    command = [sys.executable, "-m", "swatchwork.cli", "prepare", "pairs", *scene.arguments(), "--no-open"]
    code = "import sys; from swatchwork.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, *command[3:]]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ
    ) as run:
        assert run.stderr is not None
        lines = iter(run.stderr.readline, "")
        url = next(line.strip() for line in lines if line.startswith("http://127.0.0.1:"))
        with urllib.request.urlopen(url, timeout=10) as answer:
            assert b"Photograph" in answer.read()
        run.send_signal(signal.SIGINT)
        out, _ = run.communicate(timeout=20)
    assert run.returncode == 0
    assert "Nothing was saved" in out
    assert not scene.output.exists()

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The viewer's page in a headless browser, beside `relight`, the same model on the CPU.

Drawn by software, a picture takes seconds: those compared are windows of an object 160 pixels wide, and make
some of the 64 passes that a person's still picture has: 16 on a sphere, 32 where there are shadow edges. The
others change them by a few tenths of a per cent.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import headless
import numpy as np
import pytest

import viewing
from swatchwork.arrays import F32
from swatchwork.evaluate import nrms
from swatchwork.reflectance import extended, paper
from swatchwork.relight import RelitScene, render
from swatchwork.simulate import procedural_environment, random_directions
from swatchwork.viewer import Light, Shot, TexelMap, ViewerScene, write_viewer

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
if headless.CHROMIUM is None:
    pytest.skip("no Chromium on this machine", allow_module_level=True)

WINDOWS = ((69, 72), (134, 62), (65, 14))


class Page(headless.Shown):
    """A page, and the scene that is on it."""

    def __init__(self, browser: Any, file: Path, viewer: ViewerScene) -> None:
        self.viewer = viewer
        write_viewer(file, viewer)
        super().__init__(browser, file)

    def drawn(self, script: str = "0") -> F32:
        """What the canvas shows after a script, drawn while moving."""
        self.run("swatchwork.stage.stats.firstPicture = null")
        self.run(script)
        self.run("swatchwork.stage.change(); swatchwork.stage.paused = false")
        self.until("swatchwork.stage.stats.firstPicture !== null")
        self.run("swatchwork.stage.paused = true")
        png = np.frombuffer(self.page.locator("#stage").screenshot(), np.uint8)
        found = cv2.imdecode(png, cv2.IMREAD_COLOR)
        assert found is not None
        return found.astype(np.float32)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with headless.browser() as found:
        yield found


def viewer_of(scene: RelitScene) -> ViewerScene:
    lights = (
        Light.of("room", procedural_environment("room", 1, height=64)),
        Light.of("overcast", procedural_environment("overcast", 2, height=64)),
    )
    camera = viewing.window(random_directions(1, seed=3)[0], 20, 20)
    shot = Shot("one", np.full((30, 40, 4), 255, np.uint8), 4.0, camera, 1, np.eye(3))
    values = np.full(scene.texel_of_pixel.shape, 0.1, np.float32)
    return ViewerScene("test", scene, lights, (shot,), (TexelMap("residual", values, 0.2, "%"),))


@pytest.fixture(scope="module")
def convex(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return Page(
        browser,
        tmp_path_factory.mktemp("viewer") / "sphere.html",
        viewer_of(viewing.scene("sphere", paper())),
    )


@pytest.fixture(scope="module")
def concave(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return Page(
        browser,
        tmp_path_factory.mktemp("viewer") / "knot.html",
        viewer_of(viewing.scene("knot", extended())),
    )


# What is left on the concave one is shadow edges as sharp as its texels, which the page interpolates.
# With 16 passes the concave one's worst window is off by 0.086, with 32 by 0.042, with all by 0.039.
@pytest.mark.parametrize(("shape", "passes", "bound"), [("convex", 16, 0.03), ("concave", 32, 0.05)])
def test_still_pictures_agree_with_relight(
    shape: str, passes: int, bound: float, request: pytest.FixtureRequest
) -> None:
    page: Page = request.getfixturevalue(shape)
    scene = page.viewer.scene
    assert bool(len(scene.sky.words)) == (shape == "concave")
    cameras = [viewing.window(d, *at) for d, at in zip(random_directions(3, seed=3), WINDOWS, strict=True)]
    found = {}
    for number, light in enumerate(page.viewer.lights):
        page.run(f"swatchwork.setLight({number})")
        for k, camera in enumerate(cameras):
            reference, picture = render(scene, camera, light.environment), page.still(camera, passes)
            mask = reference[..., 3] > 0.5
            found[light.name, k] = nrms(picture[..., :3], reference[..., :3], mask)
            # So many places in a pixel measure its coverage to a few per cent, and less in the mean.
            assert abs(picture[..., 3].mean() - reference[..., 3].mean()) < 0.01
    assert max(found.values()) < bound, found
    assert page.said == []


def test_blends_of_nine(browser: Any, convex: Page, tmp_path: Path) -> None:
    scene = convex.viewer.scene
    # The same material, in the last of nine slots.
    pad = ((0, 0), (0, 0), (7, 0))
    nine = replace(scene, index=np.pad(scene.index, pad), weight=np.pad(scene.weight, pad))
    page = Page(browser, tmp_path / "nine.html", viewer_of(nine))
    camera = viewing.window(random_directions(1, seed=3)[0], 60, 65)
    pictures = []
    for one in (convex, page):
        one.run("swatchwork.setLight(0)")
        pictures.append(one.still(camera, 2))
    same, found = pictures
    # Weights are rounded to 16 bits in another order.
    assert nrms(found[..., :3], same[..., :3], same[..., 3] > 0.5) < 1e-3
    assert page.said == []
    page.page.close()


def test_asks_for_nothing(convex: Page, concave: Page) -> None:
    for page in (convex, concave):
        assert [url for url in page.asked if not url.startswith(("file:", "data:", "blob:"))] == []
        assert len([url for url in page.asked if url.startswith("file:")]) == 1


def test_keys_move_the_picture(convex: Page) -> None:
    convex.page.locator("#stage").focus()
    before = convex.drawn()
    assert np.array_equal(convex.drawn(), before)
    convex.page.keyboard.press("ArrowLeft")
    turned = convex.drawn()
    assert np.abs(turned - before).max() > 20
    convex.page.keyboard.press("ArrowRight")
    assert np.abs(convex.drawn() - before).mean() < 0.5
    convex.page.keyboard.press("]")
    assert convex.run("swatchwork.stage.angle") == pytest.approx(np.radians(5))
    assert np.abs(convex.drawn() - before).max() > 5
    convex.page.keyboard.press(".")
    assert convex.drawn().mean() > before.mean()
    convex.page.keyboard.press("r")
    assert convex.run("[swatchwork.stage.angle, swatchwork.stage.ev]") == [0, 0]
    convex.page.keyboard.press("?")
    keys = convex.page.locator("#keys")
    assert keys.is_visible() and "turn the light" in keys.inner_text() and "[object" not in keys.inner_text()
    convex.page.keyboard.press("Escape")
    assert convex.said == []


def test_fingers_turn_and_pinch(convex: Page) -> None:
    session = convex.page.context.new_cdp_session(convex.page)
    box = convex.page.locator("#stage").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    eye = "swatchwork.orbit.camera.position.clone().sub(swatchwork.orbit.centre).toArray()"

    def touch(kind: str, *at: tuple[float, float]) -> None:
        points = [{"x": x + dx, "y": y + dy, "id": finger} for finger, (dx, dy) in enumerate(at)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    convex.run("swatchwork.orbit.reset()")
    stood = np.array(convex.run(eye))
    touch("touchStart", (0, 0))
    touch("touchMove", (30, 0))
    touch("touchMove", (60, 0))
    touch("touchEnd")
    turned = np.array(convex.run(eye))
    # About the object's middle: as far from it as before, elsewhere.
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(stood), rel=1e-6)
    assert np.linalg.norm(turned - stood) > 0.2 * np.linalg.norm(stood)
    touch("touchStart", (-20, 0), (20, 0))
    touch("touchMove", (-40, 0), (40, 0))
    touch("touchMove", (-60, 0), (60, 0))
    touch("touchEnd")
    nearer = np.array(convex.run(eye))
    assert np.linalg.norm(nearer) < 0.7 * np.linalg.norm(turned)
    convex.run("swatchwork.orbit.reset()")
    session.detach()
    assert convex.said == []


@pytest.mark.parametrize("kind", ["hdr", "exr"])
def test_a_dropped_light_is_the_one_in_the_file(convex: Page, kind: str, tmp_path: Path) -> None:
    light = procedural_environment("overcast", 2, height=64)
    file = tmp_path / f"dropped.{kind}"
    if kind == "hdr":
        cv2.imwrite(str(file), np.ascontiguousarray(light.radiance[..., ::-1]))
    else:
        from swatchwork.capture import write_exr

        write_exr(file, light.radiance)
    camera = viewing.window(random_directions(1, seed=3)[0], 60, 65)
    convex.run("swatchwork.setLight(1)")
    same = convex.still(camera, 4)
    script = """async ([text, name, convention]) => {
      const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0)), data = new DataTransfer();
      data.items.add(new File([bytes], name));
      const event = { bubbles: true, cancelable: true, dataTransfer: data };
      const last = () => swatchwork.lights.at(-1);
      document.body.dispatchEvent(new DragEvent("drop", event));
      while (last().name !== name || !last().held) await new Promise(r => setTimeout(r, 20));
      const before = last().held.cube.texture;
      await swatchwork.setConvention(convention);
      return swatchwork.renderer.gl.isTexture(before);
    }"""
    kept = convex.run(script, [base64.b64encode(file.read_bytes()).decode(), file.name, light.convention])
    assert not kept, "the light as it was read at first is still on the card"
    found = convex.still(camera, 4)
    # RGBE keeps eight bits of the brightest channel.
    assert nrms(found[..., :3], same[..., :3], same[..., 3] > 0.5) < 0.01
    assert convex.page.locator("#light").evaluate("e => e.selectedOptions[0].text") == file.name
    assert convex.said == []


def test_a_file_that_is_no_light_is_said(convex: Page) -> None:
    said = convex.run("swatchwork.panel.open(new File(['x'], 'photo.jpg')).catch(e => e.message)")
    assert said == "photo.jpg is not a light probe: drop an .hdr or .exr file"
    said = convex.run("swatchwork.panel.open(new File(['nothing'], 'a.hdr')).catch(e => e.message)")
    assert said.startswith("a.hdr cannot be read")


def test_photograph_beside_the_material(convex: Page) -> None:
    convex.run("swatchwork.panel.pickShot(0)")
    assert convex.run("swatchwork.light") == 1
    white = [
        float((convex.drawn(f"swatchwork.stage.split = {s}").min(axis=-1) > 250).mean()) for s in (0.1, 0.9)
    ]
    # The photograph is plain white, and the more of it is shown.
    assert white[1] > white[0] + 0.2
    handle = convex.page.locator("#handle")
    assert handle.is_visible()
    handle.focus()
    convex.page.keyboard.press("ArrowLeft")
    assert convex.run("swatchwork.stage.split") == pytest.approx(0.88)
    # Orbiting leaves the photograph's camera, from where it stood.
    stood = convex.viewer.shots[0].camera.position
    place = "swatchwork.orbit.camera.position.toArray()"
    assert np.allclose(convex.run(place), stood, rtol=1e-5)
    convex.run("swatchwork.orbit.turn(0.1, 0)")
    assert 0 < np.linalg.norm(np.array(convex.run(place)) - stood) < 0.11 * np.linalg.norm(stood)
    assert convex.run("swatchwork.shot") is None and not handle.is_visible()
    assert convex.said == []


def test_maps_and_spheres(concave: Page) -> None:
    # How coarse a moving picture is follows how long the last one took: held, so that two can be compared.
    concave.run("swatchwork.stage.moving = { cells: 8, get scale() { return 0.3 }, set scale(given) {} }")
    lit = concave.drawn()
    pictures = [concave.drawn(f"swatchwork.panel.pickMap({k})") for k in (1, 2, 3, 4, 5, 6)]
    assert all(np.abs(picture - lit).max() > 20 for picture in pictures)
    values = concave.run("swatchwork.valuesOf(0).then(v => v.texels[0])")
    assert values == 128  # half of the map's top
    concave.run("swatchwork.panel.pickMap(0)")
    spheres = [concave.drawn(f"swatchwork.panel.pickSphere({n})") for n in (0, 1)]
    assert np.abs(spheres[0] - spheres[1]).max() > 5
    # A map of the object's texels means nothing on a sphere, nor the sphere under such a map.
    concave.run("swatchwork.panel.pickMap(4)")
    assert not concave.run("swatchwork.onSphere")
    concave.run("swatchwork.panel.pickSphere(1)")
    assert concave.run("swatchwork.stage.map") is None
    assert concave.run("swatchwork.panel.map.value") == "0"
    # One of the representatives' weights follows the representative.
    concave.run("swatchwork.panel.pickMap(3)")
    concave.run("swatchwork.panel.pickSphere(0)")
    assert concave.run("[swatchwork.stage.map.kind, swatchwork.stage.map.chosen]") == [2, 0]
    concave.run("swatchwork.panel.pickMap(0)")
    concave.run("swatchwork.panel.pickSphere(null)")
    assert np.abs(concave.drawn() - lit).mean() < 0.5
    concave.run("swatchwork.stage.moving = { cells: 8, scale: 0.3 }")
    assert concave.said == []


def test_the_read_out_is_the_texel(concave: Page) -> None:
    scene = concave.viewer.scene
    concave.run("swatchwork.compare(null)")
    x, y, found = concave.run("""() => {
      const { clientWidth: w, clientHeight: h } = swatchwork.canvas;
      for (let j = 1; j < 20; j++) for (let i = 1; i < 20; i++) {
        const found = swatchwork.at(w * i / 20, h * j / 20);
        if (found) return [i, j, found];
      }
    }""")
    assert 0 < x < 20 and 0 < y < 20
    u, v = found["uv"]
    row, column = int((1 - v) * viewing.ATLAS), int(u * viewing.ATLAS)
    blend = dict(zip(scene.index[row, column].tolist(), scene.weight[row, column].tolist(), strict=True))
    for index, weight in found["blend"]:
        assert weight == pytest.approx(blend[index], abs=1e-4)

# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The page of ``prepare pairs`` in a real browser: by mouse, by keyboard alone, going on from a file."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pairs_scene import Scene, lens_of, make_scene, serving
from swatchwork.prepare.registering import apart, pose_from_pairs, read_pairs

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""As root, and with WebGL on the processor."""
ZOOMS = 3
"""Presses of + in the test by keyboard."""
UV = np.array(
    [[95.0, 120.5], [150.25, 104.0], [200.0, 118.0], [128.0, 140.0], [182.0, 136.0], [112.0, 108.0]]
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (extra dev)")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"no browser is installed (looked for {', '.join(BROWSERS)})")
    with playwright.sync_playwright() as started:
        try:
            browser = started.chromium.launch(executable_path=found, args=SOFTWARE)
        except playwright.Error as error:
            # As a stub that only says how to install a snap.
            pytest.skip(f"{found} does not start ({error.message.splitlines()[0]})")
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return make_scene(tmp_path_factory.mktemp("page"))


class Page:
    """The page opened on a scene; a message in its console, or a refused request, fails the test."""

    def __init__(self, page: Any, url: str) -> None:
        self.page, self.wrong = page, list[str]()
        page.on("console", lambda said: self.wrong.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.goto(url)
        page.wait_for_selector("body[data-ready]", state="attached")

    def on_screen(self, pane: str, point: str, value: Any) -> list[float]:
        """Where a point of the photograph or of the mesh is in the window."""
        return self.page.evaluate(  # type: ignore[no-any-return]
            f"""(value) => {{ const pane = swatchwork.{pane}, box = pane.stage.getBoundingClientRect();
                const at = pane.toScreen({point}); return [at[0] + box.left, at[1] + box.top]; }}""",
            value,
        )

    def photo(self, uv: np.ndarray) -> list[float]:
        return self.on_screen("photo", "value", uv.tolist())

    def mesh(self, x: np.ndarray) -> list[float]:
        return self.on_screen("mesh", "swatchwork.inBall(value)", x.tolist())

    def pairs(self) -> list[dict[str, Any]]:
        return self.page.evaluate("swatchwork.pairs.list")  # type: ignore[no-any-return]

    def keys(self, *names: str) -> None:
        for name in names:
            self.page.keyboard.press(name)

    def poll(self, condition: str) -> None:
        """Wait until JavaScript says true; the page's policy keeps Playwright's own wait from evaluating."""
        for _ in range(500):
            if self.page.evaluate(condition):
                return
            self.page.wait_for_timeout(20)
        raise AssertionError(f"never came true: {condition}")

    def until(self, text: str, where: str = "#prompt") -> None:
        self.page.locator(where).filter(has_text=text).wait_for(timeout=15000)


@pytest.fixture
def scene(made: Scene) -> Scene:
    made.output.unlink(missing_ok=True)
    return made


@pytest.fixture
def opened(browser: Any, scene: Scene, request: pytest.FixtureRequest) -> Iterator[Page]:
    before = getattr(request, "param", None)
    if before is not None:
        scene.output.write_text(json.dumps(before(scene)))
    with serving(scene) as server:
        page = Page(browser.new_page(viewport={"width": 1280, "height": 800}), server.url)
        yield page
        page.page.close()
    assert page.wrong == []


def check_saved(scene: Scene, zoomed: float) -> None:
    """That the six pairs in the file are the scene's, each to what a pixel of the screen allows."""
    pairs = read_pairs(scene.output)["IMG_1"]
    # Either side may be off by half a pixel of the screen in u and v (by mouse it is mostly exact), of which
    # a photograph's pixel has 1.6 when it fills the pane; the mesh is seen larger still.
    slack_px = 2 * np.hypot(0.5, 0.5) / (1.6 * zoomed)
    assert np.abs(pairs.uv_px - UV).max() < slack_px
    off = np.linalg.norm(scene.camera.project(pairs.x_in_world)[0] - pairs.uv_px, axis=1)
    assert off.max() < slack_px
    posed = pose_from_pairs(lens_of(scene), pairs.uv_px, pairs.x_in_world)
    angle, away = apart(scene.camera, posed.camera, scene.rays.centre)
    # These points span 110 pixels and little depth: of 300 random draws of clicks within 0.88 pixels the
    # worst was off by 3.3 degrees and 5 % of the distance.
    assert angle < 4 * slack_px and away < 0.06 * slack_px


def test_six_pairs_by_mouse_are_the_cameras_pose(opened: Page, scene: Scene) -> None:
    mouse = opened.page.mouse
    for i, (uv, x) in enumerate(zip(UV, scene.seen(UV), strict=True)):
        opened.until("Click a point on the photograph" if i == 0 else "Next point" if i < 4 else "outline")
        mouse.click(*opened.photo(uv))
        opened.until("same point on the mesh")
        mouse.click(*opened.mesh(x))
        opened.page.locator("#count").filter(has_text=str(i + 1)).wait_for()
    opened.until("px rms", "#rms")
    opened.until("All 6 pairs fit", "#pose-note")
    opened.until("Not saved yet", "#file")
    opened.page.click("#save")
    opened.until("Saved in pairs.json", "#file")
    check_saved(scene, zoomed=1.0)


def test_six_pairs_by_keyboard_alone(opened: Page, scene: Scene) -> None:
    box = opened.page.evaluate("swatchwork.mesh.middle")
    opened.keys("F6", "F6", *["+"] * ZOOMS, "Shift+F6", *["+"] * ZOOMS)
    assert opened.page.evaluate("document.activeElement === swatchwork.photo.stage")
    for uv, x in zip(UV, scene.seen(UV), strict=True):
        # The crosshair of the photograph, by tens and by ones of the screen's pixels.
        for axis, names in ((0, ("ArrowLeft", "ArrowRight")), (1, ("ArrowUp", "ArrowDown"))):
            aim, zoom = opened.page.evaluate(
                "(({photo}) => [photo.toImage(photo.crosshair()), photo.zoomed])(swatchwork)"
            )
            left = round((uv[axis] - aim[axis]) * zoom)
            name = names[int(left > 0)]
            opened.keys(*[f"Shift+{name}"] * (abs(left) // 10), *[name] * (abs(left) % 10))
        opened.keys("Enter", "F6")
        opened.until("same point on the mesh")
        # Pan the mesh until the point is under the crosshair in the middle.
        stage = opened.page.evaluate(
            "(({left, top}) => [left, top])(swatchwork.mesh.stage.getBoundingClientRect())"
        )
        at = np.array(opened.mesh(x)) - stage - box
        for axis, names in ((0, ("ArrowLeft", "ArrowRight")), (1, ("ArrowUp", "ArrowDown"))):
            left = round(at[axis])
            name = names[int(left > 0)]
            opened.keys(*[f"Shift+{name}"] * (abs(left) // 10), *[f"Alt+Shift+{name}"] * (abs(left) % 10))
        before = len([p for p in opened.pairs() if p["x"]])
        opened.keys("Enter")
        opened.poll(f"swatchwork.pairs.list.filter((p) => p.x).length === {before + 1}")
        opened.until(f"{before + 1} of 4" if before + 1 < 4 else "px rms", "#rms")
        opened.keys("Shift+F6")
    opened.until("All 6 pairs fit", "#pose-note")
    opened.keys("Control+s")
    opened.until("Saved in pairs.json", "#file")
    check_saved(scene, zoomed=1.25**ZOOMS)


def six(scene: Scene) -> dict[str, Any]:
    listed = [
        {"uv_px": uv, "x_in_mesh": x} for uv, x in zip(UV.tolist(), scene.seen(UV).tolist(), strict=True)
    ]
    return {"mesh": "blob.obj", "photographs": {"IMG_1.exr": listed}}


def five_and_a_slip(scene: Scene) -> dict[str, Any]:
    document = six(scene)
    document["photographs"]["IMG_1.exr"][2]["uv_px"][0] -= 20
    return document


def test_a_point_of_the_photograph_waits_for_the_mesh(opened: Page, scene: Scene) -> None:
    opened.page.evaluate("""() => {
      const real = window.fetch;
      window.fetch = async (...given) => {
        if (String(given[0]).includes("pick")) await new Promise((done) => setTimeout(done, 400));
        return real(...given);
      };
    }""")
    mouse, x = opened.page.mouse, scene.seen(UV)
    mouse.click(*opened.photo(UV[0]))
    mouse.click(*opened.mesh(x[0]))
    mouse.click(*opened.photo(UV[1]))
    opened.poll("swatchwork.pairs.list.length === 2")
    first, second = opened.pairs()
    assert first["x"] is not None and second["x"] is None
    # Half a pixel of the screen, of which a photograph's pixel has 1.6.
    assert np.abs(np.array([first["uv"], second["uv"]]) - UV[:2]).max() < 0.5


@pytest.mark.parametrize("opened", [six], indirect=True)
def test_existing_pairs_are_gone_on_from(opened: Page, scene: Scene) -> None:
    opened.until("All 6 pairs fit", "#pose-note")
    assert opened.page.locator("#rms").inner_text().startswith("0.0")
    assert opened.page.is_disabled("#save")
    before = scene.output.read_bytes()
    opened.keys("F6", "]", "]", "Delete")
    assert [p["number"] for p in opened.pairs()] == [1, 3, 4, 5, 6]
    opened.keys("Delete", "Control+z")
    assert [p["number"] for p in opened.pairs()] == [1, 3, 4, 5, 6]
    opened.keys("Control+z")
    assert len(opened.pairs()) == 6 and opened.page.is_disabled("#save")
    opened.keys("Control+y")
    assert scene.output.read_bytes() == before
    opened.keys("Control+s")
    opened.until("Saved in pairs.json", "#file")
    kept = read_pairs(scene.output)["IMG_1"]
    # Untouched points come back as they were, to the last bit.
    np.testing.assert_array_equal(kept.uv_px, np.delete(UV, 1, axis=0))
    np.testing.assert_array_equal(kept.x_in_world, np.delete(scene.seen(UV), 1, axis=0))


def two_exchanged(scene: Scene) -> dict[str, Any]:
    document = six(scene)
    pairs = document["photographs"]["IMG_1.exr"][:5]
    pairs[0]["uv_px"], pairs[2]["uv_px"] = pairs[2]["uv_px"], pairs[0]["uv_px"]
    return {"mesh": "blob.obj", "photographs": {"IMG_1.exr": pairs}}


@pytest.mark.parametrize("opened", [two_exchanged], indirect=True)
def test_pairs_without_a_pose_say_why_and_the_list_is_worked_by_keys(opened: Page) -> None:
    opened.until("No pose: ")
    opened.until("None", "#rms")
    assert opened.page.is_disabled("#from-camera")
    opened.keys("F6", "F6", "F6", "m")
    opened.until("1Click its new place")
    opened.keys("Escape", "Delete")
    assert [p["number"] for p in opened.pairs()] == [2, 3, 4, 5]
    assert opened.page.evaluate("document.activeElement.closest('li').dataset.number") == "2"


@pytest.mark.parametrize("opened", [five_and_a_slip], indirect=True)
def test_a_slip_is_marked_and_moved_to_where_it_fits(opened: Page, scene: Scene) -> None:
    opened.until("1 of 6 pairs does not fit", "#pose-note")
    opened.until("3does not fit the others")
    row = opened.page.locator("#list li").nth(2)
    assert "off" in row.inner_text()
    # Drag the marker; then once more by the row's button and a click.
    mouse = opened.page.mouse
    mouse.move(*opened.photo(UV[2] - [20, 0]))
    mouse.down()
    mouse.move(*opened.photo(UV[2] - [10, 5]), steps=3)
    mouse.move(*opened.photo(UV[2] - [5, 0]), steps=3)
    mouse.up()
    np.testing.assert_allclose(opened.pairs()[2]["uv"], UV[2] - [5, 0], atol=0.7)
    row.get_by_role("button", name="Move pair 3").click()
    opened.until("Click its new place")
    mouse.click(*opened.photo(UV[2]))
    opened.until("All 6 pairs fit", "#pose-note")
    assert len(opened.pairs()) == 6
    opened.keys("Control+z")
    np.testing.assert_allclose(opened.pairs()[2]["uv"], UV[2] - [5, 0], atol=0.7)
    opened.keys("Control+z")
    assert opened.pairs()[2]["uv"][0] == UV[2, 0] - 20


@pytest.mark.parametrize("opened", [six], indirect=True)
def test_the_view_from_the_camera_lies_on_the_photograph(opened: Page, scene: Scene) -> None:
    opened.until("All 6 pairs fit", "#pose-note")
    opened.page.click("#from-camera")
    panes = opened.page.evaluate(
        "[swatchwork.photo, swatchwork.mesh].map((p) => p.stage.getBoundingClientRect().left)"
    )
    flat = replace(scene.camera, k1=0.0, k2=0.0, p1=0.0, p2=0.0)
    x = scene.seen(UV)
    # The mesh is seen without the lens's bend, and by the mean of two focal lengths that differ by 0.7 %.
    for uv, at in zip(flat.project(x)[0], x, strict=True):
        shift = np.array(opened.mesh(at)) - opened.photo(uv) - [panes[1] - panes[0], 0]
        assert np.abs(shift).max() < 1.0
    opened.page.wait_for_selector("#outline-row", state="visible")


def test_zoom_keeps_what_is_under_the_cursor_and_turning_what_is_in_the_middle(
    opened: Page, scene: Scene
) -> None:
    page, mouse, uv, x = opened.page, opened.page.mouse, UV[0], scene.seen(UV)[0]
    for where, size in (
        (lambda: opened.photo(uv), "swatchwork.photo.zoomed"),
        (lambda: opened.mesh(x), "swatchwork.mesh.view.f"),
    ):
        before, was = where(), page.evaluate(size)
        mouse.move(*before)
        mouse.wheel(0, -240)
        opened.poll(f"{size} > {1.3 * was}")
        # A wheel's events have whole pixels, and a step of the wheel zooms by half.
        np.testing.assert_allclose(where(), before, atol=0.5)
    box = page.locator("#mesh .stage").bounding_box()
    middle = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
    mouse.move(*opened.mesh(x))
    page.keyboard.down("Shift")
    mouse.down()
    mouse.move(*middle, steps=4)
    mouse.up()
    page.keyboard.up("Shift")
    np.testing.assert_allclose(opened.mesh(x), middle, atol=1.0)
    at = page.evaluate("(x) => swatchwork.inBall(x)", x.tolist())
    # What the server finds in the middle is next to the point.
    opened.poll(f"Math.hypot(...{at}.map((v, i) => v - swatchwork.mesh.pivot[i])) < 0.02")
    eye, pivot = page.evaluate("[swatchwork.mesh.view.eye, swatchwork.mesh.pivot]")
    mouse.move(middle[0] + 60, middle[1])
    mouse.down()
    mouse.move(middle[0] + 100, middle[1] + 30, steps=5)
    mouse.up()
    turned = page.evaluate("swatchwork.mesh.view.eye")
    # Half a degree a pixel, 50 pixels: the mesh follows the cursor, so the eye goes left and up.
    cosine = np.dot(eye, turned) / np.linalg.norm(eye) / np.linalg.norm(turned)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(25, abs=1.5)
    assert turned[0] < eye[0] and turned[1] > eye[1]
    # Single precision of the pick, times the zoom.
    np.testing.assert_allclose(opened.on_screen("mesh", "value", pivot), middle, atol=0.05)


def test_a_click_beside_the_mesh_places_nothing(opened: Page) -> None:
    box = opened.page.locator("#mesh .stage").bounding_box()
    opened.page.mouse.click(box["x"] + 5, box["y"] + 60)
    opened.until("beside the mesh")
    assert opened.pairs() == []


def test_everything_fits_a_small_screen_and_has_a_name(opened: Page) -> None:
    for size in ({"width": 1280, "height": 800}, {"width": 1024, "height": 700}):
        opened.page.set_viewport_size(size)
        root = "document.documentElement"
        assert opened.page.evaluate(f"[{root}.scrollWidth, {root}.scrollHeight]") == list(size.values())
    nameless = opened.page.evaluate(
        """[...document.querySelectorAll("button, input, [tabindex]")].filter(
            (e) => !(e.ariaLabel || e.innerText.trim() || e.labels?.length)).length"""
    )
    assert nameless == 0
    opened.keys("?")
    opened.page.locator("#help").wait_for(state="visible")
    opened.keys("Escape")
    opened.page.locator("#help").wait_for(state="hidden")


def test_a_server_that_does_not_answer_is_told_when_saving(browser: Any, scene: Scene) -> None:
    with serving(scene) as server:
        page = browser.new_page()
        asked: list[str] = []
        answered: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("requestfinished", lambda request: answered.append(request.url))
        page.goto(server.url)
        page.wait_for_selector("body[data-ready]", state="attached")
        page.evaluate("(x) => swatchwork.pairs.place('x', x)", scene.rays.centre.tolist())
        page.evaluate("swatchwork.pairs.place('uv', [9, 9])")
        # What the page asks after a change comes a moment later; an answer that fails says so, too.
        page.wait_for_timeout(500)
        while len(answered) < len(asked):
            page.wait_for_timeout(20)
        page.context.set_offline(True)
        page.click("#save")
        page.locator("#prompt").filter(has_text="Not saved: swatchwork does not answer").wait_for()
        assert page.is_enabled("#save")
        page.close()
    assert not scene.output.exists()

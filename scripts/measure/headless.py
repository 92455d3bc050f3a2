# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The viewer's page in headless Chromium that draws by software: for measurements, tests and pictures."""

from __future__ import annotations

import base64
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from swatchwork.arrays import F32
from swatchwork.capture import Camera

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SOFTWARE = [
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--no-sandbox",
]
STILL = """([camera, passes]) => {
  const bytes = new Uint8Array(swatchwork.still(camera, passes).buffer);
  let text = "";
  for (let k = 0; k < bytes.length; k += 32768) text += String.fromCharCode(...bytes.subarray(k, k + 32768));
  return btoa(text);
}"""


@contextmanager
def browser() -> Iterator[Any]:
    """A browser; playwright and Chromium must be there."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        try:
            yield found
        finally:
            found.close()


def of_page(camera: Camera) -> dict[str, Any]:
    """A camera as the page's scripts take it."""
    names = ("width", "height", "fx", "fy", "cx", "cy")
    return {name: getattr(camera, name) for name in names} | {"pose": camera.world_from_camera.tolist()}


class Shown:
    """A page that has drawn its first picture and then paused; what it said and what it asked for."""

    def __init__(
        self, browser: Any, file: Path, width: int = 460, height: int = 300, wait_s: float = 60
    ) -> None:
        self.wait_s = wait_s
        self.said: list[str] = []
        self.asked: list[str] = []
        self.page = browser.new_page(viewport={"width": width, "height": height}, color_scheme="dark")
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file.resolve().as_uri())
        self.run("swatchworkReady")
        self.until("swatchwork.stage.stats.firstPicture !== null")
        self.first_picture_s = self.run("swatchwork.stage.stats.firstPicture") / 1000
        """Seconds from the beginning of loading."""
        self.run("swatchwork.stage.paused = true")

    def run(self, script: str, argument: Any = None) -> Any:
        """What a script in the page gives."""
        return self.page.evaluate(script, argument)

    def until(self, script: str) -> None:
        """Wait for a condition; the page's policy forbids what playwright's own wait does."""
        end = time.monotonic() + self.wait_s
        while not self.run(script):
            assert time.monotonic() < end, f"{script}: {self.said}"
            time.sleep(0.05)

    def still(self, camera: Camera, passes: int) -> F32:
        """Linear radiance [H, W, 4], premultiplied, of so many passes."""
        text = self.run(STILL, [of_page(camera), passes])
        return np.frombuffer(base64.b64decode(text), np.float32).reshape(camera.height, camera.width, 4)

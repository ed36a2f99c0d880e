"""A page of `framearray view` in Debian's Chromium, driven by Playwright."""

import shutil
import time
from base64 import b64decode
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from framearray_cli.base.arrays import Bytes

PATIENCE_S = 30.0
# WebGL 2 without a graphics card; root, as in containers, has no sandbox.
ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
DESKTOP, PHONE = (1280, 800), (390, 844)


def executable() -> str | None:
    """Return the path of Chromium."""
    return next((found for name in ("chromium", "chromium-browser") if (found := shutil.which(name))), None)


@contextmanager
def browser() -> Iterator[Any]:
    """Start a browser; skip the test where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs Playwright: pip install playwright")
    if executable() is None:
        pytest.skip("needs Chromium: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=executable(), args=ARGUMENTS)
        yield running
        running.close()


class Shown:
    """A page on an array, and its errors.

    Attributes:
        page: Playwright's.
        errors: messages of the console, and exceptions.
        requests: addresses that the page requested.
    """

    def __init__(self, page: Any, url: str) -> None:
        self.page, self.errors, self.requests = page, [], []
        page.on(
            "console",
            lambda message: self.errors.append(message.text) if message.type in ("error", "warning") else None,
        )
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("request", lambda request: self.requests.append(request.url))
        page.goto(url)
        self.wait("globalThis.framearray?.level === 2")

    def get(self, expression: str) -> Any:
        return self.page.evaluate(expression)

    def wait(self, expression: str) -> None:
        """Wait until an expression is true, without Playwright's own wait: it needs eval, which the page forbids."""
        end = time.monotonic() + PATIENCE_S
        while not self.get(f"Boolean({expression})"):
            note = self.get("document.getElementById('note').textContent")
            assert time.monotonic() < end, f"never: {expression}; {note}; {self.errors}"
            time.sleep(0.01)

    def settle(self) -> None:
        """Wait until the full-size picture is there."""
        self.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        self.wait("framearray.level === 2 && !framearray.isDirty")

    def all_loaded(self) -> None:
        """Wait until everything is loaded."""
        time.sleep(0.1)  # until the page is calm
        self.wait("!framearray.store.inFlight.size && framearray.store.next >= framearray.store.wanted.length")

    @property
    def place(self) -> tuple[int, int]:
        """(c, l)."""
        c, l = self.get("[framearray.view.c, framearray.l]")
        return c, l

    def pixels(self) -> Bytes:
        """Return the drawn pixels, (h, w, 3)."""
        self.settle()
        width, height = self.get("framearray.array.resolution")
        text = self.get("btoa(framearray.picture.pixels().reduce((all, x) => all + String.fromCharCode(x), ''))")
        return np.frombuffer(b64decode(text), np.uint8).reshape(height, width, 4)[..., :3]

    def on_pad(self, c: float, l: float) -> tuple[float, float]:
        """Return the position of a place on the screen."""
        box = self.page.locator("#pad").bounding_box()
        n_c, n_l = self.get("[framearray.array.nCameras, framearray.array.main.n]")
        return box["x"] + (c + 0.5) / n_c * box["width"], box["y"] + (l + 0.5) / n_l * box["height"]

    def drag(self, places: Sequence[tuple[float, float]], steps: int = 6) -> None:
        """Press at the first place, move over the others, let go."""
        mouse = self.page.mouse
        mouse.move(*self.on_pad(*places[0]))
        mouse.down()
        for place in places[1:]:
            mouse.move(*self.on_pad(*place), steps=steps)
        mouse.up()

    def check(self, base: str) -> None:
        """Check that there were no errors, and that all requests went to one server."""
        assert self.errors == [], self.errors[:3]
        assert [url for url in self.requests if not url.startswith((base, "blob:"))] == []


@contextmanager
def shown(browser: Any, url: str, size: tuple[int, int] = DESKTOP, **context: Any) -> Iterator[Shown]:
    """Open a page at the size of a screen."""
    with browser.new_context(viewport={"width": size[0], "height": size[1]}, **context) as opened:
        yield Shown(opened.new_page(), url)

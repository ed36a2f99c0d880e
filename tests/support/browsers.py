"""A page of `framearray view` in Debian's Chromium or Firefox, driven by Playwright."""

import os
import shutil
import subprocess
import threading
import time
from base64 import b64decode
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from framearray_cli.base.arrays import Bytes

PATIENCE_S = 30.0
PROGRAMS = {"chromium": ["chromium"], "firefox": ["firefox-esr", "Xvfb"]}
OPTIONS: dict[str, dict[str, Any]] = {
    # WebGL 2 without a graphics card; root, as in containers, has no sandbox.
    "chromium": {"args": ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]},
    # The browser as it is installed, by WebDriver BiDi; Playwright's other way needs a Firefox of its own.
    # Without a screen it has no WebGL.
    "firefox": {"channel": "moz-firefox", "headless": False},
}
DARK_FIREFOX = {"layout.css.prefers-color-scheme.content-override": 0}
DESKTOP, PHONE = (1280, 800), (390, 844)


@contextmanager
def driver() -> Iterator[Any]:
    """Start Playwright, of which a process has one; skip the test where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs Playwright: pip install playwright")
    with playwright.sync_playwright() as running:
        yield running


@contextmanager
def started(driver: Any, name: str = "chromium", **preferences: Any) -> Iterator[Any]:
    """Start a browser, "chromium" or "firefox", this one with preferences; skip the test if it cannot be driven."""
    missing = [one for one in PROGRAMS[name] if shutil.which(one) is None]
    if missing:
        pytest.skip(f"needs {name}: apt-get install {' '.join(missing)}")
    options = {"executable_path": shutil.which(PROGRAMS[name][0]), **OPTIONS[name]}
    with ExitStack() as stack:
        if name == "firefox":
            downloads = stack.enter_context(TemporaryDirectory())
            preferences |= {"browser.download.dir": downloads, "browser.download.folderList": 2}
            options |= {"firefox_user_prefs": preferences, "env": stack.enter_context(_screen())}
        try:
            running = getattr(driver, name).launch(**options)
            stack.callback(running.close)
            running.downloads = Path(downloads) if name == "firefox" else None
            running.new_context().close()
        except Exception as error:  # a command that the browser does not know
            pytest.skip(f"this Playwright cannot drive {name}: {str(error).splitlines()[0]}")
        yield running


@contextmanager
def _screen() -> Iterator[dict[str, str]]:
    """Start a screen in memory; return the environment of programs that it shows."""
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", "1920x1200x24"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout
        try:
            yield os.environ | {"DISPLAY": f":{process.stdout.readline().strip()}"}
        finally:
            process.terminate()


@contextmanager
def browser() -> Iterator[Any]:
    """Start Chromium, with a driver of its own."""
    with driver() as playwright, started(playwright) as running:
        yield running


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

    def saved(self, folder: Path, press: Callable[[], None]) -> Path:
        """Press something that saves a file; return the file, in a folder."""
        downloads = self.page.context.browser.downloads
        if downloads is None:
            with self.page.expect_download() as download:
                press()
            file = folder / download.value.suggested_filename
            download.value.save_as(file)
            return file
        press()
        end = time.monotonic() + PATIENCE_S
        found: list[Path] = []
        while len(found) != 1 or not found[0].stat().st_size:  # next to an unfinished file there is another one
            assert time.monotonic() < end, f"nothing is saved: {found}"
            time.sleep(0.05)
            found = list(downloads.iterdir())
        return Path(shutil.move(found[0], folder))

    def check(self, base: str) -> None:
        """Check that there were no errors, and that all requests went to one server."""
        assert self.errors == [], self.errors[:3]
        assert [url for url in self.requests if not url.startswith((base, "blob:"))] == []


@contextmanager
def shown(
    browser: Any, url: str, size: tuple[int, int] = DESKTOP, *, script: str = "", **context: Any
) -> Iterator[Shown]:
    """Open a page at the size of a screen, a script before those of the page."""
    with browser.new_context(viewport={"width": size[0], "height": size[1]}, **context) as opened:
        if script:
            opened.add_init_script(script)
        yield Shown(opened.new_page(), url)


def touch(page: Any, *moves: Sequence[tuple[float, float]]) -> None:
    """Put fingers on a touch screen, move them, and let go; where all of them are, each time."""
    session = page.context.new_cdp_session(page)
    for k, places in enumerate((*moves, ())):
        kind = "touchEnd" if not places else "touchMove" if k else "touchStart"
        points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in enumerate(places)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


class _Silent(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""


@contextmanager
def file_server(folder: Path) -> Iterator[str]:
    """Serve a folder by Python's own file server; yield its address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Silent, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
